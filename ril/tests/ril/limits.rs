//! Limits that a shell or a supervisor sets on a process: each is an error that is reported, and ends no process in
//! silence.

use crate::common::{FOR_SLOW_MACHINES, end, end_all, sandbox};
use ril_tests::process::{Process, Signal};
use rustix::process::{Pid, Resource, Rlimit, getrlimit, prlimit};

#[test]
fn a_process_that_may_write_no_file_says_so_instead_of_being_killed() {
    let rig = sandbox();
    for args in [
        "run bridge --port absent",
        "run status",
        "status",
        "echo dsp",
    ] {
        let line = format!("ulimit -c 0 && ulimit -f 0 && exec \"$0\" {args}");
        Process::spawn(&rig.domain, rig.shell(&line))
            .exits(1)
            .err_says("error: ");
    }
    rig.domain.assert_empty();
    // What they have not made keeps no process from starting.
    let sim = rig.sim(1, "");
    let bridge = rig.bridge(1);
    end_all([bridge, sim]);
}

#[test]
fn a_bridge_whose_messages_no_longer_fit_into_their_file_flies_on() {
    let rig = sandbox();
    let sim = rig.sim(1, "");
    rig.write("bridge.toml", FOR_SLOW_MACHINES);
    let line = "exec \"$0\" bridge --port dsp-1 2>messages.txt";
    let bridge = Process::spawn(&rig.domain, rig.shell(line));
    let mut watch = rig.watch(1);
    watch.until_ready();
    let limits = Rlimit {
        current: Some(0),
        maximum: getrlimit(Resource::Fsize).maximum,
    };
    let pid = Pid::from_raw(bridge.id() as i32);
    prlimit(pid, Resource::Fsize, limits).unwrap();
    // Each of them is a line in the audit trail.
    for request in ["start", "takeoff --altitude 3", "land", "stop"] {
        rig.run(request, 0);
    }
    drop(watch);
    end(bridge, Signal::TERM);
    end(sim, Signal::TERM);
}
