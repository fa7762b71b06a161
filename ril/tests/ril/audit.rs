//! The audit trail: who asked for what and what became of it is in the bridge's log (requirement H8).

use crate::common::{FOR_SLOW_MACHINES, end, json, sandbox};
use ril_tests::process::{Finished, Signal};

/// The id of the request that a command with `--json` reported about last.
fn request_id(finished: &Finished) -> u64 {
    // Behind it is the failure, if there is one.
    let mut ids = finished
        .stdout
        .iter()
        .rev()
        .map(|line| json(line)["request_id"].as_u64());
    ids.find_map(|id| id).expect("a report")
}

#[test]
fn every_request_refusal_phase_and_link_change_is_one_line_with_its_request() {
    let rig = sandbox();
    let low = "[safety.battery_v]\nwarn = 99.0\n";
    rig.write("bridge.toml", &format!("{FOR_SLOW_MACHINES}{low}"));
    // The start-up empties the queue of errors, so one comes each second.
    let error = "[[fault]]\nkind = \"raise_error\"\nat_s = 1\nevery_s = 1\ncode = 45\n";
    rig.write("faults.toml", error);
    let sim = rig.sim(1, "--speed 10 --faults faults.toml");
    let bridge = rig.bridge(1);
    rig.watch(1).until_ready();
    let refused = request_id(&rig.run("takeoff --altitude 10 --json", 5));
    let start = request_id(&rig.run("start --json", 0));
    let take_off = request_id(&rig.run("takeoff --altitude 10 --json", 0));
    let far_away = request_id(&rig.run("goto 38.4,-6.0,20 --json", 5));
    let parameter = request_id(&rig.run("param set cruise_speed_mps 6 --json", 0));
    rig.watch(1)
        .until("a low battery and an error of the DSP", |state| {
            state.safety.rule().is_some() && state.dsp_errors.total > 0
        });
    end(sim, Signal::INT);
    rig.watch(1).until("a lost link", |state| {
        state.link.state() == Some(ipc_types::code::LinkState::Gone)
    });
    let log = end(bridge, Signal::INT).stderr;

    // Each line, and how often it is there.
    #[rustfmt::skip]
    let lines = [
        (vec!["request ".to_owned(), format!("request={refused} ")], 1),
        (vec![format!("request={refused} "), r#"stage="refused""#.to_owned(), r#"reason="not-started""#.to_owned()], 1),
        (vec![format!("request={start} "), r#"command="start""#.to_owned()], 1),
        (vec![format!("request={take_off} "), "sender=".to_owned(), r#"command="takeoff""#.to_owned(), "height_m=10".to_owned()], 1),
        (vec![format!("request={take_off} "), r#"stage="done""#.to_owned(), "value=".to_owned()], 1),
        (vec![format!("request={far_away} "), r#"reason="too-far""#.to_owned()], 1),
        (vec![format!("request={parameter} "), r#"command="write""#.to_owned(), "port=20000".to_owned()], 1),
        (vec!["phase".to_owned(), r#"doing="taking-off""#.to_owned()], 1),
        (vec!["link".to_owned(), r#"to="up""#.to_owned()], 1),
        (vec!["link".to_owned(), r#"to="gone""#.to_owned()], 1),
    ];
    for (parts, expected) in lines {
        let found = log
            .iter()
            .filter(|line| parts.iter().all(|part| line.contains(part.as_str())))
            .count();
        assert_eq!(found, expected, "{parts:?} in {log:#?}");
    }
    // It stays in the log as long as it comes, once a second at most.
    let error = ["DSP error", "code=45 ", r#"text="GPS CRC""#];
    let is_error = |line: &String| error.iter().all(|part| line.contains(part));
    assert!(log.iter().any(is_error), "{log:#?}");
    // Numbers that were measured end at the third decimal.
    for name in [" amount=", " value="] {
        let mut values = log.iter().filter_map(|line| line.split_once(name));
        let is_rounded = |value: &str| {
            value
                .split_once('.')
                .is_none_or(|(_, more)| more.len() <= 3)
        };
        let (_, first) = values.next().expect("a value");
        for (_, value) in values.chain([("", first)]) {
            let value = value.split(' ').next().unwrap_or_default();
            assert!(is_rounded(value), "{name}{value}");
        }
    }
}
