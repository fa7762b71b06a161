//! Very many starts after `kill -9`: each process is killed, half of the time its successors are killed as they start, and then one
//! must be ready. Now and then everything is killed at the same moment, and very many others with it.

use std::thread;
use std::time::Duration;

use dsp_sim::random::Random;
use ipc_types::MonotonicNs;
use ril_tests::Process;
use ril_tests::process::Signal;
use ril_tests::sandbox::Witness;

use crate::outcome::{Outcome, Times};
use crate::plan::{Kind, Plan};
use crate::site::Site;

/// Longest time that a process works before it is killed: every phase of its work.
const WORK: Duration = Duration::from_millis(50);

/// Oldest age at which a process is killed while it starts, as a part of what the first start of its kind has taken.
const START_UP: f64 = 1.2;

/// Longest time that so many processes have before all are killed at once.
const CROWD_WORK: Duration = Duration::from_millis(1500);

/// What is started of each robot but the first, whose starts are counted.
const CROWD: [&str; 16] = [
    "run sim --link dsp-N --robot N",
    "run bridge --port dsp-N --robot N",
    "run status --robot N",
    "echo dsp --json --timeout 80s --robot N",
    "echo dsp --json --timeout 80s --robot N",
    "echo dsp --json --timeout 80s --robot N",
    "echo hero --json --timeout 80s --robot N",
    "echo hero --json --timeout 80s --robot N",
    "echo hero --json --timeout 80s --robot N",
    "echo state --json --timeout 80s --robot N",
    "status --robot N",
    "goto 37.4300,-6.0010,25 --robot N",
    "hold --robot N",
    "takeoff --altitude 5 --robot N",
    "topic list --robot N",
    "start --robot N",
];

/// A process, what its first start has taken, and what its starts took since.
struct Member {
    kind: Kind,
    process: Process,
    start_up: Duration,
    ready: Times,
}

/// Kills and starts as planned, or until `goes_on` says no.
///
/// # Panics
///
/// When a process does not come up, when no telemetry comes any more, or when something is left.
pub fn run(site: &Site, plan: &Plan, goes_on: &dyn Fn() -> bool) -> Outcome {
    // How many starts there are until everything is killed at once, and robots then, beside the first.
    let (together, robots) = if plan.is_short { (20, 2) } else { (250, 12) };
    let starts = plan.count.unwrap_or(10_000);
    let mut witness = Witness::new(&site.domain);
    let mut chance = Random::new(plan.seed, 0);
    let begun = MonotonicNs::now();
    let possible = Kind::ALL.into_iter().filter(|kind| kind.is_possible());
    let mut members: Vec<Member> = possible
        .map(|kind| {
            let (process, start_up) = start(site, kind);
            Member {
                kind,
                process,
                start_up,
                ready: Times::default(),
            }
        })
        .collect();
    witness.receive_after(begun);
    let (mut in_start_up, mut times, mut processes) = (0, 0, 0);
    let mut after_all = Times::default();
    for number in 1..=starts {
        if !goes_on() {
            break;
        }
        let index = chance.next_u64() as usize % members.len();
        let member = &mut members[index];
        kill(&mut chance, &mut member.process, WORK);
        while chance.uniform() < 0.5 {
            let mut starting = site.start_one(member.kind);
            kill(
                &mut chance,
                &mut starting,
                member.start_up.mul_f64(START_UP),
            );
            in_start_up += 1;
        }
        let begun = MonotonicNs::now();
        let ready;
        (member.process, ready) = start(site, member.kind);
        member.ready.push(ready);
        witness.receive_after(begun);
        for member in &mut members {
            // What they print is not needed, and would fill the pipe's reader.
            member.process.lines();
        }
        if number % together == 0 {
            times += 1;
            processes += kill_all(site, &mut chance, &mut members, robots);
            let begun = MonotonicNs::now();
            for member in &mut members {
                let ready;
                (member.process, ready) = start(site, member.kind);
                member.ready.push(ready);
                after_all.push(ready);
            }
            witness.receive_after(begun);
        }
    }
    let mut outcome = Outcome::default();
    let all = members.iter().flat_map(|member| &member.ready.0);
    outcome.cell("ready", Times(all.copied().collect()));
    outcome.cell("killed while they started", in_start_up);
    let each = members
        .iter()
        .map(|member| format!("{}: {}", member.kind.name(), member.ready));
    outcome.cell("each", each.collect::<Vec<_>>().join("; "));
    outcome.cell("times all at once", times);
    let ready = format!("{processes} processes; then ready: {after_all}");
    outcome.cell("all at once", ready);
    drop(witness);
    drop(members);
    site.domain.sweep();
    site.domain.assert_empty();
    outcome
}

/// Starts one and says how long it took to be ready.
fn start(site: &Site, kind: Kind) -> (Process, Duration) {
    let started = MonotonicNs::now();
    let process = site.start_working(kind);
    (process, MonotonicNs::now().since(started))
}

/// Kills at a random moment within `span`, which is what is tried here, not something that is waited for.
fn kill(chance: &mut Random, process: &mut Process, span: Duration) {
    thread::sleep(span.mul_f64(chance.uniform()));
    process.signal(Signal::KILL);
    process.wait_exit();
}

/// Starts very many at once, kills them and all members, and says how many those were.
fn kill_all(site: &Site, chance: &mut Random, members: &mut [Member], robots: u32) -> usize {
    let robots = 2..2 + robots;
    let args = robots.flat_map(|robot| CROWD.map(|args| args.replace('N', &robot.to_string())));
    let mut crowd: Vec<Process> = args.map(|args| site.start(&args)).collect();
    thread::sleep(CROWD_WORK.mul_f64(chance.uniform()));
    let members = members.iter_mut().map(|member| &mut member.process);
    let mut all: Vec<&mut Process> = crowd.iter_mut().chain(members).collect();
    all.iter().for_each(|process| process.signal(Signal::KILL));
    for process in &mut all {
        process.wait_exit();
    }
    all.len()
}
