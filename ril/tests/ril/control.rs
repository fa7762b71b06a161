//! `ril control …`: who commands a real bridge, distinguished by sessions.

use crate::common::{FOR_SLOW_MACHINES, json, sandbox};
use ipc_types::payload::ModuleState;
use ril_tests::Process;

/// An operator at a terminal of its own: takes control, and keeps it until something is written into the pipe.
const TERMINAL: &str = "mkfifo go && exec setsid --wait sh -c '\"$0\" control take && \"$0\" control show && read line < go' \"$0\"";

#[test]
fn the_one_at_another_terminal_asks_for_control_and_has_it_when_the_first_is_gone() {
    let rig = sandbox();
    let config = format!("{FOR_SLOW_MACHINES}[control]\nexclusive = true\nsilence_s = 3600.0\n");
    rig.write("bridge.toml", &config);
    let robot = rig.start_robot(1, 1);
    rig.run("control show", 0)
        .out_says("control of robot 1: free; the first sender that orders gets it");
    let mut first = Process::spawn(&rig.domain, rig.shell(TERMINAL));
    first.wait_for_text("this terminal, for");

    let second = |args: &str, code: i32| rig.start_by("setsid --wait", args).exits(code);
    let refused = second("takeoff 5", 5);
    refused.err_says("takeoff was refused (not-in-control): another sender has control");
    second("control pass", 5).err_says("not-in-control");
    let hold = rig.start_by("setsid --wait", "hold").wait_exit();
    assert!(
        !hold
            .stderr
            .iter()
            .any(|line| line.contains("not-in-control")),
        "{hold:#?}"
    );
    second("control take", 5).err_says("`ril control show` names it");
    let shown = json(&rig.run("control show --json", 0).stdout[0]);
    assert_eq!(shown["schema"], "ril.Control.v1");
    let control = &shown["control"];
    assert_eq!(control["exclusive"], true);
    for sender in ["holder", "asker"] {
        assert!(control[sender]["session"].as_u64() > Some(0), "{shown}");
    }
    let status = rig.finish("status").stdout;
    let said = status.iter().find(|line| line.starts_with("control  "));
    assert!(
        said.is_some_and(|line| line.contains("asks for it")),
        "{status:#?}"
    );

    std::fs::write(rig.path("go"), "on\n").expect("a reader");
    first.exits(0);
    let mut states = rig.subscribe::<ModuleState>(1);
    states.until("control is free", |state| state.holder().is_none());
    second("control take", 0).out_says("control take: done");
    robot.end();
}
