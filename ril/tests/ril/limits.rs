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

/// With too little memory an allocation would end the process in silence; without a descriptor the error says of what.
#[test]
fn a_process_with_a_limit_that_is_too_low_names_it() {
    let rig = sandbox();
    for (limit, args, says) in [
        ("-d 8000", "run bridge --port absent", "and needs 16777216"),
        ("-d 8000", "start", "and needs 16777216"),
        ("-n 30", "run bridge --port absent", "30"),
        ("-n 146", "run bridge --port absent", "146"),
    ] {
        let line = format!("ulimit -c 0 && ulimit {limit} && exec \"$0\" {args}");
        Process::spawn(&rig.domain, rig.shell(&line))
            .exits(1)
            .err_says(says);
    }
    rig.domain.assert_empty();
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
