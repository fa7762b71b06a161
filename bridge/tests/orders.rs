//! Orders that come late or out of order are not flown (requirements D2, D6).

mod chance;
use crate::rig::{Rig, aborted, go_to, north, refused};
use bridge::{Input, SenderClock};
use dsp_protocol::{Command, Downlink, FlowControl, port};
use ipc_types::MonotonicNs;
use ipc_types::code::{
    ControlCommand, Functionality, ImiError, ModuleStatus, MovementKind, Reason, Stage,
};
use ipc_types::payload::{ModuleControl, MovementData, ParameterRequest};

const MS: u64 = 1_000_000;

/// A path of one waypoint that was issued `ago_ms` ago.
fn path(rig: &Rig, ago_ms: u64) -> MovementData {
    MovementData {
        path_id: 5,
        first: 1,
        last: 1,
        issued_ns: rig.now.0 - ago_ms * MS,
        ..go_to(north(3)).preempting()
    }
}

/// The bridge stands still; the DSP goes on, and what it says is lost.
fn stand_still(rig: &mut Rig, ms: u64) {
    rig.now = MonotonicNs(rig.now.0 + ms * MS);
    rig.dsp.time_ms += ms as u32;
}

fn late_by_s(rig: &Rig, request: u64) -> f64 {
    rig.last_report(request).value().expect("by how much")
}

#[test]
fn a_movement_that_was_issued_before_the_last_order_is_superseded() {
    type Ask = fn(&mut Rig) -> u64;
    let hold: Ask = |rig| rig.hold();
    let newer_path: Ask = |rig| rig.preempting(4, north(9));
    let land: Ask = |rig| rig.movement(MovementData::land(0).preempting());
    let stop: Ask = |rig| {
        rig.control(ControlCommand::Stop);
        rig.run(200);
        rig.control(ControlCommand::Start)
    };
    for (name, ask) in [
        ("hold", hold),
        ("path", newer_path),
        ("land", land),
        ("stop", stop),
    ] {
        let mut rig = Rig::flying();
        rig.run(3000);
        ask(&mut rig);
        rig.run(200);
        let sent = rig.dsp.waypoints.len();
        let old = rig.ordered(path(&rig, 1000));
        assert_eq!(rig.last(old), refused(Reason::Superseded), "{name}");
        rig.run(1000);
        let is_older = |waypoint: &dsp_protocol::Waypoint| *waypoint == north(3);
        assert!(!rig.dsp.waypoints[sent..].iter().any(is_older), "{name}");
    }
    let mut rig = Rig::started();
    rig.run(3000);
    rig.hold();
    rig.run(200);
    let take_off = rig.ordered(MovementData {
        issued_ns: rig.now.0 - 1000 * MS,
        ..MovementData::take_off(0, 10.0)
    });
    assert_eq!(rig.last(take_off), refused(Reason::Superseded));
}

#[test]
fn a_hold_that_was_issued_before_a_path_ends_it_all_the_same() {
    let mut rig = Rig::flying();
    rig.run(3000);
    let path = rig.preempting(4, north(9));
    rig.run(300);
    assert_eq!(rig.functionality(), Functionality::FollowingPath);
    let hold = rig.ordered(MovementData {
        issued_ns: rig.now.0 - 2000 * MS,
        ..MovementData::hold(0)
    });
    rig.run(300);
    assert_eq!(rig.last(path), aborted(Reason::Replaced));
    assert_eq!(rig.last(hold).0, Stage::Done);
}

#[test]
fn an_order_of_another_clock_is_newer_only_when_it_surely_is() {
    for (ago_ms, within_ms, is_taken) in [(100, 0, true), (300, 250, false), (100, 250, true)] {
        let mut rig = Rig::flying();
        rig.run(1000);
        rig.hold();
        rig.run(200);
        let path = rig.ordered(MovementData {
            origin: 7,
            issued_within_ns: within_ms * MS as u32,
            ..path(&rig, ago_ms)
        });
        assert_eq!(rig.last(path).0 == Stage::Accepted, is_taken, "{ago_ms}");
    }
    // A local order counts as newer than that of a station only after the latest moment that this can have been issued
    // at.
    let mut rig = Rig::flying();
    rig.run(1000);
    rig.ordered(MovementData {
        origin: 7,
        issued_ns: rig.now.0 - 50 * MS,
        issued_within_ns: 200 * MS as u32,
        ..MovementData::hold(0)
    });
    rig.run(100);
    let doubtful = rig.ordered(path(&rig, 0));
    assert_eq!(rig.last(doubtful), refused(Reason::Superseded));
    rig.run(50);
    let sure = rig.ordered(path(&rig, 0));
    assert_eq!(rig.last(sure).0, Stage::Accepted);
}

#[test]
fn a_landing_that_is_refused_keeps_an_accepted_path_from_beginning() {
    let mut rig = Rig::flying();
    rig.dsp.grants = false;
    rig.run(200);
    let path = rig.preempting(4, north(9));
    rig.run(50);
    let land = rig.land();
    assert_eq!(rig.last(land), refused(Reason::Busy));
    rig.dsp.grants = true;
    rig.run(500);
    assert_eq!(rig.last(path), aborted(Reason::Superseded));
    assert_eq!(rig.dsp.waypoints, []);
}

#[test]
fn a_bridge_that_stands_still_after_accepted_flies_nothing_late() {
    for deadline_ms in [0, 500] {
        let mut rig = Rig::flying();
        rig.dsp.grants = false;
        rig.run(200);
        let begin_by_ns = match deadline_ms {
            0 => 0,
            ms => rig.now.0 + ms * MS,
        };
        let path = rig.ordered(MovementData {
            begin_by_ns,
            ..path(&rig, 0)
        });
        assert_eq!(rig.last(path).0, Stage::Accepted);
        // Shorter than the DSP waits for the PC: the path goes on with the first flow control that has not waited in
        // the line.
        stand_still(&mut rig, 900);
        rig.say(Downlink::FlowControl(FlowControl::Send));
        rig.run(100);
        rig.say(Downlink::FlowControl(FlowControl::Send));
        rig.exchange();
        let is_late = deadline_ms > 0;
        assert_eq!(rig.dsp.waypoints.is_empty(), is_late);
        if is_late {
            assert_eq!(rig.last(path), aborted(Reason::TooLate));
            assert_eq!(late_by_s(&rig, path), 0.41);
            assert_eq!(rig.module(), ModuleStatus::Running, "not blocked");
        }
    }
    let mut rig = Rig::flying();
    rig.dsp.grants = false;
    rig.run(200);
    let path = rig.preempting(4, north(9));
    stand_still(&mut rig, 12_000);
    rig.say(Downlink::FlowControl(FlowControl::Send));
    rig.run(100);
    assert_eq!(rig.last(path), aborted(Reason::TooLate));
    assert_eq!(late_by_s(&rig, path), 7.01);
    assert_eq!(rig.dsp.waypoints, []);
}

#[test]
fn a_take_off_is_not_ordered_after_its_moment_nor_once_more() {
    let order = Command::Write16 {
        port: port::TAKE_OFF,
        value: 1,
    };
    let count = |rig: &Rig| {
        let commands = rig.dsp.commands.iter();
        commands.filter(|command| **command == order).count()
    };
    // It stands still before the altitude was read back.
    let mut rig = Rig::started();
    rig.dsp.acknowledges = false;
    let take_off = rig.take_off();
    rig.dsp.acknowledges = true;
    stand_still(&mut rig, 6000);
    rig.say(Downlink::Ack { command: 3 });
    rig.say(Downlink::Ack32 {
        command: 2,
        value: 10.0,
    });
    rig.apply(Input::Advance);
    rig.exchange();
    assert_eq!(rig.last(take_off), aborted(Reason::TooLate));
    assert_eq!(count(&rig), 0);

    // The order was lost on its way; the next attempt would come too late.
    let mut rig = Rig::started();
    let take_off = rig.ordered(MovementData {
        issued_ns: rig.now.0,
        begin_by_ns: rig.now.0 + 50 * MS,
        ..MovementData::take_off(0, 10.0)
    });
    assert_eq!((rig.last(take_off).0, count(&rig)), (Stage::Progress, 1));
}

/// How far a command is when the moment to begin passes.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    /// Behind a command that is outstanding.
    Queued,
    Outstanding,
    Acknowledged,
}

/// Take-off, hold and landing, each of the commands that they need, and where it is when the moment to begin passes.
#[test]
fn a_moment_that_passes_takes_back_what_has_not_been_sent_and_nothing_else() {
    let [take_off, landing] =
        [port::TAKE_OFF, port::LAND].map(|port| Command::Write16 { port, value: 1 });
    let late = aborted(Reason::TooLate);
    let hovers = (Stage::Unknown, Reason::TooLate, ImiError::None);
    let goes_on = (Stage::Progress, Reason::None, ImiError::None);
    let done = (Stage::Done, Reason::None, ImiError::None);
    let is_lost = (
        Stage::Unknown,
        Reason::CommunicationFatalError,
        ImiError::CommunicationFatalError,
    );
    // The movement, its command, which of its commands that is, where it is, what becomes of the movement without and
    // with an acknowledgement after the moment, and how often the DSP gets the command in all.
    let (up, hold, land) = (
        MovementKind::TakeOff,
        MovementKind::Hold,
        MovementKind::Land,
    );
    let table = [
        (up, take_off, 0, Place::Queued, late, late, Some(0)),
        (up, take_off, 0, Place::Outstanding, late, late, Some(0)),
        (up, take_off, 1, Place::Queued, late, late, Some(0)),
        (up, take_off, 1, Place::Outstanding, late, late, Some(0)),
        (up, take_off, 2, Place::Queued, late, late, Some(0)),
        (
            up,
            take_off,
            2,
            Place::Outstanding,
            is_lost,
            goes_on,
            Some(1),
        ),
        (
            up,
            take_off,
            2,
            Place::Acknowledged,
            goes_on,
            goes_on,
            Some(1),
        ),
        (land, landing, 0, Place::Queued, late, late, Some(0)),
        (
            land,
            landing,
            0,
            Place::Outstanding,
            is_lost,
            goes_on,
            Some(1),
        ),
        (
            land,
            landing,
            0,
            Place::Acknowledged,
            goes_on,
            goes_on,
            Some(1),
        ),
        // Whether the helicopter hovers is not known. The link goes on emptying the DSP's path buffer.
        (
            hold,
            Command::InvalidatePath,
            0,
            Place::Queued,
            hovers,
            hovers,
            None,
        ),
        (
            hold,
            Command::InvalidatePath,
            0,
            Place::Outstanding,
            hovers,
            hovers,
            None,
        ),
        (
            hold,
            Command::InvalidatePath,
            0,
            Place::Acknowledged,
            done,
            done,
            None,
        ),
    ];
    for (kind, command, before, place, silent, answered, sent) in table {
        for is_answered in [false, true] {
            let row = format!("{kind:?}, command {before} {place:?}, answered: {is_answered}");
            let mut rig = if kind == up {
                Rig::started()
            } else {
                Rig::flying()
            };
            rig.dsp.acknowledges = false;
            rig.dsp.commands.clear();
            let another = |rig: &mut Rig| {
                rig.parameter(ParameterRequest::read(0, port::CRUISE_SPEED_MPS));
            };
            if place == Place::Queued && before == 0 {
                another(&mut rig);
            }
            let request = rig.movement(MovementData {
                begin_by_ns: rig.now.0 + 50 * MS,
                altitude_m: 10.0,
                kind: kind.code(),
                ..MovementData::default()
            });
            for answer in 1..=before {
                if place == Place::Queued && answer == before {
                    another(&mut rig);
                }
                rig.answer_last();
            }
            if place == Place::Acknowledged {
                rig.answer_last();
            }
            rig.run(70);
            let is_undecided = silent == is_lost;
            let expected = if is_undecided {
                Stage::Accepted
            } else {
                silent.0
            };
            assert_eq!(rig.last(request).0, expected, "{row}");
            if is_answered {
                rig.answer_last();
                rig.dsp.acknowledges = true;
            }
            rig.run(if kind == hold { 70 } else { 1000 });
            let expected = if is_answered { answered } else { silent };
            if place != Place::Acknowledged || is_answered {
                assert_eq!(rig.last(request), expected, "{row}");
            }
            let orders = rig.dsp.commands.iter().filter(|it| **it == command);
            assert!(sent.is_none_or(|sent| sent == orders.count()), "{row}");
        }
    }
}

#[test]
fn a_path_whose_next_waypoint_was_read_too_late_is_broken() {
    let mut rig = Rig::flying();
    let first = rig.waypoint(1, 1, 0, north(3));
    assert_eq!(rig.last(first).0, Stage::Accepted);
    stand_still(&mut rig, 5500);
    // The request waited while the bridge stood still; the timer has not been looked at yet.
    rig.dsp.time_ms += 20;
    let mut status = rig.dsp.status;
    status.time_ms = Some(rig.dsp.time_ms);
    rig.say(Downlink::Status(status));
    let closing = rig.waypoint(1, 0, 1, north(4));
    assert_eq!(rig.last(closing), refused(Reason::TooLate));
    assert_eq!(rig.last(first), aborted(Reason::PathBroken));
}

/// The newest waypoint of another path is newer.
#[test]
fn a_waypoint_is_not_older_than_that_of_another_path_and_no_order_came_between() {
    // The sender of a path has waited for the answer to the waypoint before.
    for (path_id, first, ago_ms, is_taken) in [(1, 0, 5_500, true), (2, 1, 500, false)] {
        let mut rig = Rig::flying();
        rig.run(6_000);
        rig.waypoint(1, 1, 0, north(3));
        let next = rig.ordered(MovementData {
            path_id,
            first,
            issued_ns: rig.now.0 - ago_ms * MS,
            ..go_to(north(4))
        });
        let is_superseded = rig.last(next) == refused(Reason::Superseded);
        assert_eq!(is_superseded, !is_taken);
        assert_eq!(rig.last(next).0 == Stage::Accepted, is_taken);
        assert_eq!(rig.last_report(next).between(), None);
    }
}

/// A path's first waypoint is judged from the helicopter, whatever path was open.
#[test]
fn a_first_waypoint_begins_where_the_helicopter_is() {
    let mast = "[fence]\n[[fence.area]]\nname = \"mast\"\nkind = \"exclusion\"\n\
                centre = [37.0005, -6.0]\nradius_m = 11.0\n";
    let config = runtime::config::parse(mast, "a test").unwrap();
    let mut rig = Rig::up(&config);
    rig.control(ControlCommand::Start);
    rig.lift_off();
    // East and west of the mast.
    for (path_id, east_deg) in [(1, 1e-3), (2, -1e-3)] {
        let mut point = north(50);
        point.longitude_deg += east_deg;
        let first = rig.waypoint(path_id, 1, 0, point);
        assert_eq!(rig.last(first).0, Stage::Accepted);
    }
}

#[test]
fn a_path_carries_the_earliest_moment_of_its_waypoints() {
    let mut rig = Rig::flying();
    rig.run(3000);
    let opening = rig.ordered(MovementData {
        last: 0,
        ..path(&rig, 1000)
    });
    assert_eq!(rig.last(opening).0, Stage::Accepted);
    // It is refused, and counts.
    let land = rig.ordered(MovementData {
        issued_ns: rig.now.0 - 500 * MS,
        begin_by_ns: rig.now.0 - 1,
        ..MovementData::land(0)
    });
    assert_eq!(rig.last(land), refused(Reason::TooLate));
    let closing = rig.ordered(MovementData {
        first: 0,
        ..path(&rig, 0)
    });
    assert_eq!(rig.last(closing), refused(Reason::Superseded));
    assert_eq!(rig.last(opening), aborted(Reason::PathBroken));
}

#[test]
fn holds_landings_and_stops_have_longer_moments() {
    for (ago_ms, is_taken) in [(29_000, true), (31_000, false)] {
        let mut rig = Rig::flying();
        rig.run(3000);
        rig.now = MonotonicNs(rig.now.0 + 40_000 * MS);
        rig.dsp.time_ms += 40_000;
        rig.run(200);
        let hold = rig.ordered(MovementData {
            issued_ns: rig.now.0 - ago_ms * MS,
            ..MovementData::hold(0)
        });
        match is_taken {
            true => assert_ne!(rig.last(hold).0, Stage::Refused),
            false => assert_eq!(rig.last(hold), refused(Reason::TooLate)),
        }
    }
}

#[test]
fn a_hold_a_landing_and_a_stop_are_taken_whatever_the_clock_of_their_sender_says() {
    type Clock = (SenderClock, fn(u64) -> u64);
    let clocks: [Clock; 6] = [
        (SenderClock::Own, |_| 0),
        (SenderClock::Own, |now| now + 3_000 * MS),
        (SenderClock::Own, |_| u64::MAX),
        (SenderClock::Other, |now| now + 3_000 * MS),
        (SenderClock::Other, |now| now - 1_000_000 * MS),
        (SenderClock::Unknown, |now| now - 1_000_000 * MS),
    ];
    for (clock, issued) in clocks {
        let mut rig = Rig::flying();
        rig.now = MonotonicNs(rig.now.0 + 2_000_000 * MS);
        rig.run(1000);
        let flown = rig.path(1, &[north(900)]);
        rig.run(300);
        rig.sender.clock = clock;
        let issued_ns = issued(rig.now.0);
        let hold = rig.ordered(MovementData {
            issued_ns,
            begin_by_ns: issued_ns.saturating_add(2_000 * MS),
            ..MovementData::hold(0)
        });
        rig.run(200);
        assert_eq!(rig.last(hold).0, Stage::Done, "{clock:?} {issued_ns}");
        assert_eq!(rig.last(flown[0]), aborted(Reason::Replaced));
        let begin_by_ns = issued_ns.saturating_add(2_000 * MS);
        let next = rig.ordered(MovementData {
            issued_ns,
            begin_by_ns,
            ..path(&rig, 0)
        });
        let reason = match (clock, issued_ns) {
            (_, 0) => Reason::InvalidRequest,
            (SenderClock::Unknown, _) => Reason::Superseded,
            _ => Reason::ClockDiffers,
        };
        assert_eq!(rig.last(next), refused(reason), "{clock:?} {issued_ns}");
        let land = rig.ordered(MovementData {
            issued_ns,
            ..MovementData::land(0)
        });
        rig.run(100);
        assert_eq!(rig.functionality(), Functionality::Landing);
        assert_ne!(rig.last(land).0, Stage::Refused);
        let mut rig = Rig::started();
        rig.now = MonotonicNs(rig.now.0 + 2_000_000 * MS);
        rig.run(1000);
        rig.sender.clock = clock;
        let request_id = rig.request_id();
        rig.ask_control(ModuleControl {
            issued_ns: issued(rig.now.0),
            ..ModuleControl::new(request_id, ControlCommand::Stop)
        });
        rig.run(200);
        assert_eq!(rig.last(request_id).0, Stage::Done);
        // What counted is when they were read: a later order by this clock is taken.
        rig.sender.clock = SenderClock::Own;
        let start = rig.control(ControlCommand::Start);
        assert_eq!(rig.last(start).0, Stage::Done, "{clock:?} {issued_ns}");
    }
}

#[test]
fn a_start_before_a_stop_is_superseded_and_a_parameter_is_only_too_late() {
    let mut rig = Rig::started();
    rig.run(1000);
    rig.control(ControlCommand::Stop);
    rig.run(200);
    let request_id = rig.request_id();
    let start = ModuleControl {
        issued_ns: rig.now.0 - 500 * MS,
        ..ModuleControl::new(request_id, ControlCommand::Start)
    };
    rig.ask_control(start);
    assert_eq!(rig.last(request_id), refused(Reason::Superseded));

    for (ago_ms, expected) in [(1100, Stage::Done), (5100, Stage::Refused)] {
        let mut rig = Rig::started();
        rig.run(6000);
        rig.hold();
        rig.run(200);
        let request_id = rig.request_id();
        let read = ParameterRequest {
            issued_ns: rig.now.0 - ago_ms * MS,
            ..ParameterRequest::read(request_id, port::CRUISE_SPEED_MPS)
        };
        rig.ask_parameter(read);
        rig.exchange();
        assert_eq!(rig.last(request_id).0, expected);
    }
}

#[test]
fn the_helicopter_does_what_was_ordered_last() {
    // For the long form, such as 100,000 other sequences.
    let number = |name| std::env::var(name).map(|text| text.parse().expect("a whole number"));
    let seed = number("RIL_SEED").unwrap_or(1);
    let seen = chance::play(seed, number("RIL_SEQUENCES").unwrap_or(2000));
    assert!(seen.as_ordered > 1000, "{seen:?}");
    assert!(seen.refused > 50 && seen.began > 1000, "{seen:?}");
    assert!(seen.superseded > 300 && seen.too_late > 100, "{seen:?}");
}
