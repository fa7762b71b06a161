//! Who may command what, and when: pre-emption, the safety rules, and the errors that the state shows (requirements D6,
//! H5, H6, H7).

use crate::rig::{HOME, Rig, aborted, go_to, north, refused};
use bridge::outputs::Notice;
use bridge::{BridgeConfig, Input, RequestKey, Sender};
use dsp_protocol::{Command, StatusMask, port};
use ipc_types::code::{
    ControlCommand, DspPathState, Functionality, ImiError, LinkState, ModuleStatus, PilotSwitch,
    Reason, SafetyAction, SafetyRule, Stage,
};
use ipc_types::payload::{ModuleControl, ModuleState, MovementData, ParameterRequest};

fn config(text: &str) -> BridgeConfig {
    runtime::config::parse(text, "test.toml").unwrap()
}

/// A started bridge with the helicopter in the air.
fn flying_with(text: &str) -> Rig {
    let mut rig = Rig::up(&config(text));
    rig.control(ControlCommand::Start);
    rig.lift_off();
    rig
}

fn following(rig: &mut Rig) -> u64 {
    let path = rig.path(1, &[north(100), north(200)]);
    rig.run(350);
    assert_eq!(rig.functionality(), Functionality::FollowingPath);
    path[1]
}

#[test]
fn land_hold_and_a_new_path_replace_a_path_in_one_request() {
    type Ask = fn(&mut Rig) -> u64;
    let land: Ask = |rig| rig.movement(MovementData::land(0).preempting());
    let hold: Ask = |rig| rig.hold();
    let path: Ask = |rig| rig.preempting(2, north(7));
    for (ask, doing) in [
        (land, Functionality::Landing),
        (hold, Functionality::AtRest),
        (path, Functionality::FollowingPath),
    ] {
        let mut rig = Rig::flying();
        let old = following(&mut rig);
        rig.dsp.grants = false;
        let new = ask(&mut rig);
        assert_eq!(rig.last(old), aborted(Reason::Replaced), "{doing}");
        assert_eq!(rig.stages(new)[0], Stage::Accepted);
        rig.run(100);
        assert_eq!(rig.functionality(), doing);
        assert!(rig.dsp.held.is_empty(), "{doing}");
        assert_eq!(rig.bridge.state().blocked, 0, "it stays started");
    }
}

#[test]
fn without_the_flag_a_path_goes_on_and_nothing_replaces_take_off_and_landing() {
    let mut rig = Rig::flying();
    let path = following(&mut rig);
    for request in [MovementData::land(0), go_to(north(3))] {
        let request = rig.movement(MovementData {
            first: 1,
            last: 1,
            ..request
        });
        assert_eq!(rig.last(request), refused(Reason::Busy));
    }
    assert_eq!(rig.last(path).0, Stage::Progress);

    let land = rig.movement(MovementData::land(0).preempting());
    let another = rig.movement(MovementData::land(0).preempting());
    assert_eq!(rig.last(another), refused(Reason::Busy));
    let path = rig.preempting(2, north(7));
    assert_eq!(rig.last(path), refused(Reason::Busy));
    let hold = rig.hold();
    assert_eq!(rig.last(hold), refused(Reason::UnableToAbort));
    assert!(!rig.last(land).0.is_final());
}

#[test]
fn the_pilot_s_switch_refuses_movements_and_ends_the_one_under_way() {
    let manual = |rig: &mut Rig, is_manual: bool| {
        if let Some(supply) = &mut rig.dsp.status.supply {
            supply.auto_switch = u8::from(!is_manual);
        }
        rig.run(40);
    };
    let mut rig = Rig::flying();
    let path = following(&mut rig);
    manual(&mut rig, true);
    assert_eq!(rig.last(path), aborted(Reason::PilotHasControl));
    assert_eq!(rig.last_report(path).rule(), Some(SafetyRule::PilotSwitch));
    rig.run(100);
    assert!(
        rig.dsp.held.is_empty(),
        "nothing is flown when the pilot lets go"
    );
    let safety = rig.bridge.state().safety;
    assert_eq!(safety.pilot_switch(), Some(PilotSwitch::Manual));
    assert_eq!(safety.interventions, 1);
    for request in [MovementData::land(0), MovementData::hold(0)] {
        let request = rig.movement(request);
        assert_eq!(rig.last(request), refused(Reason::PilotHasControl));
    }
    manual(&mut rig, false);
    let land = rig.land();
    assert_eq!(rig.last(land).0, Stage::Progress);
    manual(&mut rig, true);
    assert_eq!(rig.last(land), aborted(Reason::PilotHasControl));

    // Without the group the switch is not known, and the rule cannot hold.
    let mut rig = Rig::flying();
    rig.dsp.status.withdraw(StatusMask(1 << 10));
    rig.run(2500);
    assert_eq!(
        rig.bridge.state().safety.pilot_switch(),
        Some(PilotSwitch::Unknown)
    );
    following(&mut rig);
}

/// A mast 5 m to the north of home, 11 m across, and a ceiling.
const FENCE: &str = "[fence]\nceiling_m = 60.0\n[[fence.area]]\nname = \"mast\"\nkind = \"exclusion\"\n\
                     centre = [37.0001, -6.0]\nradius_m = 5.0\n";

#[test]
fn each_leg_of_a_path_must_keep_to_the_fence() {
    let high = |steps| dsp_protocol::Waypoint {
        altitude_m: 70.0,
        ..north(steps)
    };
    let aside = dsp_protocol::Waypoint {
        longitude_deg: HOME.longitude_deg + 5e-4,
        ..north(0)
    };
    // Path, the leg that breaks the fence, the rule, the area.
    let table = [
        (vec![north(30)], 1, SafetyRule::FenceExclusion, Some("mast")),
        (vec![aside, high(30)], 2, SafetyRule::FenceCeiling, None),
        (
            vec![aside, north(0), north(30)],
            3,
            SafetyRule::FenceExclusion,
            Some("mast"),
        ),
    ];
    for (path, leg, rule, area) in table {
        let mut rig = flying_with(FENCE);
        let requests = rig.path(1, &path);
        let request = requests[leg - 1];
        assert_eq!(rig.last(request), refused(Reason::FenceBreach));
        let report = rig.last_report(request);
        assert_eq!((report.rule(), report.waypoint), (Some(rule), leg as u32));
        assert_eq!(report.area(), area);
        assert!(report.value().unwrap() > 0.0);
        rig.run(500);
        assert!(rig.dsp.waypoints.is_empty());
    }
    let mut rig = flying_with(FENCE);
    let path = rig.path(1, &[aside, dsp_protocol::Waypoint { ..north(-30) }]);
    assert_eq!(rig.last(path[1]).0, Stage::Accepted);
}

/// Most often a height above take-off was given where a telemetry altitude is meant.
#[test]
fn a_waypoint_below_the_ground_of_the_take_off_is_refused_unless_the_configuration_allows_it() {
    let ground_m = HOME.altitude_m;
    let at = |altitude_m| dsp_protocol::Waypoint {
        altitude_m,
        ..north(30)
    };
    let mut rig = flying_with("");
    let state = rig.bridge.state();
    assert_eq!(state.ground_altitude(), Some(ground_m));
    let home = state
        .home()
        .map(|home| (home.latitude_deg, home.longitude_deg));
    assert_eq!(home, Some((HOME.latitude_deg, HOME.longitude_deg)));
    let path = rig.path(1, &[north(10), at(ground_m - 4.5)]);
    assert_eq!(rig.last(path[1]), refused(Reason::FenceBreach));
    let report = rig.last_report(path[1]);
    assert_eq!(
        (report.rule(), report.waypoint, report.value()),
        (Some(SafetyRule::BelowTakeOff), 2, Some(4.5))
    );
    rig.run(500);
    assert!(rig.dsp.waypoints.is_empty());
    // On the ground's height it is the pilot's choice.
    let path = rig.path(2, &[at(ground_m)]);
    assert_eq!(rig.last(path[0]).0, Stage::Accepted);

    let mut rig = flying_with("[safety]\nbelow_take_off = true\n");
    let path = rig.path(1, &[at(ground_m - 4.5)]);
    assert_eq!(rig.last(path[0]).0, Stage::Accepted);

    // A bridge that begins in the air has not seen the ground.
    let mut rig = Rig::closed(&BridgeConfig::default());
    rig.dsp.status.flying = true;
    rig.open();
    rig.control(ControlCommand::Start);
    rig.run(40);
    assert_eq!(
        (
            rig.bridge.state().ground_altitude(),
            rig.bridge.state().home()
        ),
        (None, None)
    );
    let path = rig.path(1, &[at(ground_m - 4.5)]);
    assert_eq!(rig.last(path[0]).0, Stage::Accepted);
}

/// Checks of plans ask the newest state for it.
#[test]
fn home_is_published_as_soon_as_it_is_known() {
    let mut rig = Rig::closed(&BridgeConfig::default());
    rig.dsp.status.gps_quality = Some(0);
    rig.open();
    rig.run(1_100);
    assert_eq!(rig.out.states.last().and_then(ModuleState::home), None);
    rig.dsp.status.gps_quality = Some(1);
    rig.run(40);
    assert!(
        rig.out
            .states
            .last()
            .is_some_and(|state| state.home().is_some())
    );
}

#[test]
fn an_outage_is_in_the_figures_of_the_last_minute_and_not_in_those_of_the_next() {
    let mut rig = Rig::started();
    rig.run(20_000);
    rig.dsp.acknowledges = false;
    rig.parameter(ParameterRequest::write(0, port::CRUISE_SPEED_MPS, 3.0));
    rig.run(2_000);
    rig.dsp.acknowledges = true;
    rig.run(2_000);
    let state = rig.bridge.state();
    assert!(state.link.commands_failed > 0);
    assert_eq!(
        state.last_minute.commands_failed,
        state.link.commands_failed
    );
    assert!(state.last_minute.commands_repeated > 0);
    assert!((22..=25).contains(&state.last_minute.duration_s));
    rig.run(80_000);
    let state = rig.bridge.state();
    assert!(state.link.commands_failed > 0, "since the bridge began");
    let minute = state.last_minute;
    assert_eq!((minute.commands_repeated, minute.commands_failed), (0, 0));
    assert!((60..=70).contains(&minute.duration_s), "{minute:?}");
    // 50 statuses and 10 flow controls a second.
    assert!((3_600..=4_600).contains(&minute.messages), "{minute:?}");
}

/// Otherwise a client whose waypoints are refused, again and again, would keep everybody from sending a path.
#[test]
fn a_path_that_the_fence_refuses_at_once_disturbs_no_other() {
    let mut rig = flying_with(FENCE);
    let opening = rig.waypoint(1, 1, 0, north(-10));
    let strangers = rig.waypoint(2, 1, 1, north(30));
    assert_eq!(rig.last(strangers), refused(Reason::FenceBreach));
    assert_eq!(rig.last(opening).0, Stage::Accepted);
    let closing = rig.waypoint(1, 0, 1, north(-30));
    assert_eq!(rig.last(closing).0, Stage::Accepted);
}

#[test]
fn a_take_off_beyond_the_ceiling_is_refused() {
    let mut rig = Rig::up(&config("[fence]\nceiling_m = 15.0\n"));
    rig.control(ControlCommand::Start);
    let take_off = rig.take_off();
    assert_eq!(rig.last(take_off), refused(Reason::FenceBreach));
    assert_eq!(rig.last_report(take_off).value(), Some(5.0));
}

#[test]
fn a_new_fence_ends_a_path_that_breaks_it_and_a_wrong_one_changes_nothing() {
    let mut rig = Rig::flying();
    let path = rig.path(1, &[north(-20), north(30)]);
    rig.run(350);
    let reload = |rig: &mut Rig, request_id, fence| {
        let request = ModuleControl {
            issued_ns: rig.now.0,
            ..ModuleControl::new(request_id, ControlCommand::ReloadFence)
        };
        let key = RequestKey::Control(request_id);
        rig.apply(Input::NewFence {
            key,
            sender: Sender::default(),
            request,
            fence,
        });
        rig.exchange();
        rig.last(request_id)
    };
    let outline = rig.bridge.outline().number;
    let invalid = reload(&mut rig, 900, Err(Reason::InvalidFence));
    assert_eq!(invalid, refused(Reason::InvalidFence));
    assert_eq!(rig.bridge.outline().number, outline);
    assert_eq!(rig.last(path[1]).0, Stage::Progress);
    let fence = config(FENCE).fence;
    assert_eq!(reload(&mut rig, 901, Ok(fence)).0, Stage::Done);
    assert_eq!(rig.last(path[1]), aborted(Reason::FenceBreach));
    let report = rig.last_report(path[1]);
    assert_eq!((report.waypoint, report.area()), (2, Some("mast")));
    rig.run(100);
    assert!(rig.dsp.held.is_empty());
    assert_eq!(rig.bridge.state().safety.fence_areas, 1);
    let outline = rig.bridge.outline().number;
    assert_eq!(rig.bridge.state().outline, outline);
    // An unchanged fence changes nothing.
    reload(&mut rig, 902, Ok(config(FENCE).fence));
    assert_eq!(rig.bridge.outline().number, outline);
    reload(&mut rig, 903, Ok(config("").fence));
    assert_eq!(rig.bridge.outline().number, rig.now.0 / 1000);
}

#[test]
fn a_helicopter_that_is_outside_the_fence_holds_or_lands() {
    for (action, doing) in [
        ("warn", Functionality::FollowingPath),
        ("hold", Functionality::AtRest),
        ("land", Functionality::Landing),
    ] {
        let mut rig = flying_with(&format!("[safety]\nfence_breach = \"{action}\"\n{FENCE}"));
        let path = rig.path(1, &[north(-20)]);
        rig.run(350);
        rig.dsp.grants = false;
        rig.dsp.at(north(10));
        rig.run(40);
        assert_eq!(rig.functionality(), doing, "{action}");
        if doing != Functionality::Landing {
            let safety = rig.bridge.state().safety;
            assert_eq!(safety.rule(), Some(SafetyRule::FenceExclusion));
        }
        if action != "warn" {
            assert_eq!(rig.last(path[0]), aborted(Reason::FenceBreach));
            assert_eq!(rig.last_report(path[0]).area(), Some("mast"));
        }
    }
}

#[test]
fn battery_and_fuel_warn_refuse_hold_and_land() {
    let limits = "[safety]\nsupply_for_s = 0.5\nbattery_v = { warn = 24.0, refuse = 23.0, hold = 22.0, land = 21.0 }\n";
    let battery = |rig: &mut Rig, millivolts| {
        if let Some(supply) = &mut rig.dsp.status.supply {
            supply.battery_mv = millivolts;
        }
        rig.run(600);
    };
    let mut rig = flying_with(limits);
    rig.dsp.at(north(0));
    let mut path = following(&mut rig);
    for (millivolts, action) in [(23_500, SafetyAction::Warn), (22_500, SafetyAction::Refuse)] {
        battery(&mut rig, millivolts);
        assert_eq!(rig.bridge.state().safety.action(), Some(action));
        assert_eq!(rig.last(path).0, Stage::Progress, "the path goes on");
        let next = rig.preempting(9, north(5));
        let is_refused = rig.last(next) == refused(Reason::SupplyLow);
        assert_eq!(is_refused, action == SafetyAction::Refuse);
        if !is_refused {
            path = next;
            rig.run(350);
        }
    }
    battery(&mut rig, 21_500);
    assert_eq!(rig.last(path), aborted(Reason::SupplyLow));
    assert_eq!(rig.last_report(path).value(), Some(0.5));
    let next = rig.path(2, &[north(3)]);
    assert_eq!(rig.last(next[0]), refused(Reason::SupplyLow));
    let hold = rig.hold();
    assert_eq!(rig.last(hold).0, Stage::Done, "holding is always allowed");
    rig.dsp.grants = false;
    battery(&mut rig, 20_500);
    assert_eq!(rig.functionality(), Functionality::Landing);
    rig.dsp.status.flying = false;
    rig.run(400);
    assert_eq!(rig.functionality(), Functionality::AtRest);
    let orders = rig.dsp.commands.iter();
    let land = Command::Write16 {
        port: port::LAND,
        value: 1,
    };
    assert_eq!(
        orders.filter(|command| **command == land).count(),
        1,
        "once"
    );
}

#[test]
fn a_path_that_was_lost_with_the_link_is_not_resumed_and_may_be_landed() {
    for (action, doing) in [
        ("hold", Functionality::AtRest),
        ("land", Functionality::Landing),
    ] {
        // When the line breaks between two signs of life decides which the bridge misses first.
        for later_ms in (0..1400).step_by(70) {
            let mut rig = flying_with(&format!("[safety]\nlink_loss = \"{action}\"\n"));
            following(&mut rig);
            rig.run(later_ms);
            rig.dsp.silent = true;
            rig.run(3500);
            assert_eq!(rig.link(), LinkState::Connecting);
            rig.dsp.silent = false;
            rig.dsp.grants = false;
            rig.run(3000);
            assert_eq!(rig.functionality(), doing, "{action}, {later_ms} ms later");
            assert!(rig.dsp.held.is_empty());
            assert_eq!(
                rig.bridge.state().link.dsp_path(),
                Some(DspPathState::Empty)
            );
        }
    }
}

#[test]
fn the_state_shows_an_error_as_long_as_it_holds() {
    // A refused stop, and a perfect landing after it.
    let mut rig = Rig::flying();
    rig.dsp.grants = false;
    let land = rig.land();
    rig.control(ControlCommand::Stop);
    assert_eq!(rig.imi_error(), ImiError::ImpossibleToStopModule);
    rig.dsp.status.flying = false;
    rig.run(400);
    assert_eq!(rig.last(land).0, Stage::Done);
    assert_eq!(rig.imi_error(), ImiError::None);

    // A link that is lost at rest.
    let mut rig = Rig::started();
    rig.dsp.silent = true;
    rig.run(1200);
    assert_eq!(rig.imi_error(), ImiError::CommunicationFatalError);
    assert_eq!(rig.module(), ModuleStatus::Running, "nothing has ended");
    rig.run(3000);
    assert_eq!(rig.imi_error(), ImiError::CommunicationFatalError);
    rig.dsp.silent = false;
    rig.run(3000);
    assert_eq!(rig.imi_error(), ImiError::None);

    // A port that cannot be opened, and a start-up that was never answered.
    let mut rig = Rig::closed(&BridgeConfig::default());
    rig.apply(Input::Advance);
    assert_eq!(rig.imi_error(), ImiError::CommunicationFatalError);
    rig.dsp.silent = true;
    rig.open();
    assert_eq!(rig.imi_error(), ImiError::None, "not known yet");
    rig.run(1000);
    assert_eq!(rig.imi_error(), ImiError::CommunicationFatalError);
}

#[test]
fn a_dsp_error_is_shown_as_the_dsp_sent_it() {
    for code in [0, 1, 301, 777, u16::MAX] {
        let mut rig = Rig::started();
        rig.dsp_error(code);
        let errors = rig.bridge.state().dsp_errors;
        assert_eq!(errors.last(), Some(u32::from(code)));
        rig.run(40);
        let sample = rig.out.telemetry.last().unwrap();
        assert_eq!(sample.last_dsp_error(), Some(u32::from(code)));
    }
}

#[test]
fn movements_are_taken_however_slow_the_status_is() {
    for period_ms in [20, 1000, 5000, 10_000] {
        let mut rig = Rig::flying();
        rig.dsp.status_period_ms = period_ms;
        rig.run(4 * period_ms);
        for attempt in 0..10 {
            rig.run(period_ms / 3);
            let path = rig.path(attempt, &[north(5)]);
            assert_eq!(rig.last(path[0]).0, Stage::Accepted, "{period_ms} ms");
            let hold = rig.hold();
            assert_eq!(rig.last(hold).0, Stage::Done);
        }
    }
}

#[test]
fn status_that_never_carries_time_is_published_and_told_once() {
    let mut rig = Rig::up(&BridgeConfig::default());
    rig.dsp.sends_status = false;
    rig.dsp.commands.clear();
    let mut status = rig.dsp.status;
    status.time_ms = None;
    for _ in 0..500 {
        rig.run(20);
        rig.say(dsp_protocol::Downlink::Status(status));
        rig.dsp.sends_status = false;
    }
    assert!(rig.out.telemetry.len() > 450);
    let notices = rig.out.notices.iter();
    let is_odd = |notice: &&Notice| matches!(notice, Notice::OddStatus { .. });
    assert_eq!(notices.filter(is_odd).count(), 1);
    assert!(rig.dsp.commands.len() <= 2, "{:?}", rig.dsp.commands);
}

#[test]
fn groups_that_were_not_asked_for_are_left_out() {
    let mut rig = Rig::up(&config("[status]\ngroups = [\"time\", \"geographic\"]\n"));
    rig.out.telemetry.clear();
    rig.dsp.sends_status = false;
    for _ in 0..100 {
        rig.run(20);
        let mut status = rig.dsp.status;
        status.time_ms = Some(rig.dsp.time_ms);
        rig.say(dsp_protocol::Downlink::Status(status));
        rig.dsp.sends_status = false;
    }
    assert!(rig.out.telemetry.len() > 90);
    assert!(
        rig.out
            .telemetry
            .iter()
            .all(|sample| sample.valid_groups == 0b11)
    );
}

#[test]
fn a_dsp_without_time_whose_mask_had_to_be_written_again_is_believed() {
    let mut rig = Rig::up(&BridgeConfig::default());
    rig.dsp.sends_status = false;
    rig.dsp.mask = 0xFFFE;
    let mut status = rig.dsp.status;
    status.time_ms = None;
    for _ in 0..300 {
        rig.run(20);
        rig.say(dsp_protocol::Downlink::Status(status));
        rig.dsp.sends_status = false;
    }
    assert_eq!(rig.dsp.mask, 0xFFFF, "it was written again");
    assert!(rig.out.telemetry.len() > 100);
}

type OnTheSpot = fn(&mut Rig) -> u64;
const ON_THE_SPOT: [OnTheSpot; 2] = [|rig| rig.hold(), |rig| rig.land()];

/// Lets a hold or a landing come to its end, and checks that it did.
fn carry_out(rig: &mut Rig, request: u64) {
    rig.run(600);
    if rig.functionality() == Functionality::Landing {
        rig.dsp.status.flying = false;
        rig.run(600);
    }
    assert_eq!(rig.last(request).0, Stage::Done);
    assert!(rig.dsp.held.is_empty());
}

#[test]
fn hold_and_land_are_taken_in_flight_whatever_the_state_of_the_module_and_leave_it_so() {
    let never_started: fn(&mut Rig) = |_| ();
    let stopped: fn(&mut Rig) = |rig| {
        rig.control(ControlCommand::Start);
        rig.control(ControlCommand::Stop);
    };
    let after_an_outage: fn(&mut Rig) = |rig| {
        rig.control(ControlCommand::Start);
        following(rig);
        rig.dsp.silent = true;
        rig.run(3000);
        rig.dsp.silent = false;
        rig.run(3000);
        assert_eq!(rig.link(), LinkState::Up);
    };
    for (prepare, status) in [
        (never_started, ModuleStatus::WaitingDataToStart),
        (stopped, ModuleStatus::Ended),
        (after_an_outage, ModuleStatus::Aborted),
    ] {
        for ask in ON_THE_SPOT {
            let mut rig = Rig::up(&BridgeConfig::default());
            rig.lift_off();
            prepare(&mut rig);
            assert_eq!((rig.module(), rig.bridge.state().blocked), (status, 1));
            let request = ask(&mut rig);
            assert_eq!(rig.last_report(request).reason, 0, "{status:?}");
            let path = rig.preempting(8, north(7));
            assert_eq!(rig.last(path), refused(Reason::NotStarted));
            carry_out(&mut rig, request);
            assert_eq!((rig.module(), rig.bridge.state().blocked), (status, 1));
        }
    }
}

#[test]
fn a_landing_that_the_dsp_refuses_does_not_start_the_module() {
    let mut rig = Rig::up(&BridgeConfig::default());
    rig.lift_off();
    rig.dsp.obeys = false;
    let land = rig.land();
    rig.run(1500);
    assert_eq!(rig.last(land).1, Reason::RefusedByDsp);
    assert_eq!(rig.module(), ModuleStatus::WaitingDataToStart);
}

#[test]
fn hold_and_land_wait_for_a_dsp_that_is_not_heard() {
    // Silent, in the start-up, and without a port.
    for unheard_ms in [1100, 2500, 0] {
        for ask in ON_THE_SPOT {
            let mut rig = Rig::flying();
            rig.run(200);
            match unheard_ms {
                0 => rig.apply(Input::PortClosed),
                _ => rig.dsp.silent = true,
            }
            rig.run(unheard_ms);
            assert_ne!(rig.link(), LinkState::Up);
            let request = ask(&mut rig);
            let wanted = (Stage::Accepted, Reason::LinkDown, ImiError::None);
            assert_eq!(rig.last(request), wanted);
            rig.run(500);
            assert_eq!(rig.last(request), wanted, "{unheard_ms}");
            rig.dsp.silent = false;
            if unheard_ms == 0 {
                rig.apply(Input::PortOpened(Default::default()));
            }
            rig.run(1500);
            carry_out(&mut rig, request);
            let accepted = rig.stages(request);
            let accepted = accepted.iter().filter(|stage| **stage == Stage::Accepted);
            assert_eq!(accepted.count(), 1);
            assert_eq!(rig.bridge.state().blocked, 0);
        }
    }
}

#[test]
fn a_hold_takes_the_place_of_a_path_whose_dsp_is_silent() {
    let mut rig = Rig::flying();
    let path = following(&mut rig);
    rig.dsp.silent = true;
    rig.run(1100);
    assert_eq!(rig.link(), LinkState::Silent);
    let hold = rig.hold();
    assert_eq!(rig.last(path), aborted(Reason::Replaced));
    let land = rig.land();
    assert_eq!(
        rig.last(hold),
        aborted(Reason::Replaced),
        "the last one counts"
    );
    let hold = rig.hold();
    assert_eq!(rig.last(land), aborted(Reason::Replaced));
    rig.dsp.silent = false;
    carry_out(&mut rig, hold);
    assert_eq!(rig.module(), ModuleStatus::Ended);
}

#[test]
fn a_deferred_hold_or_landing_that_waits_too_long_is_given_up() {
    for (ask, lands) in ON_THE_SPOT.into_iter().zip([false, true]) {
        let mut rig = Rig::flying();
        rig.dsp.silent = true;
        rig.run(1100);
        let request = ask(&mut rig);
        rig.run(30_000);
        assert_eq!(rig.last(request), aborted(Reason::TooLate));
        rig.dsp.silent = false;
        rig.run(3000);
        let land = Command::Write16 {
            port: port::LAND,
            value: 1,
        };
        assert!(!rig.dsp.commands.contains(&land));
        assert_eq!(rig.module(), ModuleStatus::Running);
        // In time it is what was asked for.
        rig.dsp.silent = true;
        rig.run(1100);
        let request = ask(&mut rig);
        rig.dsp.silent = false;
        rig.run(500);
        assert_eq!(rig.last(request).0 == Stage::Done, !lands);
        assert_eq!(rig.dsp.commands.contains(&land), lands);
    }
}
