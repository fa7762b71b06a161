//! The core's side of paths: from single waypoints to the DSP, whole or not at all, each delivered once.

use crate::rig::{HOME, Rig, STOP, aborted, go_to, north, refused};
use bridge::flight::assembly::MAX_WAYPOINTS;
use bridge::flight::trajectory::{Trajectory, TrajectoryPoint};
use bridge::{Bridge, BridgeConfig, Input, RequestKey};
use dsp_protocol::Waypoint;
use dsp_protocol::downlink::Geographic;
use ipc_types::code::{ControlCommand, Functionality, ImiError, Reason, Stage};
use ipc_types::payload::MovementData;

#[test]
fn nothing_of_a_path_goes_out_until_it_is_closed_and_then_one_for_each_grant() {
    let mut rig = Rig::flying();
    rig.waypoint(1, 1, 0, north(3));
    rig.waypoint(1, 0, 0, north(6));
    rig.run(1000);
    assert_eq!(rig.functionality(), Functionality::ReceivingPath);
    assert!(rig.dsp.waypoints.is_empty());
    rig.dsp.grants = false;
    rig.waypoint(1, 0, 1, north(9));
    rig.run(1000);
    assert!(rig.dsp.waypoints.is_empty(), "the DSP's buffer is full");
    rig.dsp.grants = true;
    for sent in 1..=3 {
        rig.run(100);
        assert_eq!(rig.dsp.waypoints.len(), sent);
    }
}

#[test]
fn a_full_buffer_does_not_delay_the_command_that_empties_it() {
    let mut rig = Rig::flying();
    rig.dsp.grants = false;
    let path = rig.path(1, &[north(3), north(6)]);
    rig.run(500);
    let stop = rig.control(ControlCommand::Stop);
    assert!(rig.dsp.commands.ends_with(&STOP));
    assert_eq!(rig.last(stop).0, Stage::Done);
    assert_eq!(rig.last(path[1]), aborted(Reason::Stopped));
    rig.dsp.grants = true;
    rig.run(1000);
    assert!(
        rig.dsp.waypoints.is_empty(),
        "nothing of a stopped path goes out"
    );
}

#[test]
fn no_path_is_dropped_in_silence() {
    let mut rig = Rig::flying();
    let headless = rig.waypoint(1, 0, 1, north(3));
    assert_eq!(rig.last(headless), refused(Reason::PathWithoutHead));
    // Before it is judged where it leads.
    let far = rig.waypoint(1, 0, 1, north(1_000_000));
    assert_eq!(rig.last(far), refused(Reason::PathWithoutHead));

    let old = rig.waypoint(2, 1, 0, north(3));
    let new = rig.waypoint(3, 1, 0, north(6));
    assert_eq!(rig.last(old), aborted(Reason::PathReplaced));
    let stranger = rig.waypoint(2, 0, 0, north(6));
    assert_eq!(rig.last(stranger), refused(Reason::PathWithoutHead));
    assert_eq!(
        rig.last(new).0,
        Stage::Accepted,
        "the stranger does not harm it"
    );

    let bad = rig.movement(MovementData {
        path_id: 3,
        altitude_m: 1e9,
        ..go_to(north(9))
    });
    assert_eq!(rig.last(bad), refused(Reason::OutOfRange));
    assert_eq!(rig.last(new), aborted(Reason::PathBroken));
    let closing = rig.waypoint(3, 0, 1, north(9));
    assert_eq!(
        rig.last(closing),
        refused(Reason::PathWithoutHead),
        "no path with a hole"
    );

    let land = rig.waypoint(4, 1, 0, north(3));
    rig.land();
    assert_eq!(rig.last(land), aborted(Reason::PathReplaced));
}

#[test]
fn a_path_has_at_most_so_many_waypoints() {
    let mut rig = Rig::flying();
    let taken: Vec<u64> = (0..MAX_WAYPOINTS)
        .map(|index| rig.waypoint(1, u16::from(index == 0), 0, north(index as i32)))
        .collect();
    let one_more = rig.waypoint(1, 0, 1, north(5));
    assert_eq!(rig.last(one_more), refused(Reason::PathTooLong));
    let (newest, earlier) = taken.split_last().unwrap();
    assert_eq!(rig.last(*newest), aborted(Reason::PathTooLong));
    for request in earlier {
        assert_eq!(rig.last(*request).0, Stage::Done, "part of the path");
    }
}

#[test]
fn a_path_whose_sender_stops_sending_is_given_up() {
    let mut rig = Rig::flying();
    let late = rig.waypoint(1, 1, 0, north(3));
    rig.run(5100);
    assert_eq!(rig.last(late), aborted(Reason::TooLate));
    let vanished = rig.waypoint(2, 1, 0, north(3));
    rig.apply(Input::SenderGone(RequestKey::Movement(vanished)));
    assert_eq!(rig.last(vanished), aborted(Reason::PathBroken));
    assert_eq!(rig.functionality(), Functionality::AtRest);
}

#[test]
fn a_lost_waypoint_is_sent_again_before_the_next() {
    let mut rig = Rig::flying();
    rig.dsp.loses = 3;
    let path = rig.path(1, &[north(3), north(6)]);
    rig.run(250);
    assert_eq!(rig.last_report(path[1]).waypoints_sent, 0);
    rig.run(400);
    assert_eq!(rig.dsp.waypoints, [north(3), north(6)]);
    let link = rig.bridge.state().link;
    assert_eq!((link.delivery_verified, link.waypoints_repeated), (1, 3));
    assert_eq!(rig.last_report(path[1]).waypoints_sent, 2);
}

#[test]
fn a_waypoint_that_never_arrives_fails_the_path() {
    let mut rig = Rig::flying();
    rig.dsp.loses = u32::MAX;
    let path = rig.path(1, &[north(3), north(6)]);
    rig.run(2000);
    let fatal = ImiError::CommunicationFatalError;
    assert_eq!(
        rig.last(path[1]),
        (Stage::Aborted, Reason::DeliveryFailed, fatal)
    );
    assert!(rig.dsp.commands.ends_with(&STOP));
}

#[test]
fn a_rest_on_the_way_at_the_place_of_the_last_waypoint_is_not_the_end() {
    let mut rig = Rig::flying();
    let path = rig.path(1, &[north(10), north(20), north(10)]);
    rig.run(1000);
    // The DSP has missed one and rests before it goes back: no longer than docs/protocol.md section 8.4 allows.
    rig.dsp.at(north(10));
    rig.run(4000);
    assert_eq!(rig.last_report(path[2]).waypoints_sent, 3);
    assert_eq!(rig.last(path[2]).0, Stage::Progress, "it is on its way");
    for place in [20, 10] {
        rig.dsp.at(north(place));
        rig.run(100);
    }
    assert_eq!(rig.last(path[2]).0, Stage::Done);
    assert_eq!(rig.last_report(path[2]).waypoints_reached, 3);
}

#[test]
fn a_dsp_that_does_not_count_gets_each_waypoint_once() {
    let mut rig = Rig::flying();
    rig.dsp.counts = false;
    rig.path(1, &[north(3), north(6)]);
    rig.run(300);
    assert_eq!(rig.dsp.waypoints, [north(3), north(6)]);
    assert_eq!(rig.bridge.state().link.delivery_verified, 0);
}

/// A path of so many waypoints to a DSP without port 10003.
fn uncounted(waypoints: i32, prepare: impl FnOnce(&mut Rig)) -> (Rig, Vec<u64>) {
    let mut rig = Rig::flying();
    rig.dsp.counts = false;
    prepare(&mut rig);
    let points: Vec<Waypoint> = (1..=waypoints).map(|index| north(10 * index)).collect();
    let path = rig.path(1, &points);
    (rig, path)
}

/// The path has ended, because the DSP does not have this waypoint; it hovers, and no more goes out.
fn assert_ended_without(rig: &mut Rig, path: &[u64], reason: Reason, waypoint: u32, error: u32) {
    let closing = *path.last().unwrap();
    assert_eq!(rig.last(closing), aborted(reason));
    let report = rig.last_report(closing);
    assert_eq!((report.waypoint, report.dsp_error_code), (waypoint, error));
    assert!(rig.dsp.held.is_empty());
    let sent = rig.dsp.waypoints.len();
    rig.run(2000);
    assert_eq!(rig.dsp.waypoints.len(), sent);
    assert_eq!(rig.last(closing), aborted(reason));
}

#[test]
fn without_counts_the_first_waypoint_that_the_dsp_refuses_ends_the_path() {
    let (mut rig, path) = uncounted(4, |rig| rig.dsp.rejects = Some(north(20)));
    rig.run(320);
    assert_ended_without(&mut rig, &path, Reason::RefusedByDsp, 2, 30);
}

#[test]
fn without_counts_the_first_waypoint_that_finds_the_buffer_full_ends_the_path() {
    let (mut rig, path) = uncounted(5, |_| ());
    rig.run(320);
    // Flow control has said 1; another waypoint was counted twice since.
    rig.dsp.places = rig.dsp.held.len();
    rig.say(dsp_protocol::Downlink::FlowControl(
        dsp_protocol::FlowControl::Send,
    ));
    rig.run(60);
    assert_ended_without(&mut rig, &path, Reason::RefusedByDsp, 4, 15);
}

#[test]
fn without_counts_a_damaged_frame_ends_the_path_since_it_may_have_been_a_waypoint() {
    for code in [100, 102] {
        let (mut rig, path) = uncounted(5, |_| ());
        rig.run(320);
        rig.dsp.errors.push_back(dsp_protocol::DspErrorCode(code));
        rig.run(40);
        let error = u32::from(code);
        assert_ended_without(&mut rig, &path, Reason::DeliveryFailed, 3, error);
    }
}

#[test]
fn without_counts_a_standstill_sends_no_burst_and_loses_no_waypoint() {
    for (has_pc_timeout, standstills_ms) in [(true, &[250, 1300][..]), (false, &[250, 1300, 1900])]
    {
        for &standstill_ms in standstills_ms {
            let mut rig = Rig::closed(&BridgeConfig::default());
            rig.dsp.has_pc_timeout = has_pc_timeout;
            rig.dsp.counts = false;
            rig.dsp.places = 16;
            rig.open();
            rig.control(ControlCommand::Start);
            rig.lift_off();
            let points: Vec<Waypoint> = (1..=30).map(|index| north(10 * index)).collect();
            let path = rig.path(1, &points);
            rig.run(330);
            let before = rig.dsp.waypoints.len();
            rig.stand_still(standstill_ms);
            assert_eq!(rig.dsp.waypoints.len(), before, "{standstill_ms}");
            rig.run(200);
            assert!((before + 1..=before + 2).contains(&rig.dsp.waypoints.len()));
            // The DSP drops each waypoint that it reaches.
            for point in &points {
                rig.run(150);
                rig.dsp.at(*point);
                rig.run(40);
                rig.dsp.held.retain(|held| held != point);
            }
            rig.run(300);
            assert_eq!(rig.dsp.waypoints, points);
            assert_eq!(rig.last(path[29]).0, Stage::Done);
        }
    }
}

#[test]
fn without_counts_a_path_of_which_a_waypoint_was_not_seen_to_be_reached_is_never_done() {
    let (mut rig, path) = uncounted(3, |_| ());
    rig.run(420);
    for place in [10, 30] {
        rig.dsp.at(north(place));
        rig.run(100);
    }
    rig.run(8000);
    let unknown = (Stage::Unknown, Reason::DeliveryFailed, ImiError::None);
    assert_eq!(rig.last(path[2]), unknown);
    assert_eq!(rig.last_report(path[2]).waypoint, 2);
    assert!(rig.dsp.held.is_empty());
}

#[test]
fn a_waypoint_that_repeats_the_one_before_is_with_the_dsp_already() {
    let mut rig = Rig::flying();
    let path = rig.path(1, &[north(3), north(3), north(6)]);
    rig.run(400);
    assert_eq!(rig.dsp.waypoints, [north(3), north(6)]);
    assert_eq!(rig.last_report(path[2]).waypoints_sent, 3);
}

/// A generator that puts one point in the middle of each leg.
#[derive(Debug, Default)]
struct Midpoints(std::collections::VecDeque<TrajectoryPoint>);

impl Trajectory for Midpoints {
    fn begin(&mut self, start: Geographic, path: &[Waypoint]) {
        let mut latitude_deg = start.latitude_deg;
        for (index, waypoint) in path.iter().enumerate() {
            let middle = Waypoint {
                latitude_deg: (latitude_deg + waypoint.latitude_deg) / 2.0,
                ..*waypoint
            };
            latitude_deg = waypoint.latitude_deg;
            for (waypoint, path_index) in [(middle, None), (*waypoint, Some(index))] {
                self.0.push_back(TrajectoryPoint {
                    waypoint,
                    path_index,
                });
            }
        }
    }

    fn peek(&self) -> Option<TrajectoryPoint> {
        self.0.front().copied()
    }

    fn advance(&mut self) {
        self.0.pop_front();
    }

    fn clear(&mut self) {
        self.0.clear();
    }
}

/// How far north each waypoint lies that was sent, in the steps of [`north`].
fn steps_sent(rig: &Rig) -> Vec<i64> {
    let waypoints = rig.dsp.waypoints.iter();
    waypoints
        .map(|waypoint| ((waypoint.latitude_deg - HOME.latitude_deg) * 1e5).round() as i64)
        .collect()
}

#[test]
fn a_trajectory_generator_fits_in_without_any_other_change() {
    let bridge = Bridge::with_trajectory(&BridgeConfig::default(), Box::<Midpoints>::default());
    let mut rig = Rig::with(bridge);
    rig.open();
    rig.control(ControlCommand::Start);
    rig.lift_off();
    let path = rig.path(1, &[north(4), north(8)]);
    rig.run(500);
    assert_eq!(steps_sent(&rig), [2, 4, 6, 8]);
    assert_eq!(
        rig.last_report(path[1]).waypoints_sent,
        2,
        "two of them are the path's"
    );
    rig.dsp.at(north(4));
    rig.run(40);
    rig.dsp.at(north(8));
    rig.run(40);
    assert_eq!(rig.last(path[1]).0, Stage::Done);
}

#[test]
fn the_configuration_chooses_the_trajectory_generator() {
    let text = "[trajectory]\nkind = \"divide_legs\"\nspacing_m = 2.5\n";
    let config: BridgeConfig = runtime::config::parse(text, "test.toml").unwrap();
    let mut rig = Rig::up(&config);
    rig.control(ControlCommand::Start);
    rig.lift_off();
    let path = rig.path(1, &[north(4), north(8)]);
    rig.run(600);
    assert_eq!(steps_sent(&rig), [2, 4, 6, 8]);
    assert_eq!(rig.last_report(path[1]).waypoints_sent, 2);
}

#[test]
fn a_path_of_the_greatest_length_is_flown_to_its_end() {
    let mut rig = Rig::flying();
    let points: Vec<Waypoint> = (0..MAX_WAYPOINTS as i32)
        .map(|step| north(step + 2))
        .collect();
    let path = rig.path(1, &points);
    let closing = path[MAX_WAYPOINTS - 1];
    for point in &points {
        rig.run(100);
        rig.dsp.at(*point);
    }
    rig.run(200);
    let report = rig.last_report(closing);
    assert_eq!(report.waypoints_reached as usize, MAX_WAYPOINTS);
    assert_eq!(rig.last(closing).0, Stage::Done);
}

#[test]
fn the_outline_has_the_path_as_long_as_it_is_held_and_another_number_with_each_change() {
    let mut rig = Rig::flying();
    let held = |rig: &Rig| {
        let outline = rig.bridge.outline();
        assert_eq!(rig.bridge.state().outline, outline.number);
        let path: Vec<f64> = outline.path.iter().map(|at| at.latitude_deg).collect();
        (outline.number, path)
    };
    let none = held(&rig);
    assert!(none.0 > 0 && none.1.is_empty(), "{none:?}");
    rig.waypoint(1, 1, 0, north(3));
    assert_eq!(held(&rig), none, "a path that is still being sent");
    rig.waypoint(1, 0, 1, north(6));
    let path = held(&rig);
    assert!(path.0 > none.0);
    let latitudes = [north(3), north(6)].map(|at| at.latitude_deg);
    assert_eq!(path.1, latitudes);
    rig.run(300);
    assert_eq!(held(&rig), path, "nothing of it changes as it is flown");
    rig.preempting(2, north(9));
    let other = held(&rig);
    assert!(other.0 > path.0 && other.1 == [north(9).latitude_deg]);
    rig.hold();
    let after = held(&rig);
    assert!(after.0 > other.0 && after.1.is_empty(), "{after:?}");
}
