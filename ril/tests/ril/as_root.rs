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
