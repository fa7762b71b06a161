//! What is shown of samples in which everything, and nothing, has happened.

use dsp_protocol::DspErrorCode;
use ipc_types::TelemetryGroup;
use ipc_types::code::{
    DspPathState, Functionality, ImiError, LinkState, ModuleStatus, MovementKind, PilotSwitch,
    Reason, SafetyAction, SafetyRule, Stage,
};
use ipc_types::module::doing_bytes;
use ipc_types::payload::{
    DspTelemetry, HeroTelemetry, LinkHealth, ModuleState, MovementEnd, MovementState, SafetyState,
};

use super::text::fitted;
use super::*;
use operator::render::terminal::Size;
use operator::robot::fixture::lose_fix;

const NOW: MonotonicNs = MonotonicNs(100_000_000_000);

fn ago(ms: u64) -> MonotonicNs {
    MonotonicNs(NOW.0 - ms * 1_000_000)
}

/// A state in which everything has happened.
fn eventful() -> ModuleState {
    let mut state = ModuleState {
        sequence: 9,
        published_ns: ago(120).0,
        module_id: ModuleId::HeroBridge.code(),
        status: ModuleStatus::Running.code(),
        imi_error: ImiError::ImpossibleToStopModule.code(),
        functionality: Functionality::FollowingPath.code(),
        blocked: 1,
        unable_to_abort: 1,
        ..ModuleState::default()
    };
    state.movement = MovementState {
        kind: MovementKind::GoToWaypoint.code(),
        waypoints_total: 3,
        waypoints_sent: 2,
        waypoints_reached: 1,
        distance_to_go_m: 12.34,
        distance_valid: 1,
        ..MovementState::default()
    };
    state.last_end = MovementEnd {
        ended_ns: ago(12_300).0,
        kind: MovementKind::GoToWaypoint.code(),
        stage: Stage::Aborted.code(),
        reason: Reason::SenderLost.code(),
        ..MovementEnd::default()
    };
    state.link = LinkHealth {
        state: LinkState::Up.code(),
        state_since_ns: ago(12_300).0,
        port_openings: 2,
        messages_received: 40,
        last_message_ns: ago(15).0,
        telemetry_published: 30,
        last_telemetry_ns: ago(2500).0,
        ..LinkHealth::default()
    };
    state.link.dsp_path = DspPathState::Ours.code();
    state.link.pc_timeout_supported = 1;
    state.safety = SafetyState {
        amount: 4.2,
        rule: SafetyRule::FenceCeiling.code(),
        action: SafetyAction::Hold.code(),
        pilot_switch: PilotSwitch::Auto.code(),
        fence_areas: 3,
        interventions: 2,
        ..SafetyState::default()
    };
    state.refused.checksum = 3;
    state.refused.implausible_groups = 1;
    state.refused.implausible_mask = u32::from(TelemetryGroup::Sonar.bit()) | 1 << 30;
    state.dsp_errors.total = 4;
    state.dsp_errors.escalated = 1;
    state.dsp_errors.unknown = 1;
    state.dsp_errors.last_code = 777;
    let index = DspErrorCode::PC_CHECKSUM.counter_index().unwrap();
    state.dsp_errors.known[index] = 3;
    state
}

/// The state of status while telemetry comes.
fn translating() -> State {
    State {
        sequence: 4,
        published_ns: ago(300).0,
        module_id: ModuleId::HeroStatus.code(),
        status: ModuleStatus::Running.code(),
        doing: doing_bytes("translating telemetry"),
        ..State::default()
    }
}

fn report(
    robot: u32,
    state: &ModuleState,
    dsp: Option<DspTelemetry>,
    hero: Option<HeroTelemetry>,
    status: Option<&State>,
) -> StateReport {
    let samples = Samples {
        state: Some(*state),
        dsp,
        hero,
        status: status.copied(),
        stations: None,
        own_session: None,
        has_bridge: true,
        has_status: status.is_some(),
    };
    StateReport::new(RobotId::new(robot).unwrap(), samples, NOW)
}

fn code_of(report: &StateReport) -> ExitCode {
    report.trouble().map_or(ExitCode::Ok, |(code, _)| code)
}

/// Raw telemetry in which nothing is valid.
fn raw(sequence: u64, received: MonotonicNs) -> DspTelemetry {
    DspTelemetry {
        sequence,
        received_ns: received.0,
        ..DspTelemetry::default()
    }
}

/// Telemetry of a flight.
fn flight(sequence: u64, published: MonotonicNs) -> HeroTelemetry {
    let mut hero = HeroTelemetry {
        sequence,
        received_ns: published.0,
        published_ns: published.0,
        valid_groups: 0xffff,
        flying: 1,
        gps_quality: 4,
        ..HeroTelemetry::default()
    };
    hero.geodetic.latitude_rad = 37.4112_f64.to_radians();
    hero.geodetic.longitude_rad = (-6.001_f64).to_radians();
    hero.geodetic.altitude_m = 25.04;
    hero.velocity.ground_speed_mps = 3.1;
    hero.velocity.up_mps = -0.2;
    hero.velocity.course_rad = -1.570_796_4;
    hero.supply.battery_v = 24.1;
    hero.supply.fuel_fraction = 0.8;
    hero.supply.auto_switch = 1;
    hero
}

#[test]
fn a_bridge_that_has_seen_nothing_says_so() {
    let state = ModuleState {
        published_ns: NOW.0,
        module_id: ModuleId::HeroBridge.code(),
        status: ModuleStatus::WaitingDataToStart.code(),
        functionality: Functionality::AtRest.code(),
        blocked: 1,
        link: LinkHealth {
            state: LinkState::Gone.code(),
            ..LinkHealth::default()
        },
        ..ModuleState::default()
    };
    let text = report(1, &state, None, None, None).to_string();
    let expected = "\
robot       1
flight      no telemetry, at rest
data        no telemetry; bridge's state 0 ms old
module      hero-bridge not started, at rest; no error; sample 0, 0 ms old
status      no sample
control     free
movement    none yet
link        gone since an unknown time; port opened 0 times, DSP boots seen 0
            last message never, last telemetry never
            0 bytes, 0 messages; 0 samples published, 0 incoherent
            0 commands acknowledged, 0 repeated, 0 failed, 0 acks unmatched
            0 waypoints sent, 0 of them again, delivery not verified
DSP path    unknown-0; when the bridge is gone: not known yet what the DSP does
safety      no rule violated; pilot's switch unknown, 0 fence areas, 0 interventions
refused     nothing
DSP errors  none
dsp         no sample
hero        no sample
";
    assert_eq!(text, expected);
}

#[test]
fn everything_that_happened_is_shown_with_its_age() {
    let text = report(
        7,
        &eventful(),
        Some(raw(30, ago(2500))),
        Some(flight(29, ago(1000))),
        Some(&translating()),
    )
    .to_string();
    for expected in [
        "robot       7\nflight      in the air, flying the path, waypoint 2 of 3\n",
        "altitude    25.0 m, climb -0.2 m/s\n",
        "position    37.4112000° -6.0010000°\n",
        "speed       3.1 m/s over ground, course 270°\n",
        "supply      battery 24.1 V, fuel 80 %, pilot's switch auto\n",
        "GPS         RTK fixed (4)\n",
        "data        telemetry 1000 ms old; bridge's state 120 ms old\n",
        "started, flying the path, blocked, unable to abort; impossible-to-stop-module; sample 9, 120 ms old\n",
        "goto, 3 waypoints, 2 sent, 1 reached, 12.3 m to go; the one before: goto ended early: sender-lost, 12.3s ago\n",
        "up for 12.3s; port opened 2 times",
        "last message 15 ms ago, last telemetry 2500 ms ago\n",
        "DSP path    ours; when the bridge is gone: the DSP stops the helicopter by itself\n",
        "safety      above the ceiling of the fence by 4.2 m: the path is ended and the helicopter hovers (fence-ceiling); pilot's switch auto, 3 fence areas, 2 interventions\n",
        "refused     checksum 3, implausible groups 1 (groups: sonar)\n",
        "DSP errors  4, 1 of them fatal; last dsp-error-777 (unknown)\n",
        "3 × 102: checksum error from the PC\n",
        "1 × unknown codes\n",
        "dsp         sample 30, 2500 ms old, STALE\n",
        "hero        sample 29, 1000 ms old\n",
        "status      hero-status started, translating telemetry; no error; sample 4, 300 ms old\n",
    ] {
        assert!(
            text.contains(expected),
            "{expected:?} is missing in\n{text}"
        );
    }
}

#[test]
fn what_the_dsp_does_without_a_bridge_is_known_once_it_was_asked() {
    for (link, supported, expected) in [
        (LinkState::Connecting, 0, "not known yet what the DSP does"),
        (LinkState::Gone, 0, "not known yet what the DSP does"),
        (LinkState::Up, 0, "the DSP flies on to the end of its path"),
        (
            LinkState::Silent,
            0,
            "the DSP flies on to the end of its path",
        ),
        (LinkState::Up, 1, "the DSP stops the helicopter by itself"),
        (LinkState::Gone, 1, "the DSP stops the helicopter by itself"),
    ] {
        let mut state = eventful();
        state.link.state = link.code();
        state.link.pc_timeout_supported = supported;
        let text = report(1, &state, None, None, None).to_string();
        let expected = format!("when the bridge is gone: {expected}\n");
        assert!(text.contains(&expected), "{link}: {text}");
    }
}

#[test]
fn a_time_of_the_future_never_looks_fresh() {
    let later = MonotonicNs(NOW.0 + 1);
    let mut state = eventful();
    state.published_ns = u64::MAX;
    state.link.state_since_ns = u64::MAX;
    state.link.last_message_ns = later.0;
    state.link.last_telemetry_ns = later.0;
    state.movement.distance_to_go_m = f32::NAN;
    let report = report(7, &state, Some(raw(1, later)), None, None);
    let json = serde_json::to_value(&report).unwrap();
    for pointer in [
        "/module/sample/age_ms",
        "/link/state_since_ms",
        "/link/last_message_age_ms",
        "/link/last_telemetry_age_ms",
        "/movement/distance_to_go_m",
        "/dsp/age_ms",
        "/flight/age_ms",
    ] {
        assert_eq!(json.pointer(pointer), Some(&serde_json::Value::Null));
    }
    assert_eq!(json["dsp"]["stale"], true);
    assert_eq!(json["flight"]["stale"], true);
    let text = report.to_string();
    for expected in [
        "sample 9, of unknown age, STALE\n",
        "link        up since an unknown time; port",
        "last message of unknown age, last telemetry of unknown age\n",
        "dsp         sample 1, of unknown age, STALE\n",
    ] {
        assert!(
            text.contains(expected),
            "{expected:?} is missing in\n{text}"
        );
    }
}

#[test]
fn programs_get_names_ages_and_nothing_for_what_never_was() {
    let hero = flight(29, ago(1001));
    let json = serde_json::to_value(report(7, &eventful(), None, Some(hero), None)).unwrap();
    for (pointer, expected) in [
        ("/schema", serde_json::json!("ril.State.v4")),
        ("/module/status", "running".into()),
        ("/module/blocked", true.into()),
        ("/module/error", "impossible-to-stop-module".into()),
        ("/movement/kind", "goto".into()),
        ("/last_end/reason", "sender-lost".into()),
        ("/last_end/ended_age_ms", 12_300.into()),
        ("/link/state", "up".into()),
        ("/link/last_message_age_ms", 15.into()),
        ("/refused/checksum", 3.into()),
        ("/refused/implausible", vec!["sonar"].into()),
        ("/dsp_errors/by_code/0/code", 102.into()),
        (
            "/dsp_errors/by_code/0/text",
            "checksum error from the PC".into(),
        ),
        ("/dsp_errors/last", "dsp-error-777 (unknown)".into()),
        ("/dsp_errors/last_code", 777.into()),
        ("/link/dsp_path", "ours".into()),
        ("/link/pc_timeout_supported", true.into()),
        ("/safety/violation/rule", "fence-ceiling".into()),
        ("/safety/violation/amount", 4.2.into()),
        ("/safety/violation/unit", "m".into()),
        ("/safety/violation/action", "hold".into()),
        ("/safety/pilot_switch", "auto".into()),
        ("/safety/fence_areas", 3.into()),
        ("/flight/flying", true.into()),
        ("/flight/phase", "flying the path, waypoint 2 of 3".into()),
        ("/flight/altitude_m", 25.04.into()),
        ("/flight/gps_fix", "RTK fixed".into()),
        ("/flight/pilot_switch", "auto".into()),
        ("/flight/stale", true.into()),
        ("/flight/age_ms", 1001.into()),
        ("/processes/bridge", true.into()),
        ("/dsp", serde_json::Value::Null),
        ("/hero/stale", true.into()),
    ] {
        assert_eq!(json.pointer(pointer), Some(&expected), "{pointer}");
    }
    let empty = report(7, &ModuleState::default(), None, None, None);
    let json = serde_json::to_value(empty).unwrap();
    for pointer in [
        "/movement",
        "/last_end",
        "/link/last_message_age_ms",
        "/link/last_telemetry_age_ms",
        "/link/state_since_ms",
        "/link/pc_timeout_supported",
        "/dsp_errors/last",
        "/dsp_errors/last_code",
        "/safety/violation",
    ] {
        assert_eq!(
            json.pointer(pointer),
            Some(&serde_json::Value::Null),
            "{pointer}"
        );
    }
    assert_eq!(json["module"]["status"], "unknown-0");
}

#[test]
fn without_a_fix_there_is_no_position_altitude_or_speed_neither_of_status_nor_of_the_bridge() {
    // As status publishes it, and as the bridge does.
    let hero = lose_fix(flight(29, ago(100)));
    let dsp = DspTelemetry {
        valid_groups: 0xffff,
        ..raw(30, ago(100))
    };
    for (dsp, hero) in [(None, Some(hero)), (Some(dsp), None)] {
        let report = report(7, &eventful(), dsp, hero, None);
        let text = report.to_string();
        for expected in ["altitude    -\n", "position    -\n", "speed       -\n"] {
            assert!(
                text.contains(expected),
                "{expected:?} is missing in\n{text}"
            );
        }
        assert!(text.contains("GPS         no fix (0)\n"), "{text}");
        let json = serde_json::to_value(report).unwrap();
        for name in [
            "latitude_deg",
            "longitude_deg",
            "altitude_m",
            "climb_mps",
            "ground_speed_mps",
            "course_deg",
        ] {
            assert!(json["flight"][name].is_null(), "{name}: {json}");
        }
        assert_eq!(json["flight"]["gps_quality"], 0);
        assert_eq!(json["flight"]["stale"], false);
    }
}

#[test]
fn text_of_another_process_does_not_command_the_terminal() {
    let mut state = translating();
    state.doing[..3].copy_from_slice(b"\x1b[2");
    let report = report(1, &ModuleState::default(), None, None, Some(&state));
    let text = report.to_string();
    assert!(
        !text.contains('\x1b') && text.contains("unreadable"),
        "{text}"
    );
}

#[test]
fn a_relayed_robot_of_whose_link_nothing_is_known_is_no_robot_of_this_machine() {
    let report = report(1, &ModuleState::default(), None, None, None).relayed(None);
    let text = report.to_string();
    assert!(
        text.contains("relay       relayed over an unknown link: no sample\n"),
        "{text}"
    );
    let json = serde_json::to_value(report).unwrap();
    assert_eq!(json["relayed"], true);
    assert!(json["relay"].is_null());
}

/// A state of now, over a link in this state, which has brought telemetry.
fn now_over(link: LinkState) -> ModuleState {
    let mut state = eventful();
    state.link.state = link.code();
    state
}

#[test]
fn the_exit_code_says_what_is_missing() {
    let fresh = || Some(flight(1, ago(20)));
    let code = |state: &ModuleState, hero| code_of(&report(1, state, None, hero, None));
    assert_eq!(code(&now_over(LinkState::Up), fresh()), ExitCode::Ok);
    for link in [LinkState::Connecting, LinkState::Silent, LinkState::Gone] {
        assert_eq!(code(&now_over(link), fresh()), ExitCode::LinkDown, "{link}");
    }
    let old = Some(flight(1, ago(1001)));
    assert_eq!(code(&now_over(LinkState::Up), old), ExitCode::Timeout);
    assert_eq!(code(&now_over(LinkState::Up), None), ExitCode::Timeout);
    let mut just_up = now_over(LinkState::Up);
    just_up.link.telemetry_published = 0;
    assert_eq!(code(&just_up, None), ExitCode::Ok);
    let mut silent = now_over(LinkState::Gone);
    silent.published_ns = ago(1001).0;
    assert_eq!(code(&silent, fresh()), ExitCode::Timeout);
    let relayed = report(1, &now_over(LinkState::Up), None, fresh(), None).relayed(None);
    assert_eq!(code_of(&relayed), ExitCode::Ok);
    // Status publishes its state once a second.
    let with_status = |age_ms| {
        let status = State {
            published_ns: ago(age_ms).0,
            ..translating()
        };
        report(1, &now_over(LinkState::Up), None, fresh(), Some(&status))
    };
    assert_eq!(code_of(&with_status(2900)), ExitCode::Ok);
    assert!(!with_status(2900).to_string().contains("STALE"));
    let hung = with_status(3100);
    assert_eq!(code_of(&hung), ExitCode::Timeout);
    assert!(hung.to_string().contains("3100 ms old, STALE"), "{hung}");
    assert!(
        hung.situation()
            .contains("status of robot 1 runs and says nothing")
    );
}

#[test]
fn without_a_bridge_what_there_is_is_shown() {
    let status = translating();
    let samples = Samples {
        status: Some(status),
        has_status: true,
        ..Samples::default()
    };
    assert!(!samples.is_empty());
    let report = StateReport::new(RobotId::DEFAULT, samples, NOW);
    assert_eq!(code_of(&report), ExitCode::ServiceAbsent);
    let expected = "\
robot       1
flight      no telemetry
data        no telemetry; no bridge runs
module      no sample
status      hero-status started, translating telemetry; no error; sample 4, 300 ms old
dsp         no sample
hero        no sample
";
    assert_eq!(report.to_string(), expected);
    let json = serde_json::to_value(&report).unwrap();
    assert!(json["module"].is_null() && json["link"].is_null());
    assert_eq!(json["processes"]["bridge"], false);
}

#[test]
fn a_line_is_another_situation_only_when_something_happened() {
    let at = |hero: HeroTelemetry, state: &ModuleState| report(1, state, None, Some(hero), None);
    let state = now_over(LinkState::Up);
    let before = at(flight(1, ago(20)), &state);
    let mut later = flight(2, ago(10));
    later.geodetic.altitude_m = 26.0;
    let after = at(later, &state);
    assert_eq!(before.situation(), after.situation());
    assert!(
        before.line().ends_with("25.0 m, 3.1 m/s, 24.1 V"),
        "{}",
        before.line()
    );
    let mut reached = state;
    reached.movement.waypoints_reached = 2;
    assert_ne!(at(later, &reached).situation(), after.situation());
    assert_ne!(
        at(flight(3, ago(3000)), &state).situation(),
        after.situation()
    );
    let silent = now_over(LinkState::Silent);
    assert!(at(later, &silent).line().contains("link silent"));
}

/// The wire's words are those of the JSON object alone.
#[test]
fn a_line_has_plain_words_and_none_of_the_wire() {
    let mut state = eventful();
    state.status = ModuleStatus::Ended.code();
    state.blocked = 0;
    let line = report(7, &state, None, Some(flight(1, NOW)), None).situation();
    for expected in [
        "; module ready; ",
        "; above the ceiling of the fence: the path is ended and the helicopter hovers (fence-ceiling)",
    ] {
        assert!(line.contains(expected), "{expected:?} is missing in {line}");
    }
    for wrong in ["ended;", "fence-ceiling: hold", "by 4.2"] {
        assert!(!line.contains(wrong), "{line}");
    }
}

#[test]
fn a_terminal_shows_what_a_pilot_asks_first_and_breaks_no_word() {
    let raw = raw(30, ago(2500));
    let flight = flight(29, ago(1000));
    let whole = report(
        7,
        &eventful(),
        Some(raw),
        Some(flight),
        Some(&translating()),
    )
    .to_string();
    let words =
        |text: &str| -> Vec<String> { text.split_whitespace().map(str::to_owned).collect() };
    for (columns, rows) in [(80, 24), (60, 15), (80, 100), (200, 50)] {
        let size = Size { columns, rows };
        let text = fitted(&whole, size);
        let shown: Vec<&str> = text.lines().collect();
        assert!(shown.len() < rows, "{columns} x {rows}:\n{text}");
        assert!(
            shown.iter().all(|line| line.chars().count() <= columns),
            "{text}"
        );
        let titles = [
            "robot", "flight", "altitude", "position", "data", "module", "link", "safety",
        ];
        for title in titles {
            assert!(
                shown.iter().any(|line| line.starts_with(title)),
                "no {title}:\n{text}"
            );
        }
        let all = words(&whole);
        assert_eq!(rows >= 50, words(&text) == all, "{text}");
        assert_eq!(rows < 50, text.contains("`ril status | less`"), "{text}");
    }
}
