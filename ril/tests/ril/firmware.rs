//! The DSP in C of `examples/firmware` is flown by `ril run bridge` as the simulator is.

use ril_tests::Process;
use ril_tests::languages::{firmware, root, skip};

use crate::common::{FOR_SLOW_MACHINES, end_all, sandbox, shown_state};

fn flies_in(profile: &str) {
    let rig = sandbox();
    let program = rig.path("firmware");
    let board = root().join("examples/firmware/main.c");
    if let Err(why) = firmware(&board, &program) {
        return skip("the DSP in C", &why);
    }
    let link = rig.path("dsp-1");
    let mut args = vec![link.as_os_str()];
    if profile == "extended" {
        args.push("extended".as_ref());
    }
    let mut dsp = Process::start(&rig.domain, &program, args);
    dsp.wait_for_text("ready");
    let profile = format!("profile = '{profile}'\n");
    rig.write(
        "bridge.toml",
        &FOR_SLOW_MACHINES.replace("[link]\n", &format!("[link]\n{profile}")),
    );
    let bridge = rig.bridge(1);
    let status = rig.status(1);
    rig.watch(1).until_ready();
    rig.run("start", 0);
    rig.run("takeoff --altitude 5", 0);
    rig.run("goto 37.41105,-6.0009,16", 0);
    rig.run("param set cruise_speed_mps 8", 0);
    rig.run("goto 37.411,-6.001,15", 0);
    let mut path = rig.start("goto 37.42,-6.001,15");
    path.wait_for_text("goto: progress");
    rig.run("hold", 0);
    // The hold has replaced it.
    assert_ne!(path.wait_exit().code(), Some(0));
    rig.run("land", 0);
    let state = shown_state(&rig, 1);
    assert_eq!(state["link"]["commands_failed"], 0, "{state:#}");
    assert_eq!(state["link"]["delivery_verified"], true, "{state:#}");
    assert_eq!(state["dsp_errors"]["total"], 0, "{state:#}");
    let rejected = state["refused"].as_object().expect("counters");
    let mut counts = rejected.values().filter_map(|count| count.as_u64());
    assert!(counts.all(|count| count == 0), "{state:#}");
    end_all([bridge, status, dsp]);
}

#[test]
fn a_dsp_in_c_flies_in_the_classic_profile() {
    flies_in("classic");
}

#[test]
fn a_dsp_in_c_flies_in_the_extended_profile() {
    flies_in("extended");
}
