//! Programs in C, C++ and Python that order a path and are killed in the middle of it, or are stopped while they have a
//! lease: the bridge ends the path as *sender-lost*, and has the helicopter hover, within one second.

use std::process::Command;
use std::time::Duration;

use ipc_types::MonotonicNs;
use ipc_types::code::{DspPathState, Functionality};
use ipc_types::payload::ModuleState;
use ril_tests::process::Signal;
use ril_tests::senders::path_sender;
use ril_tests::{PtyFolder, Sandbox};

/// Simulated seconds for one of the host.
const SPEED: u32 = 10;

/// How long the helicopter may fly without the sender.
const HOVERS_WITHIN: Duration = Duration::from_secs(1);

/// The lease of those that are stopped, ms.
const LEASE_MS: u32 = 500;

/// A latitude so far away that the path outlasts the test.
const FAR_AWAY: &str = "37.4290";

/// The program in this language is lost in the middle of its path, in each of the two ways.
fn ends_with_its_sender(language: &str) {
    let folder = PtyFolder::new();
    let Some(words) = super::or_skip(language, path_sender(language, folder.path())) else {
        return;
    };
    let rig = Sandbox::of(super::ril());
    let robot = rig.start_robot(1, SPEED);
    rig.run("start", 0);
    rig.run("takeoff 5m", 0);
    let mut states = rig.watch(1);
    let mut bridge = robot.bridge;
    for (signal, lease_ms) in [(Signal::KILL, 0), (Signal::STOP, LEASE_MS)] {
        let mut command = Command::new(&words[0]);
        command
            .args(&words[1..])
            .args([FAR_AWAY, &lease_ms.to_string()]);
        let program = rig.spawn(command);
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
    ends_with_its_sender("C");
}

#[test]
fn the_path_of_a_program_in_cpp_that_is_killed_or_hangs_ends_within_a_second() {
    ends_with_its_sender("C++");
}

#[test]
fn the_path_of_a_program_in_python_that_is_killed_or_hangs_ends_within_a_second() {
    ends_with_its_sender("Python");
}
