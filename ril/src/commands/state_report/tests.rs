//! What is shown of samples in which everything, and nothing, has happened.

use ipc_types::code::{
    DspPathState, ImiError, MovementKind, PilotSwitch, SafetyAction, SafetyRule,
};
use ipc_types::module::doing_bytes;

use super::*;

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
    let text = StateReport::new(1, &state, None, None, None, NOW).to_string();
    let expected = "\
robot       1
module      hero-bridge waiting-data-to-start, at-rest, blocked; no-error; sample 0, 0 ms old
status      no sample
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
    let dsp = Sample::new(30, ago(2500), NOW);
    let hero = Sample::new(29, ago(1000), NOW);
    let text = StateReport::new(
        7,
        &eventful(),
        Some(dsp),
        Some(hero),
        Some(&translating()),
        NOW,
    )
    .to_string();
    for expected in [
        "robot       7\n",
        "running, following-path, blocked, unable to abort; impossible-to-stop-module; sample 9, 120 ms old\n",
        "goto, 3 waypoints, 2 sent, 1 reached, 12.3 m to go\n",
        "up for 12.3s; port opened 2 times",
        "last message 15 ms ago, last telemetry 2500 ms ago\n",
        "DSP path    ours; when the bridge is gone: the DSP stops the helicopter by itself\n",
        "safety      fence-ceiling by 4.2 m: hold; pilot's switch auto, 3 fence areas, 2 interventions\n",
        "refused     checksum 3, implausible groups 1 (groups: sonar)\n",
        "DSP errors  4, 1 of them fatal; last dsp-error-777 (unknown)\n",
        "3 × 102: checksum error from the PC\n",
        "1 × unknown codes\n",
        "dsp         sample 30, 2500 ms old, STALE\n",
        "hero        sample 29, 1000 ms old\n",
        "status      hero-status running, translating telemetry; no-error; sample 4, 300 ms old\n",
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
        let text = StateReport::new(1, &state, None, None, None, NOW).to_string();
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
    let dsp = Sample::new(1, later, NOW);
    let report = StateReport::new(7, &state, Some(dsp), None, None, NOW);
    let json = serde_json::to_value(&report).unwrap();
    for pointer in [
        "/module/sample/age_ms",
        "/link/state_since_ms",
        "/link/last_message_age_ms",
        "/link/last_telemetry_age_ms",
        "/movement/distance_to_go_m",
        "/dsp/age_ms",
    ] {
        assert_eq!(json.pointer(pointer), Some(&serde_json::Value::Null));
    }
    assert_eq!(json["dsp"]["stale"], true);
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
    let hero = Sample::new(29, ago(1001), NOW);
    let json = serde_json::to_value(StateReport::new(
        7,
        &eventful(),
        None,
        Some(hero),
        None,
        NOW,
    ))
    .unwrap();
    for (pointer, expected) in [
        ("/schema", serde_json::json!("ril.State.v3")),
        ("/module/status", "running".into()),
        ("/module/blocked", true.into()),
        ("/module/error", "impossible-to-stop-module".into()),
        ("/movement/kind", "goto".into()),
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
        ("/dsp", serde_json::Value::Null),
        ("/hero/stale", true.into()),
    ] {
        assert_eq!(json.pointer(pointer), Some(&expected), "{pointer}");
    }
    let json = serde_json::to_value(StateReport::new(
        7,
        &ModuleState::default(),
        None,
        None,
        None,
        NOW,
    ))
    .unwrap();
    for pointer in [
        "/movement",
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
fn text_of_another_process_does_not_command_the_terminal() {
    let mut state = translating();
    state.doing[..3].copy_from_slice(b"\x1b[2");
    let report = StateReport::new(1, &ModuleState::default(), None, None, Some(&state), NOW);
    let text = report.to_string();
    assert!(
        !text.contains('\x1b') && text.contains("\\u{1b}[2"),
        "{text}"
    );
}

#[test]
fn a_relayed_robot_of_whose_link_nothing_is_known_is_no_robot_of_this_machine() {
    let report = StateReport::new(1, &ModuleState::default(), None, None, None, NOW).relayed(None);
    let text = report.to_string();
    assert!(
        text.contains("relay       relayed over an unknown link: no sample\n"),
        "{text}"
    );
    let json = serde_json::to_value(report).unwrap();
    assert_eq!(json["relayed"], true);
    assert!(json["relay"].is_null());
}
