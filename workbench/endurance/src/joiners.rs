//! Processes that are stopped while they start: they may hold whatever a start needs, and must keep no other process waiting.

use std::collections::VecDeque;
use std::thread;
use std::time::Duration;

use dsp_sim::random::Random;
use ril_tests::Process;
use ril_tests::process::Signal;

use crate::outcome::Outcome;
use crate::plan::Plan;
use crate::site::Site;

/// What is stopped.
const JOINERS: [&str; 5] = [
    "echo hero --json",
    "status",
    "run bridge --port dsp-1",
    "run status",
    "takeoff --altitude 5",
];

/// Oldest age at which a joiner is stopped.
const START_UP: Duration = Duration::from_millis(20);

/// How many of them are there at a time. Each may keep one of the places that a service has for clients and subscribers.
const STOPPED: usize = 6;

/// Stops joiners as planned, or until `goes_on` says no.
///
/// # Panics
///
/// When a process is kept waiting, or when something is left.
pub fn run(site: &Site, plan: &Plan, goes_on: &dyn Fn() -> bool) -> Outcome {
    let chain = site.start_chain();
    let joiners = plan.count.unwrap_or(2000);
    let mut chance = Random::new(plan.seed, 0);
    let mut moment = |span: Duration| {
        // The moment is what is tried here, not something that is waited for.
        thread::sleep(span.mul_f64(chance.uniform()));
        chance.next_u64()
    };
    let mut stopped: VecDeque<Process> = VecDeque::new();
    let (mut count, mut done, mut interrupted) = (0, 0, 0);
    while count < joiners && goes_on() {
        let args = JOINERS[count as usize % JOINERS.len()];
        let joiner = site.start(args);
        moment(START_UP);
        joiner.signal(Signal::STOP);
        stopped.push_back(joiner);
        count += 1;
        for args in ["status", "echo hero --count 1"] {
            site.ask(args);
        }
        // Whatever it finds; it takes note of those that are stopped.
        let doctor = site.finish("doctor").code();
        assert!(matches!(doctor, Some(0 | 8)), "{doctor:?}");
        done += 3;
        for (args, signal) in [
            ("echo hero", Signal::INT),
            ("run status --robot 2", Signal::TERM),
        ] {
            let mut process = site.start(args);
            moment(2 * START_UP);
            process.signal(signal);
            process.wait_exit();
            interrupted += 1;
        }
        if stopped.len() > STOPPED {
            let oldest = stopped.pop_front().expect("there are some");
            // One in two goes on where it was, the other never does.
            if moment(Duration::ZERO).is_multiple_of(2) {
                oldest.signal(Signal::CONT);
                oldest.signal(Signal::TERM);
            } else {
                oldest.signal(Signal::KILL);
            }
            let mut oldest = oldest;
            oldest.wait_exit();
        }
    }
    drop(stopped);
    site.end(chain, true);
    let mut outcome = Outcome::default();
    outcome.cell("stopped", count);
    outcome.cell("commands done meanwhile", done);
    outcome.cell("ended at a signal meanwhile", interrupted);
    outcome
}
