//! Programs in C and Python that order a path and are killed in the middle of it, or are stopped while they have a
//! lease: the bridge ends the path as *sender-lost*, and has the helicopter hover, within one second.

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{DspPathState, Functionality};
use ipc_types::payload::ModuleState;
use ril_tests::languages::{Compiler, python};
use ril_tests::process::Signal;
use ril_tests::{PtyFolder, Sandbox};

/// Simulated seconds for one of the host.
const SPEED: u32 = 10;

/// How long the helicopter may fly without the sender.
const HOVERS_WITHIN: Duration = Duration::from_secs(1);

/// The lease of those that are stopped, ms.
const LEASE_MS: u32 = 500;

/// A path that outlasts the test, and reports for as long as it is flown. The argument is the lease, ms, or 0.
const IN_C: &str = r#"
#include <stdio.h>
#include <stdlib.h>
#include <hero_ril.h>

int main(int argc, char **argv) {
    int lease_ms = argc > 1 ? atoi(argv[1]) : 0;
    hero_ril_robot *robot = NULL;
    hero_ril_client *client = NULL;
    hero_ril_waypoint far_away = {37.4290, -6.0010, 25.0};
    RequestReport report = {0};
    uint64_t id;
    if (hero_ril_join(NULL, 1, "killed", &robot) != HERO_RIL_OK || hero_ril_client_open(robot, &client) != HERO_RIL_OK ||
        hero_ril_when_lost(client, 0, lease_ms) != HERO_RIL_OK ||
        hero_ril_go_to(client, &far_away, 1, 0, &id) != HERO_RIL_OK) {
        fprintf(stderr, "%s\n", hero_ril_last_error());
        return 1;
    }
    while (!hero_ril_is_final(&report)) {
        hero_ril_next_report(client, id, 50, &report);
    }
    fprintf(stderr, "%s\n", hero_ril_reason_name(report.reason));
    return 1;
}
"#;

/// As [`IN_C`].
const IN_PYTHON: &str = r#"
import sys
import hero_ril

with hero_ril.Robot(1, name="killed") as robot:
    lease_s = int(sys.argv[1]) / 1000
    if lease_s:
        robot.when_lost(lease_s=lease_s)
    request = robot.go_to((37.4290, -6.0010, 25.0))
    while request.final is None:
        request.next(timeout=0.05)
    sys.exit(str(request.final))
"#;

/// The program that `command` makes is lost in the middle of its path, in each of the two ways.
fn ends_with_its_sender(command: impl Fn() -> Command) {
    let rig = Sandbox::of(super::ril());
    let robot = rig.start_robot(1, SPEED);
    rig.run("start", 0);
    rig.run("takeoff 5m", 0);
    let mut states = rig.watch(1);
    let mut bridge = robot.bridge;
    for (signal, lease_ms) in [(Signal::KILL, 0), (Signal::STOP, LEASE_MS)] {
        let mut with_lease = command();
        with_lease.arg(lease_ms.to_string());
        let program = rig.spawn(with_lease);
        states.until("it flies", |state| {
            follows(state) && state.movement.waypoints_sent == 1
        });
        // Longer than a lease: as long as the program lives, it renews its path.
        let begin = MonotonicNs::now();
        let flies_on = begin + Duration::from_millis(2 * u64::from(lease_ms));
        let flown = states.until("it flies on", |state| {
            !follows(state) || MonotonicNs(state.published_ns) >= flies_on
        });
        assert!(follows(&flown), "{flown:?}");
        let lost = MonotonicNs::now();
        program.signal(signal);
        let hovers = states.until("it hovers", |state| {
            !follows(state) && state.link.dsp_path() == Some(DspPathState::Empty)
        });
        let within = HOVERS_WITHIN + Duration::from_millis(lease_ms.into());
        let took = MonotonicNs(hovers.published_ns).since(lost);
        assert!(took <= within, "{signal:?}: {took:?}");
        bridge.wait_for_text("sender-lost");
        assert!(
            hovers.imi_error == 0 && hovers.blocked == 0,
            "started: {hovers:?}"
        );
        rig.kill(program);
    }
    bridge.end();
    let mut status = robot.status;
    status.signal(Signal::TERM);
    status.wait_status();
    robot.sim.end();
}

fn follows(state: &ModuleState) -> bool {
    state.functionality() == Some(Functionality::FollowingPath)
}

#[test]
fn the_path_of_a_program_in_c_that_is_killed_or_hangs_ends_within_a_second() {
    let Some(compiler) = super::or_skip("C", Compiler::c()) else {
        return;
    };
    let folder = PtyFolder::new();
    let (source, program) = (folder.link("killed.c"), folder.link("killed"));
    std::fs::write(&source, IN_C).expect("a file");
    compiler.with_shared_library(source.to_str().expect("a path in UTF-8"), &program);
    ends_with_its_sender(|| Command::new(&program));
}

#[test]
fn the_path_of_a_program_in_python_that_is_killed_or_hangs_ends_within_a_second() {
    let Some(python) = super::or_skip("Python", python()) else {
        return;
    };
    ends_with_its_sender(|| in_python(python));
}

fn in_python(python: &Path) -> Command {
    let mut command = Command::new(python);
    command.args(["-u", "-c", IN_PYTHON]);
    command
}
