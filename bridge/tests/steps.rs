//! The next step of a command is taken only if nothing came between it and the step before (requirement H13).

use bridge::{BridgeConfig, Sender, SenderClock};
use ipc_types::code::{CameBetween, ControlCommand, LinkState, Reason, SafetyRule, Stage};
use ipc_types::payload::{ModuleControl, MovementData, ParameterRequest};

use crate::rig::{Rig, aborted, go_to, north, refused};

const OTHER: Sender = Sender {
    process: Some(4711),
    session: None,
    clock: SenderClock::Own,
};

/// A step to a point, after the request `after`.
fn to(after: u64, steps: i32) -> MovementData {
    MovementData {
        after,
        path_id: 90 + steps as u64,
        first: 1,
        last: 1,
        ..go_to(north(steps))
    }
}

/// Flies a path to its end, and gives its request.
fn flown(rig: &mut Rig, step: MovementData) -> u64 {
    let path = rig.movement(step);
    rig.run(200);
    let target = dsp_protocol::Waypoint {
        latitude_deg: step.latitude_deg,
        longitude_deg: step.longitude_deg,
        altitude_m: step.altitude_m,
    };
    rig.dsp.at(target);
    rig.run(1500);
    assert_eq!(rig.last(path).0, Stage::Done);
    path
}

/// A started bridge with a fence, the helicopter in the air, hovering after its first step, which is given as well.
fn hovering() -> (Rig, u64) {
    let text = "[fence]\nceiling_m = 60.0\n[safety]\nbattery_v = { land = 21.0 }\n";
    let config: BridgeConfig = runtime::config::parse(text, "test").unwrap();
    let mut rig = Rig::up(&config);
    rig.control(ControlCommand::Start);
    rig.lift_off();
    let first = flown(&mut rig, to(0, 3));
    (rig, first)
}

fn by_another<T>(rig: &mut Rig, order: impl FnOnce(&mut Rig) -> T) -> T {
    let own = std::mem::replace(&mut rig.sender, OTHER);
    let ordered = order(rig);
    rig.sender = own;
    ordered
}

fn land_and_take_off(rig: &mut Rig) {
    rig.land();
    rig.run(100);
    rig.dsp.status.flying = false;
    rig.run(2000);
    let take_off = rig.take_off();
    assert_eq!(rig.last(take_off).0, Stage::Progress);
    rig.dsp.status.flying = true;
    rig.run(2000);
    assert_eq!(rig.last(take_off).0, Stage::Done);
}

fn pilot_takes_over(rig: &mut Rig, ms: u32) {
    for (auto_switch, ms) in [(0, ms), (1, 100)] {
        rig.dsp.status.supply.as_mut().unwrap().auto_switch = auto_switch;
        rig.run(ms);
    }
}

fn lose_the_link(rig: &mut Rig) {
    rig.dsp.silent = true;
    rig.run(5000);
    assert_ne!(rig.link(), LinkState::Up);
    rig.dsp.silent = false;
    rig.run(3000);
    assert_eq!(rig.link(), LinkState::Up);
}

/// What happens between the steps, and what the refusal of the second one says: what, and whether that was a request of
/// `OTHER`.
type Between = (&'static str, fn(&mut Rig), CameBetween, bool);

const BETWEEN: [Between; 12] = [
    (
        "hold",
        |rig| _ = by_another(rig, Rig::hold),
        CameBetween::Hold,
        true,
    ),
    (
        "own hold",
        |rig| {
            rig.hold();
        },
        CameBetween::Hold,
        false,
    ),
    (
        "refused landing",
        |rig| {
            by_another(rig, |rig| {
                let begin_by_ns = rig.now.0 - 1;
                rig.movement(MovementData {
                    begin_by_ns,
                    ..MovementData::land(0)
                })
            });
        },
        CameBetween::Land,
        true,
    ),
    (
        "goto elsewhere",
        |rig| _ = by_another(rig, |rig| flown(rig, to(0, 9))),
        CameBetween::GoTo,
        true,
    ),
    (
        "stop",
        |rig| _ = by_another(rig, |rig| rig.control(ControlCommand::Stop)),
        CameBetween::Stop,
        true,
    ),
    (
        "stop and start",
        |rig| {
            rig.control(ControlCommand::Stop);
            rig.run(200);
            by_another(rig, |rig| rig.control(ControlCommand::Start));
        },
        CameBetween::Start,
        true,
    ),
    (
        "landing and take-off",
        |rig| by_another(rig, land_and_take_off),
        CameBetween::TakeOff,
        true,
    ),
    (
        "pilot for 1 s",
        |rig| pilot_takes_over(rig, 1000),
        CameBetween::Pilot,
        false,
    ),
    (
        "pilot while a rule is broken that is as severe",
        |rig| {
            let above = |rig: &mut Rig, altitude_m| {
                rig.dsp.status.geographic.as_mut().unwrap().altitude_m = altitude_m;
                rig.run(200);
            };
            above(rig, 70.0);
            pilot_takes_over(rig, 20);
            above(rig, 20.0);
        },
        // The fence is broken still when the pilot lets go: that is the last thing.
        CameBetween::SafetyRule,
        false,
    ),
    (
        "pilot while a rule is broken that is more severe",
        |rig| {
            rig.dsp.status.supply.as_mut().unwrap().battery_mv = 20_000;
            rig.run(20_000);
            pilot_takes_over(rig, 1000);
        },
        CameBetween::Pilot,
        false,
    ),
    ("link lost", lose_the_link, CameBetween::LinkLost, false),
    (
        "reboot",
        |rig| {
            rig.dsp.reboot();
            rig.run(4000);
            rig.dsp.grants = true;
            rig.run(200);
        },
        CameBetween::DspRebooted,
        false,
    ),
];

#[test]
fn a_step_is_superseded_by_whatever_came_after_the_step_before() {
    for (name, happens, what, is_other) in BETWEEN {
        let (mut rig, first) = hovering();
        happens(&mut rig);
        rig.run(2000);
        let sent = rig.dsp.waypoints.len();
        // Nothing of it counts as an order: the second refusal names the same.
        for step in [
            to(first, 6),
            MovementData {
                after: first,
                ..MovementData::land(0).preempting()
            },
            MovementData {
                after: first,
                ..MovementData::hold(0)
            },
        ] {
            let step = rig.movement(step);
            assert_eq!(rig.last(step), refused(Reason::Superseded), "{name}");
            let report = *rig.last_report(step);
            assert_eq!(report.between(), Some(what), "{name}");
            let process = if is_other { 4711 } else { 0 };
            assert_eq!(report.between_sender.process, process, "{name}");
            let is_request = what.code() <= CameBetween::Hold.code();
            assert_eq!(report.between_request_id != 0, is_request, "{name}");
        }
        let write = rig.parameter(ParameterRequest {
            after: first,
            ..ParameterRequest::write(0, dsp_protocol::port::CRUISE_SPEED_MPS, 3.0)
        });
        assert_eq!(rig.last(write), refused(Reason::Superseded), "{name}");
        rig.run(2000);
        assert_eq!(rig.dsp.waypoints.len(), sent, "{name}");
    }
}

#[test]
fn no_step_follows_an_order_that_was_refused() {
    let (mut rig, _) = hovering();
    rig.movement(MovementData::land(0).preempting());
    let hold = rig.movement(MovementData::hold(0));
    assert_eq!(rig.last(hold).0, Stage::Refused);
    let step = rig.movement(to(hold, 6));
    assert_eq!(rig.last(step), refused(Reason::Superseded));
}

#[test]
fn what_ends_the_movement_under_way_is_taken_though_another_order_was_refused() {
    for (name, late) in [
        ("hold", MovementData::hold(0)),
        ("landing", MovementData::land(0)),
    ] {
        for end in [MovementData::hold(0), MovementData::land(0).preempting()] {
            let (mut rig, first) = hovering();
            let path = rig.movement(to(first, 6));
            let late = MovementData {
                begin_by_ns: rig.now.0 - 1,
                ..late
            };
            let other = by_another(&mut rig, |rig| rig.movement(late));
            assert_eq!(rig.last(other), refused(Reason::TooLate), "{name}");
            // Nothing new begins after it, and an end that names another movement is none.
            for step in [
                to(path, 9),
                MovementData {
                    after: first,
                    ..end
                },
            ] {
                let step = rig.movement(step);
                assert_eq!(rig.last(step), refused(Reason::Superseded), "{name}");
            }
            let end = rig.movement(MovementData { after: path, ..end });
            assert_ne!(rig.last(end).0, Stage::Refused, "{name}");
            assert_eq!(rig.last(path), aborted(Reason::Replaced), "{name}");
        }
    }
}

#[test]
fn a_rule_that_holds_comes_between_and_is_named() {
    let (mut rig, first) = hovering();
    rig.dsp.status.geographic.as_mut().unwrap().altitude_m = 70.0;
    rig.run(200);
    rig.dsp.status.geographic.as_mut().unwrap().altitude_m = 20.0;
    rig.run(200);
    let step = rig.movement(to(first, 6));
    assert_eq!(rig.last(step), refused(Reason::Superseded));
    let report = rig.last_report(step);
    assert_eq!(report.between(), Some(CameBetween::SafetyRule));
    assert_eq!(report.rule(), Some(SafetyRule::FenceCeiling));
    assert_eq!(
        report.in_between().unwrap(),
        "the safety rule fence-ceiling"
    );
}

#[test]
fn a_step_follows_when_nothing_came_between() {
    type Happens = fn(&mut Rig);
    let quiet: [(&str, Happens); 6] = [
        ("nothing", |_| {}),
        ("a minute", |rig| rig.run(60_000)),
        ("another's read", |rig| {
            rig.parameter(ParameterRequest::read(
                0,
                dsp_protocol::port::CRUISE_SPEED_MPS,
            ));
        }),
        ("another's write", |rig| {
            rig.parameter(ParameterRequest::write(
                0,
                dsp_protocol::port::CRUISE_SPEED_MPS,
                3.0,
            ));
        }),
        ("control taken", |rig| {
            rig.control(ControlCommand::TakeControl);
        }),
        ("a refused path", |rig| {
            let far = MovementData {
                latitude_deg: 40.0,
                ..to(0, 9)
            };
            let far = rig.movement(far);
            assert_eq!(rig.last(far), refused(Reason::TooFar));
        }),
    ];
    for (name, happens) in quiet {
        let (mut rig, first) = hovering();
        happens(&mut rig);
        rig.run(100);
        let second = flown(&mut rig, to(first, 6));
        let land = rig.movement(MovementData {
            after: second,
            ..MovementData::land(0)
        });
        assert_eq!(rig.last(land).0, Stage::Progress, "{name}");
        // The step before the last one is not the step before.
        let hold = rig.movement(MovementData {
            after: first,
            ..MovementData::hold(0)
        });
        assert_eq!(
            rig.last_report(hold).between(),
            Some(CameBetween::Land),
            "{name}"
        );
    }
}

#[test]
fn a_parameter_write_may_be_a_step() {
    let (mut rig, first) = hovering();
    let write = |rig: &mut Rig, after, value| {
        let port = dsp_protocol::port::CRUISE_SPEED_MPS;
        let write = rig.parameter(ParameterRequest {
            after,
            ..ParameterRequest::write(0, port, value)
        });
        rig.run(200);
        write
    };
    let slow = write(&mut rig, first, 2.0);
    let slower = write(&mut rig, slow, 1.0);
    assert_eq!(rig.last(slower).0, Stage::Done);
    let late = write(&mut rig, slow, 3.0);
    assert_eq!(rig.last(late), refused(Reason::Superseded));
    // Both the write and the movement before it are the step before.
    let second = flown(&mut rig, to(slower, 6));
    let third = flown(&mut rig, to(second, 3));
    let late = write(&mut rig, slower, 3.0);
    assert_eq!(rig.last(late), refused(Reason::Superseded));
    assert_eq!(rig.last_report(late).between_request_id, third);
    let fast = write(&mut rig, third, 4.0);
    assert_eq!(rig.last(fast).0, Stage::Done);
    flown(&mut rig, to(third, 9));
}

#[test]
fn all_waypoints_of_a_path_are_one_step() {
    let waypoint = |after, path_id, first, last, steps| MovementData {
        after,
        path_id,
        first,
        last,
        ..go_to(north(steps))
    };
    let (mut rig, first) = hovering();
    let opening = rig.movement(waypoint(first, 7, 1, 0, 5));
    assert_eq!(rig.last(opening).0, Stage::Accepted);
    let closing = rig.movement(waypoint(first, 7, 0, 1, 6));
    assert_eq!(rig.last(closing).0, Stage::Accepted);
    rig.run(200);
    rig.hold();
    rig.run(500);
    let next = rig.movement(to(closing, 9));
    assert_eq!(rig.last_report(next).between(), Some(CameBetween::Hold));

    let (mut rig, first) = hovering();
    let opening = rig.movement(waypoint(first, 7, 1, 0, 5));
    by_another(&mut rig, Rig::hold);
    let closing = rig.movement(waypoint(first, 7, 0, 1, 6));
    assert_eq!(rig.last(closing), refused(Reason::Superseded));
    assert!(rig.last(opening).0.is_final());
    rig.run(1000);
    assert!(!rig.dsp.waypoints.contains(&north(5)));
}

#[test]
fn a_start_and_a_stop_may_be_steps() {
    let (mut rig, first) = hovering();
    by_another(&mut rig, Rig::hold);
    rig.run(200);
    let request_id = rig.request_id();
    rig.ask_control(ModuleControl {
        request_id,
        after: first,
        issued_ns: rig.now.0,
        command: ControlCommand::Stop.code(),
        ..ModuleControl::default()
    });
    assert_eq!(rig.last(request_id), refused(Reason::Superseded));
}

#[test]
fn a_bridge_that_has_just_begun_knows_no_step() {
    let mut rig = Rig::up(&BridgeConfig::default());
    rig.lift_off();
    let land = rig.movement(MovementData {
        after: 77,
        ..MovementData::land(0)
    });
    assert_eq!(rig.last(land), refused(Reason::Superseded));
    assert_eq!(
        rig.last_report(land).between(),
        Some(CameBetween::BridgeBegan)
    );
}

#[test]
fn an_order_from_before_the_pilot_took_over_is_superseded_without_naming_a_step() {
    let mut rig = Rig::flying();
    rig.run(1000);
    let issued_ns = rig.now.0;
    pilot_takes_over(&mut rig, 1000);
    let late = rig.ordered(MovementData {
        issued_ns,
        ..to(0, 6)
    });
    assert_eq!(rig.last(late), refused(Reason::Superseded));
    assert_eq!(rig.last_report(late).between(), Some(CameBetween::Pilot));
    let anew = rig.movement(to(0, 6));
    assert_eq!(rig.last(anew).0, Stage::Accepted);
}

/// The steps and orders of two senders in random order, and a pilot; who was the last is kept by the test alone.
#[test]
fn of_random_steps_only_those_behind_the_last_order_are_taken() {
    let (mut taken, mut superseded) = (0, 0);
    for seed in 0..300 {
        let mut random = fastrand::Rng::with_seed(seed);
        let (mut rig, mut last) = hovering();
        let (mut wrote, mut known) = (0, vec![last]);
        for _ in 0..30 {
            rig.run(10 * random.u32(..8));
            let after = match random.u8(..4) {
                0 => 0,
                1 => last.max(1),
                2 if wrote != 0 => wrote,
                _ => random.choice(known.iter().copied()).unwrap(),
            };
            let what = random.u8(..6);
            let issued_ns = rig.now.0;
            let request = match what {
                0 => {
                    pilot_takes_over(&mut rig, 40);
                    (last, wrote) = (0, 0);
                    continue;
                }
                1 => rig.parameter(ParameterRequest {
                    after,
                    ..ParameterRequest::read(0, dsp_protocol::port::CRUISE_SPEED_MPS)
                }),
                2 => rig.parameter(ParameterRequest {
                    after,
                    ..ParameterRequest::write(0, dsp_protocol::port::CRUISE_SPEED_MPS, 3.0)
                }),
                3 => rig.movement(MovementData {
                    after,
                    ..MovementData::hold(0)
                }),
                4 => {
                    let command = random.choice([ControlCommand::Start, ControlCommand::Stop]);
                    let request_id = rig.request_id();
                    rig.ask_control(ModuleControl {
                        request_id,
                        after,
                        issued_ns,
                        command: command.unwrap().code(),
                        ..ModuleControl::default()
                    });
                    rig.exchange();
                    request_id
                }
                _ => rig.movement(to(after, random.i32(1..9)).preempting()),
            };
            known.push(request);
            let first = *(rig.out.reports.iter())
                .find(|report| report.request_id == request)
                .unwrap();
            let is_superseded = first.reason() == Some(Reason::Superseded);
            let follows = after == 0 || after == last || after == wrote;
            assert_eq!(is_superseded, !follows, "seed {seed}: {after} after {last}");
            taken += u32::from(follows && after != 0);
            superseded += u32::from(is_superseded);
            let is_taken = first.stage() != Some(Stage::Refused);
            // A hold counts though it is refused, and so does a stop; a start is done or refused.
            let counts = is_taken || what == 3 || first.imi_error().is_none() && what == 4;
            match what {
                _ if is_superseded || !counts => {}
                1 => {}
                2 if after != 0 => wrote = request,
                2 => {}
                _ => (last, wrote) = (request, 0),
            }
        }
    }
    assert!(taken > 500 && superseded > 500, "{taken}, {superseded}");
}

#[test]
fn no_step_follows_a_path_that_ended_with_its_sender_and_another_order_does() {
    let (mut rig, first) = hovering();
    let path = rig.movement(MovementData {
        lease_ms: 1000,
        ..to(first, 50)
    });
    rig.run(3000);
    assert_eq!(rig.last(path), aborted(Reason::SenderLost));
    let step = rig.movement(to(path, 6));
    assert_eq!(rig.last(step), refused(Reason::Superseded));
    assert_eq!(
        rig.last_report(step).between(),
        Some(CameBetween::SenderLost)
    );
    let other = rig.movement(to(0, 6));
    assert_eq!(rig.last(other).0, Stage::Accepted);
}
