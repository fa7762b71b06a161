//! `ril wait`.

use ril_tests::process::Signal;

use super::station::{done, station, until_joined};
use crate::common::{end, json, sandbox, says};
use crate::watch::screen::on_terminal;

#[test]
fn a_flight_is_followed_by_conditions() {
    let rig = sandbox();
    let station = station(&rig, 10);
    rig.run("start", 0);
    let climb = rig.start("takeoff --altitude 10");
    let finished = rig.run("wait --for altitude>=19 --for flying --timeout 600s", 0);
    assert!(
        finished.stdout[0].starts_with("altitude>=19: "),
        "{finished:#?}"
    );
    assert_eq!(finished.stdout[1], "flying: flying");
    done(climb);
    let finished = rig.run("wait --for hovering --timeout 600s --json", 0);
    let object = json(&finished.stdout[0]);
    assert_eq!(
        (&object["schema"], &object["met"]),
        (&"ril.Wait.v1".into(), &true.into())
    );
    assert_eq!(object["conditions"][0]["for"], "hovering");
    assert!(
        object["conditions"][0]["value"]
            .as_str()
            .unwrap()
            .contains("m/s")
    );
    // What is never so ends in time, with how things are.
    rig.run("wait --for landed --for up --timeout 50ms", 4)
        .err_says("timed out after 50ms; ")
        .err_says("not landed (");
    let finished = rig.run("wait --for battery<1 --timeout 50ms", 4);
    finished
        .err_says("timed out after 50ms; battery is ")
        .err_says(" V (battery<1)");
    let finished = rig.run("wait --for battery<1 --timeout 50ms --json", 4);
    assert_eq!(json(&finished.stdout[0])["met"], false);
    let landing = rig.start("land");
    let lines = on_terminal(&rig, "wait --for landed --timeout 600s", 0);
    assert_eq!(lines, ["landed: on the ground"]);
    done(landing);
    station.end();
}

#[test]
fn it_waits_for_processes_that_are_yet_to_start() {
    let rig = sandbox();
    let waiting = rig.start("wait --for up --for fix=4 --timeout 600s");
    let station = station(&rig, 1);
    assert_eq!(done(waiting), ["up: link up", "fix=4: 4"]);
    station.end();
}

#[test]
fn a_process_that_does_not_run_is_named_at_the_end() {
    let rig = sandbox();
    for (condition, process) in [
        ("up", "bridge"),
        ("landed", "status"),
        ("altitude>1", "status"),
    ] {
        rig.run(&format!("wait --for {condition} --timeout 50ms"), 3)
            .err_says(process);
    }
    rig.domain.assert_empty();
}

#[test]
fn mistakes_are_usage_errors_and_a_signal_is_no_success() {
    let rig = sandbox();
    for (args, expected) in [
        ("wait", "--for <CONDITION>"),
        ("wait --for landet", "did you mean `landed`?"),
        ("wait --for up --timeout soon", "--timeout"),
    ] {
        rig.run(args, 2).err_says(expected);
    }
    let help = rig.run("wait --help", 0).stdout;
    assert!(says(&help, "hovering         in the air"), "{help:#?}");
    let bridge = rig.bridge(1);
    let mut waiting = rig.start("wait --for up --timeout 600s");
    until_joined(&rig, "ril");
    waiting.signal(Signal::INT);
    waiting.exits(7).err_says("interrupted: not up (");
    end(bridge, Signal::INT);
}
