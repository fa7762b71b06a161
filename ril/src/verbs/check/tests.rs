//! Checks of facts: what a doctor and a preflight say of machines and robots in order, and of each fault.

use bridge::BridgeConfig;
use ipc_types::code::{LinkState, ModuleStatus, PilotSwitch, SafetyAction, SafetyRule};
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use ipc_types::service::SERVICES;
use ipc_types::{MonotonicNs, Provider, RobotId};
use operator::config::PreflightLimits;
use operator::robot::domain::{DomainFacts, Namespace, Provided};
use operator::robot::running::ConfigOrigin;
use runtime::finding::{Finding, Severity};
use runtime::wall_clock::WallClock;

use super::facts::{
    ClockFacts, FreeMemory, LinkFacts, Live, LogPlace, Logs, MachineFacts, PreflightFacts,
    RealtimeFacts,
};
use super::preflight::{PreflightReport, judge, worst};

const NOW: MonotonicNs = MonotonicNs(100_000_000_000);

const MIB: u64 = 1 << 20;

/// A robot that is ready to take off.
fn ready() -> PreflightFacts {
    let provided = |spec: &ipc_types::service::ServiceSpec| Provided {
        robot: RobotId::DEFAULT,
        service: spec.id,
        by: Provider {
            pid: if spec.id.provider() == "bridge" { 7 } else { 8 },
            process: spec.id.provider().to_owned(),
            since_ns: 1,
            pid_namespace: 4,
            time_namespace: 5,
        },
        pids: Namespace::Ours,
        clock: Namespace::Ours,
    };
    let bridge = runtime::config::parse::<BridgeConfig>(
        "[safety]\nbattery_v = { land = 22.0 }\nfuel_percent = { land = 10 }\n\
         [[fence.area]]\nname = 'field'\nkind = 'inclusion'\ncentre = [37.4, -6.0]\nradius_m = 100.0\n",
        "bridge.toml",
    );
    PreflightFacts {
        robot: 1,
        now: NOW,
        machine: MachineFacts {
            robot: 1,
            domain: Ok(DomainFacts {
                root: "/dev/shm/lab".into(),
                inspection: Ok(ipc_types::inspect::Inspection::default()),
                providers: Ok(SERVICES.iter().map(provided).collect()),
                stopped: Vec::new(),
                others: Vec::new(),
            }),
            root_fault: None,
            limits: Vec::new(),
            free_memory: Ok(FreeMemory {
                bytes: 1000 * MIB,
                inodes: None,
            }),
            clock: ClockFacts {
                clock: WallClock {
                    unix_s: 1_800_000_000,
                    not_before_unix_s: 1_700_000_000,
                },
                is_synchronized: true,
            },
            files: Vec::new(),
            port: None,
            realtime: RealtimeFacts::default(),
            relay: None,
            view: None,
            mavlink: None,
            repair: None,
        },
        live: Live {
            state: Some(state()),
            dsp: Some(telemetry()),
            hero: Some(HeroTelemetry {
                received_ns: NOW.0,
                ..HeroTelemetry::default()
            }),
            answer: Some(Ok(())),
            is_relayed: false,
        },
        bridge: Some(bridge.unwrap()),
        bridge_origin: ConfigOrigin::File("bridge.toml".into()),
        logs: Logs::Configured(vec![log()]),
    }
}

fn state() -> ModuleState {
    let mut state = ModuleState {
        published_ns: NOW.0,
        status: ModuleStatus::WaitingDataToStart.code(),
        ..ModuleState::default()
    };
    state.link.state = LinkState::Up.code();
    state.link.state_since_ns = 1;
    state.last_minute.duration_s = 64;
    state.last_minute.messages = 10_000;
    state.link.pc_timeout_supported = 1;
    state.link.telemetry_published = 10_000;
    state.safety.pilot_switch = PilotSwitch::Auto.code();
    state.safety.fence_areas = 1;
    (state.home_latitude_deg, state.home_longitude_deg) = (37.4112, -6.001);
    (state.ground_altitude_m, state.ground_valid) = (15.0, 1);
    state
}

fn telemetry() -> DspTelemetry {
    let mut dsp = DspTelemetry {
        received_ns: NOW.0 - 20_000_000,
        valid_groups: u16::MAX,
        gps_quality: 4,
        ..DspTelemetry::default()
    };
    dsp.supply.battery_mv = 25_200;
    dsp.supply.fuel_percent = 100;
    dsp
}

fn log() -> LogPlace {
    LogPlace {
        directory: "log".into(),
        min_free_bytes: 256 * MIB,
        free_bytes: Ok(320 * MIB),
        is_writable: true,
    }
}

fn state_of(facts: &mut PreflightFacts) -> &mut ModuleState {
    facts.live.state.as_mut().unwrap()
}

fn dsp_of(facts: &mut PreflightFacts) -> &mut DspTelemetry {
    facts.live.dsp.as_mut().unwrap()
}

/// The only log of a robot that is ready.
fn log_of(facts: &mut PreflightFacts) -> &mut LogPlace {
    match &mut facts.logs {
        Logs::Configured(logs) => &mut logs[0],
        other => panic!("{other:?}"),
    }
}

fn breaks(facts: &mut PreflightFacts, rule: SafetyRule, action: SafetyAction, amount: f64) {
    let safety = &mut state_of(facts).safety;
    (safety.rule, safety.action, safety.amount) = (rule.code(), action.code(), amount);
}

/// How severe a check is; `None` if it could not be made.
fn made(check: &Finding) -> Option<Severity> {
    check.is_checked.then_some(check.severity)
}

/// The check `id` after `change`, and that every other check stays as it is with a ready robot, but those in `others`.
#[track_caller]
fn after(id: &str, others: &[&str], change: impl FnOnce(&mut PreflightFacts)) -> Finding {
    let mut facts = ready();
    let before = judge(&facts, &PreflightLimits::default());
    change(&mut facts);
    let checks = judge(&facts, &PreflightLimits::default());
    for check in &checks {
        let is_trouble = check.is_checked && check.severity > Severity::Note;
        assert!(!is_trouble || check.next_step.is_some(), "{check:?}");
        let unchanged = before.iter().find(|one| one.id == check.id);
        if check.id != id && !others.contains(&check.id) {
            assert_eq!(Some(check), unchanged, "{id}");
        }
    }
    let mut checks = checks.into_iter();
    checks
        .find(|check| check.id == id)
        .expect("a check of this name")
}

#[test]
fn a_robot_that_is_ready_passes_every_check_that_can_be_made() {
    let checks = judge(&ready(), &PreflightLimits::default());
    assert_eq!(worst(&checks), Severity::Note, "{checks:#?}");
    let unmade: Vec<&str> = checks
        .iter()
        .filter(|check| !check.is_checked)
        .map(|check| check.id)
        .collect();
    assert!(unmade.is_empty(), "{unmade:?}");
}

#[test]
fn each_trouble_is_found_by_its_own_check() {
    use Severity::{Error, Note, Warning};
    type Change = fn(&mut PreflightFacts);
    #[rustfmt::skip]
    let cases: &[(&str, Change, Option<Severity>, &str)] = &[
        ("dsp-link", |facts| state_of(facts).link.state = LinkState::Gone.code(), Some(Error), "gone for 100.0 s: "),
        // Gone since the bridge began: there is no moment to count from, and the machine's start is none.
        ("dsp-link", |facts| {
            let link = &mut state_of(facts).link;
            (link.state, link.state_since_ns) = (LinkState::Gone.code(), 0);
        }, Some(Error), "gone: the bridge has no serial port"),
        ("dsp-link", |facts| state_of(facts).link.state = LinkState::Silent.code(), Some(Error), "silent for 100.0 s: "),
        ("dsp-link", |facts| state_of(facts).link.state = LinkState::Connecting.code(), Some(Error), "connecting for 100.0 s: "),
        ("dsp-errors", |facts| {
            let errors = &mut state_of(facts).dsp_errors;
            (errors.total, errors.last_code) = (1, 30);
        }, Some(Warning), "1 error since the bridge began, last dsp-error-30"),
        ("link-losses", |facts| state_of(facts).last_minute.rejected = 30, Some(Warning), "0.30 % of 10030 messages of the last 64 s rejected"),
        ("link-losses", |facts| state_of(facts).last_minute.rejected = 300, Some(Error), "2.91 %"),
        ("link-losses", |facts| state_of(facts).last_minute.commands_failed = 1, Some(Error), "0 commands repeated and 1 failed"),
        ("link-losses", |facts| {
            let minute = &mut state_of(facts).last_minute;
            (minute.messages, minute.rejected) = (20, 1);
        }, Some(Note), "0.10 %"),
        // An outage that is over.
        ("link-losses", |facts| {
            let state = state_of(facts);
            (state.link.commands_failed, state.refused.checksum) = (3, 5_000);
        }, Some(Note), "0.00 % of 10000 messages of the last 64 s rejected, 0 commands repeated and 0 failed"),
        ("telemetry", |facts| dsp_of(facts).received_ns = NOW.0 - 1_500_000_000, Some(Error), "1.500 s old"),
        ("telemetry", |facts| dsp_of(facts).received_ns = NOW.0 + 1, Some(Error), "dated in the future"),
        ("robot-telemetry", |facts| facts.live.hero = None, Some(Error), "no sample came"),
        ("module", |facts| {
            let state = state_of(facts);
            (state.status, state.imi_error) = (ModuleStatus::Aborted.code(), 102);
        }, Some(Warning), "aborted: movement-timeout"),
        ("dsp-timeout", |facts| state_of(facts).link.pc_timeout_supported = 0, Some(Warning), "flies on"),
        ("ground", |facts| dsp_of(facts).flying = 1, Some(Warning), "flying"),
        ("mode-switch", |facts| state_of(facts).safety.pilot_switch = PilotSwitch::Manual.code(), Some(Error), "manual"),
        ("mode-switch", |facts| state_of(facts).safety.pilot_switch = 0, None, "does not send"),
        ("orders", |facts| facts.live.answer = Some(Err("the bridge did not answer".to_owned())), Some(Error), "did not answer"),
        ("orders", |facts| facts.live.answer = None, None, "no process"),
        ("supply-rules", |facts| facts.bridge = None, None, "no bridge.toml"),
        ("gps-fix", |facts| dsp_of(facts).gps_quality = 1, Some(Warning), "quality 1 (GPS)"),
        ("gps-fix", |facts| dsp_of(facts).gps_quality = 0, Some(Error), "quality 0 (no fix)"),
        ("battery", |facts| dsp_of(facts).supply.battery_mv = 23_900, Some(Warning), "23.9 V"),
        ("battery", |facts| dsp_of(facts).supply.battery_mv = 22_900, Some(Error), "22.9 V"),
        ("fuel", |facts| dsp_of(facts).supply.fuel_percent = 24, Some(Error), "24.0 %"),
        ("fence", |facts| state_of(facts).safety.fence_areas = 0, Some(Warning), "0 areas in force, 1 area in bridge.toml"),
        ("safety-rules", |facts| breaks(facts, SafetyRule::FenceCeiling, SafetyAction::Refuse, 4.2),
            Some(Error), "fence-ceiling broken by 4.2 m; the bridge's action: refuse"),
        ("safety-rules", |facts| breaks(facts, SafetyRule::Battery, SafetyAction::Warn, 0.2), Some(Warning), "battery broken by 0.2 V"),
        ("supply-rules", |facts| facts.bridge.as_mut().unwrap().safety.battery_v = Default::default(), Some(Warning), "for battery_v"),
        ("clock", |facts| facts.machine.clock.clock.unix_s = 0, Some(Warning), "the clock was never set: 1970-01-01T00:00:00Z is before"),
        ("log-room", |facts| facts.logs = Logs::NoFile, Some(Warning), "no status.toml is here"),
        ("log-room", |facts| facts.logs = Logs::Configured(Vec::new()), Some(Warning), "has no log"),
        ("log-room", |facts| log_of(facts).free_bytes = Ok(319 * MIB), Some(Warning), "319 MiB free"),
        ("log-room", |facts| log_of(facts).free_bytes = Ok(255 * MIB), Some(Error), "the log pauses"),
        ("log-room", |facts| facts.logs = Logs::Configured(vec![log(), log()]), Some(Warning), "320 MiB free"),
        ("log-room", |facts| log_of(facts).is_writable = false, Some(Error), "may not be written"),
        ("shared-memory", |facts| facts.machine.free_memory.as_mut().unwrap().bytes = 5 * MIB, Some(Warning), "nearly full"),
    ];
    for (id, change, severity, expected) in cases {
        // Values of telemetry that is not of the present are not judged.
        let others: &[&str] = match *id {
            "telemetry" => &["ground", "home", "gps-fix", "battery", "fuel"],
            "gps-fix" => &["home"],
            "dsp-link" => &["dsp-timeout"],
            _ => &[],
        };
        let check = after(id, others, change);
        assert_eq!(made(&check), *severity, "{check:?}");
        assert!(check.text.contains(expected), "{expected}: {check:?}");
    }
}

#[test]
fn what_was_not_checked_is_not_ready_unless_the_operator_does_without_it() {
    let mut facts = ready();
    dsp_of(&mut facts).valid_groups = 0;
    let unmade = ["home", "gps-fix", "battery", "fuel"];
    let report = PreflightReport::new(1, judge(&facts, &PreflightLimits::default()));
    assert_eq!(report.worst(), Severity::Error);
    let expected = "0 failed, 0 warnings, 20 passed, 4 not checked: home, gps-fix, battery, fuel";
    assert_eq!(report.summary(), expected);
    let text = report.text(usize::MAX);
    for expected in [
        "-     battery         not checked: the DSP sends no plausible group `supply`\n",
        "→ add the group to `status.groups`",
        "\nNOT ready to take off: 0 failed,",
    ] {
        assert!(text.contains(expected), "{expected}\n{text}");
    }
    let expected = "not ready to take off, not checked: home, gps-fix, battery, fuel; `ril preflight` says what to do";
    assert_eq!(report.warnings(), [expected]);

    let limits = PreflightLimits {
        may_be_unchecked: unmade.map(str::to_owned).to_vec(),
        ..PreflightLimits::default()
    };
    let checks = judge(&facts, &limits);
    assert_eq!(worst(&checks), Severity::Warning);
    for check in checks.iter().filter(|check| unmade.contains(&check.id)) {
        assert_eq!(
            (check.severity, check.is_checked),
            (Severity::Warning, false)
        );
        assert!(check.next_step.is_some(), "{check:?}");
    }
    // A check that can be made is judged by the usual rules.
    facts = ready();
    dsp_of(&mut facts).supply.battery_mv = 20_000;
    assert_eq!(worst(&judge(&facts, &limits)), Severity::Error);
}

/// Processes that live and say nothing, such as a bridge that is stopped.
#[test]
fn a_robot_of_which_nothing_could_be_checked_is_not_ready() {
    let mut facts = ready();
    facts.live = Live::default();
    let checks = judge(&facts, &PreflightLimits::default());
    assert!(
        !checks
            .iter()
            .any(|check| made(check) == Some(Severity::Error))
    );
    let report = PreflightReport::new(1, checks);
    assert_eq!(report.worst(), Severity::Error);
    let summary = report.summary();
    assert!(
        summary.contains(" not checked: orders, dsp-link, link-losses"),
        "{summary}"
    );
}

#[test]
fn without_a_bridge_the_processes_fail_and_the_rest_says_why_it_was_not_checked() {
    let mut facts = ready();
    facts.live = Live::default();
    if let Ok(domain) = &mut facts.machine.domain {
        domain.providers = Ok(Vec::new());
    }
    let checks = judge(&facts, &PreflightLimits::default());
    let failed: Vec<&str> = checks
        .iter()
        .filter(|check| made(check) == Some(Severity::Error))
        .map(|check| check.id)
        .collect();
    assert_eq!(failed, ["bridge", "status"]);
    let bridge = &checks[0];
    assert_eq!(
        bridge.next_step.as_deref(),
        Some("start it: `ril run bridge --robot 1`")
    );
    let unmade = checks.iter().filter(|check| !check.is_checked);
    for check in unmade.clone() {
        assert_eq!(made(check), None, "{check:?}");
    }
    assert!(unmade.count() > 10);
}

#[test]
fn of_a_robot_on_another_machine_the_link_is_checked_and_its_disk_is_not() {
    let relayed = |link: ipc_types::payload::RelayLink| {
        let mut facts = ready();
        facts.live.is_relayed = true;
        if let Ok(Ok(providers)) = facts
            .machine
            .domain
            .as_mut()
            .map(|domain| &mut domain.providers)
        {
            for provided in providers {
                provided.by.process = "relay".to_owned();
            }
        }
        facts.machine.relay = Some(LinkFacts {
            link: Ok(Some(link)),
            now: NOW,
        });
        judge(&facts, &PreflightLimits::default())
    };
    let link = ipc_types::payload::RelayLink {
        published_ns: NOW.0,
        state: ipc_types::code::RelayLinkState::Up.code(),
        clock_valid: 1,
        ..Default::default()
    };
    let checks = relayed(link);
    let of = |checks: &[Finding], id: &str| {
        let check = checks.iter().find(|check| check.id == id);
        check.cloned().expect("a check of this name")
    };
    assert_eq!(made(&of(&checks, "relay-link")), Some(Severity::Note));
    assert!(checks.iter().all(|check| check.id != "log-room"));
    assert_eq!(
        of(&checks, "bridge").text,
        "relayed from another machine (process 7)"
    );
    let checks = relayed(ipc_types::payload::RelayLink {
        state: ipc_types::code::RelayLinkState::Down.code(),
        ..link
    });
    assert_eq!(made(&of(&checks, "relay-link")), Some(Severity::Error));
    let here = judge(&ready(), &PreflightLimits::default());
    assert!(here.iter().all(|check| check.id != "relay-link"));
}

#[test]
fn limits_are_those_of_the_configuration() {
    let config = "[preflight]\nbattery_v = { warn = 26.0, fail = 25.5 }\ngps_quality_pass = [1]\n";
    let config = runtime::config::parse::<operator::config::Config>(config, "ril.toml").unwrap();
    let checks = judge(&ready(), &config.preflight);
    let of = |id| checks.iter().find(|check| check.id == id).unwrap();
    assert_eq!(made(of("battery")), Some(Severity::Error));
    assert_eq!(
        of("battery").limit.as_deref(),
        Some("at least 26 V (fail below 25.5 V)")
    );
    assert_eq!(made(of("gps-fix")), Some(Severity::Error));
}

#[test]
fn the_report_is_a_line_for_each_check_and_fits_the_terminal() {
    let mut facts = ready();
    dsp_of(&mut facts).supply.battery_mv = 22_000;
    state_of(&mut facts).safety.pilot_switch = 0;
    let report = PreflightReport::new(1, judge(&facts, &PreflightLimits::default()));
    assert_eq!(report.worst(), Severity::Error);
    let text = report.text(80);
    assert!(
        text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );
    for expected in [
        "FAIL  battery         22.0 V; limit: at least 24 V (fail below 23 V)\n",
        "                      → charge or replace the battery\n",
        "-     mode-switch     not checked: the DSP does not send the switch, or what it\n",
        "\nNOT ready to take off: 1 failed, 0 warnings, ",
        ", 1 not checked:",
    ] {
        assert!(text.contains(expected), "{expected:?}\n{text}");
    }
    assert_eq!(
        report.warnings(),
        [
            "not ready to take off: battery: 22.0 V",
            "not ready to take off, not checked: mode-switch; `ril preflight` says what to do"
        ]
    );
    let json = serde_json::to_value(&report).unwrap();
    for (pointer, expected) in [
        ("/schema", serde_json::json!("ril.Preflight.v1")),
        ("/verdict", "fail".into()),
        ("/failed", 1.into()),
        ("/unchecked", 1.into()),
        ("/checks/0/id", "bridge".into()),
        ("/checks/0/verdict", "pass".into()),
        ("/checks/0/limit", "running".into()),
        ("/checks/0/next_step", serde_json::Value::Null),
    ] {
        assert_eq!(json.pointer(pointer), Some(&expected), "{pointer}");
    }
    let none: Vec<String> =
        PreflightReport::new(1, judge(&ready(), &PreflightLimits::default())).warnings();
    assert!(none.is_empty(), "{none:?}");
}
