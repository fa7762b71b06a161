//! What only root can play in full, because it makes namespaces or becomes somebody else: `.ci/as-user` runs these
//! tests as root, too.

use std::fs::{self, Permissions};
use std::os::unix::fs::{PermissionsExt, chown};
use std::os::unix::process::CommandExt;

use ril_tests::Process;
use ril_tests::languages::skip;
use ril_tests::process::Signal;

use crate::common::{end, sandbox, says};
use crate::doctor::{examine, texts, troubles};

/// The user and group `nobody`.
const NOBODY: u32 = 65_534;

#[test]
fn a_process_in_namespaces_of_its_own_is_told() {
    const UNSHARE: &str = "exec unshare --user --map-root-user --pid --fork --kill-child \
                           --mount-proc --time --monotonic 500";
    let rig = sandbox();
    let start = |command: &str| {
        let line = format!("{UNSHARE} {command}");
        Process::spawn(&rig.domain, rig.shell(&line))
    };
    let probe = start("true").wait_exit();
    if probe.code() != Some(0) {
        return skip(
            "a process in namespaces of its own",
            "none can be made here",
        );
    }
    let mut status = start("\"$0\" run status");
    status.wait_for_text("ready");
    assert_eq!(troubles(&rig, "", 8), ["other-time-namespace"]);
    let text = texts(&examine(&rig, "", 8));
    let expected = "status (process 1 of another PID namespace) provides hero_telemetry";
    assert!(text.contains(expected), "{text}");
    assert!(text.contains("cannot be seen from here"), "{text}");
    status.signal_group(Signal::TERM);
    status.exits(0);
    rig.domain.assert_empty();
}

/// Another user's domain may be that of a robot in flight. It is named, and nothing is said that would end its flight.
#[test]
fn the_domain_of_another_user_is_named_and_never_to_be_removed() {
    if !rustix::process::geteuid().is_root() {
        return skip("another user's domain", "only root makes one");
    }
    let rig = sandbox();
    let root = rig.domain.root().to_owned();
    fs::create_dir(&root).unwrap();
    chown(&root, Some(NOBODY), None).unwrap();
    for (args, code) in [("robots", 1), ("status", 1), ("land", 1), ("doctor", 8)] {
        let finished = rig.run(args, code);
        let said: Vec<String> = [finished.stdout.clone(), finished.stderr.clone()].concat();
        assert!(says(&said, "belongs to user 65534"), "{args}: {said:#?}");
        assert!(says(&said, "run as that user"), "{args}: {said:#?}");
        for wrong in ["remove it", "not safe", "no robot", "chmod"] {
            assert!(!says(&said, wrong), "{args}: {said:#?}");
        }
    }
    fs::remove_dir(&root).unwrap();
}

#[test]
fn the_bridge_of_another_user_is_named_by_its_lock() {
    let (ours, theirs) = (sandbox(), sandbox());
    let mut command = ours.command(["--version"]);
    fs::set_permissions(ours.folder(), Permissions::from_mode(0o755)).unwrap();
    let may_run = rustix::process::geteuid().is_root()
        && command
            .uid(NOBODY)
            .gid(NOBODY)
            .output()
            .is_ok_and(|output| output.status.success());
    if !may_run {
        return skip(
            "the bridge of another user",
            "`ril` cannot be run as another user here",
        );
    }
    let sim = ours.sim(1, "");
    let first = ours.bridge(1);
    ours.watch(1).until_ready();
    let port = ours.folder().join("dsp-1");
    let device = fs::canonicalize(&port).unwrap();
    fs::set_permissions(device, Permissions::from_mode(0o666)).unwrap();
    fs::set_permissions(theirs.folder(), Permissions::from_mode(0o755)).unwrap();

    let mut command = theirs.command(["bridge", "--port"]);
    command.arg(&port).uid(NOBODY).gid(NOBODY);
    let mut second = Process::spawn(&theirs.domain, command);
    second.wait_for_text(&format!("is in use by `ril` (process {})", first.id()));
    end(second, Signal::TERM);
    end(first, Signal::TERM);
    end(sim, Signal::TERM);
}

/// Enters a namespace in which it may mount.
const MOUNTS: &str = "exec unshare --user --map-root-user --mount";

#[test]
fn a_bridge_that_cannot_see_who_uses_the_port_says_so_and_leaves_it_alone() {
    let rig = sandbox();
    let sim = rig.sim(1, "");
    for (mount, name) in [
        ("mount -t tmpfs tmpfs /proc", "no /proc"),
        // Of a namespace that has ended meanwhile: it shows nobody, this process neither.
        (
            "unshare --pid --fork mount -t proc proc /proc",
            "another /proc",
        ),
    ] {
        let start = |command: &str| {
            let line = format!("{MOUNTS} sh -c '{mount} && exec \"$0\" {command}' \"$0\"");
            Process::spawn(&rig.domain, rig.shell(&line))
        };
        if start("--version").wait_exit().code() != Some(0) {
            skip(name, "it cannot be mounted here");
            continue;
        }
        let mut bridge = start("run bridge --port dsp-1");
        let said = bridge.wait_for_text("dsp-1 is not opened").text;
        assert!(said.contains("/proc is not mounted here"), "{said}");
        assert!(!said.contains("in use"), "{said}");
        let finished = end(bridge, Signal::TERM);
        assert!(!says(&finished.stderr, "port open"), "{finished:#?}");
    }
    // The DSP was not disturbed.
    let bridge = rig.bridge(1);
    rig.watch(1).until_ready();
    end(bridge, Signal::TERM);
    end(sim, Signal::TERM);
}

/// There it has two numbers, its own and that by which `/proc` knows it.
#[test]
fn a_bridge_with_the_proc_of_another_namespace_does_not_take_itself_for_the_port_s_user() {
    let rig = sandbox();
    let start = |command: &str| {
        let line =
            format!("exec unshare --user --map-root-user --pid --fork --kill-child {command}");
        Process::spawn(&rig.domain, rig.shell(&line))
    };
    if start("true").wait_exit().code() != Some(0) {
        return skip("the /proc of another namespace", "none can be made here");
    }
    let sim = rig.sim(1, "");
    let mut inside = start("\"$0\" run bridge --port dsp-1");
    inside.wait_for_text("port open");
    rig.watch(1).until_ready();
    let mut outside = rig.start("run bridge --robot 2 --port dsp-1");
    let said = outside.wait_for_text("is in use by `ril` (process ").text;
    let (_, holder) = said.split_once("(process ").unwrap();
    let (holder, _) = holder.split_once(')').unwrap();
    let holder = fs::read_to_string(format!("/proc/{holder}/status")).unwrap();
    let parent = format!("PPid:\t{}\n", inside.id());
    assert!(holder.contains(&parent), "{said}: {holder}");
    end(outside, Signal::TERM);
    inside.signal_group(Signal::TERM);
    inside.exits(0);

    let outside = rig.bridge(1);
    rig.watch(1).until_ready();
    let mut inside = start("\"$0\" run bridge --robot 2 --port dsp-1");
    inside.wait_for_text(&format!("is in use by `ril` (process {})", outside.id()));
    inside.signal_group(Signal::TERM);
    inside.exits(0);
    end(outside, Signal::TERM);
    end(sim, Signal::TERM);
}
