//! `ril conform` against the simulator at a pseudo-terminal. What each check finds is tested in the crate `conform`, in
//! virtual time; here a machine that stalls for seconds changes nothing.

use std::fs;

use ril_tests::process::{Finished, Signal};
use ril_tests::{Process, Sandbox};

use crate::common::{end, json, sandbox};

/// Longer than a machine stalls.
const SLACK: &str = "--slack 20s";

fn dsp(rig: &Sandbox, options: &str) -> Process {
    let mut sim = rig.start(&format!("sim --link dsp --seed 1 {options}"));
    sim.wait_for_text("ready");
    sim
}

/// Types `line` into `ril conform`.
fn typed(rig: &Sandbox, line: &str, args: &str) -> Finished {
    let line = format!("echo '{line}' | $0 conform --port dsp {SLACK} {args}");
    rig.spawn(rig.shell(&line)).wait_exit()
}

#[test]
fn the_simulator_keeps_what_is_judged_and_no_rotor_is_moved() {
    let rig = sandbox();
    let sim = dsp(&rig, "");
    let args = format!("conform --port dsp {SLACK} --only 5.1 --only 2- --only 6-unknown");
    let finished = rig.run(&format!("{args} --json"), 0);
    finished.err_says("Not sent: take-off, landing, following on, waypoints");
    let object = json(&finished.stdout[0]);
    assert_eq!(object["schema"], "ril.Conform.v1");
    assert_eq!(
        (&object["conforms"], &object["broken"]),
        (&true.into(), &0.into())
    );
    assert!(object["kept"].as_u64().unwrap() >= 20, "{object}");
    let checks = object["checks"].as_array().unwrap();
    let following = checks
        .iter()
        .find(|check| check["id"] == "5.1-following-on");
    assert_eq!(following.unwrap()["verdict"], "not-judged");
    // What is sent when the confirmation is typed.
    let finished = typed(&rig, "yes", "--rotor-disconnected --only 5.1-following-on");
    assert_eq!(finished.code(), Some(5), "{finished:#?}");
    finished.err_says("not confirmed: nothing was sent");
    let finished = typed(
        &rig,
        "the rotor is disconnected",
        "--rotor-disconnected --only 5.1-following-on",
    );
    assert_eq!(finished.code(), Some(0), "{finished:#?}");
    finished.err_says("Sent by 1 checks: following on, take-off");
    finished.out_says("conforms: every sentence that was judged is kept");
    end(sim, Signal::TERM);
}

#[test]
fn a_broken_sentence_is_named_and_its_dialogue_is_written() {
    let rig = sandbox();
    rig.write("wrong.toml", "[dsp]\nextra_groups = 0x0200\n");
    let sim = dsp(&rig, "--config wrong.toml");
    let args =
        format!("conform --port dsp {SLACK} --only 4.1-mask --only 5.1-read-16 --vectors failures");
    let finished = rig.run(&args, 8);
    finished.out_says("broken: 4.1-mask (section 4.1)");
    finished.out_says("which mask 0x0001 does not ask for");
    finished.err_says("the DSP breaks 1 sentences of docs/protocol.md");
    let vector = fs::read_to_string(rig.path("failures/4.1-mask.txt")).unwrap();
    assert!(
        vector.starts_with("# 4.1-mask (section 4.1): The mask is the one"),
        "{vector}"
    );
    assert!(
        vector.contains("  >   F0 01 00 4E 10 00 00 01 50 "),
        "{vector}"
    );
    assert!(vector.contains("  <   E9 00 04 01 "), "{vector}");
    // Played again, it shows the same.
    let finished = rig.run(
        &format!("conform --port dsp {SLACK} --replay failures/4.1-mask.txt"),
        0,
    );
    finished.out_says("  >   F0 01 00 4E 10 00 00 01 50 ");
    finished.out_says("  <   E9 00 04 01 ");
    // The start-up switches following on.
    let dialogues = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../crates/dsp-protocol/vectors/dialogues"
    );
    let args = format!("conform --port dsp --replay {dialogues}/start_up.txt");
    let finished = rig.run(&args, 5);
    finished.err_says("can move a rotor: it was not sent");
    finished.out_says("  >   F0 06 76 ");
    rig.run("conform --port dsp --replay wrong.toml", 2)
        .err_says("a line `pc profile = classic`, or `extended`, is missing");
    end(sim, Signal::TERM);
}

#[test]
fn a_helicopter_that_flies_is_left_alone_by_a_run_and_by_a_replay() {
    let rig = sandbox();
    let sim = dsp(&rig, "");
    // Following on, and take-off.
    let orders = "pc profile = classic\n 0 > F0 07 01 78\n 50 > F0 01 00 4F 09 00 00 01 4A\n";
    rig.write("take_off.txt", orders);
    let replay = "conform --port dsp --slack 1s --replay take_off.txt";
    let line = format!("echo 'the rotor is disconnected' | $0 {replay} --rotor-disconnected");
    let finished = rig.spawn(rig.shell(&line)).wait_exit();
    assert_eq!(finished.code(), Some(0), "{finished:#?}");
    finished.out_says("  >   F0 01 00 4F 09 00 00 01 4A ");
    for args in [replay, "conform --port dsp --slack 1s"] {
        let finished = rig.run(args, 5);
        finished.err_says("the helicopter flies, takes off or lands: it was left alone");
        assert!(!finished.stdout.iter().any(|line| line.contains("  >  ")));
    }
    end(sim, Signal::TERM);
}

#[test]
fn a_dsp_that_does_not_answer_and_a_port_that_is_not_there_are_told_apart() {
    let rig = sandbox();
    rig.run("conform --port dsp", 6).err_says("does not exist");
    rig.run("conform --port dsp --only 77", 2)
        .err_says("no check of the classic profile begins with 77");
    let sim = dsp(&rig, "--profile extended");
    // With the wrong profile the DSP answers with an error that the PC rejects.
    rig.run("conform --port dsp --slack 100ms", 4)
        .err_says("the DSP sends no frame that the PC accepts: other profile, in DA");
    end(sim, Signal::TERM);
    let finished = rig.run("conform --list --profile extended --json", 0);
    let first = json(&finished.stdout[0]);
    assert_eq!(first["schema"], "ril.ConformCheck.v1");
    assert!(finished.stdout.len() > 150, "{}", finished.stdout.len());
}
