//! Groups of operator's commands that end at the same moment with their requests open: does the bridge live on, and does it
//! hold any more than before?

use std::thread;
use std::time::Duration;

use dsp_sim::random::Random;
use ril_tests::process::Signal;

use crate::outcome::Outcome;
use crate::plan::Plan;
use crate::site::{Site, Survivors, count_lines};

/// What the clients ask. Each `--preempt` replaces the path before it, so that many of them have a request open.
const REQUESTS: [&str; 4] = [
    "goto 37.4300,-6.0010,25 --preempt",
    "goto 37.4310,-6.0010,25 --preempt --json",
    "goto 37.4300,-6.0010,25",
    "takeoff --altitude 5",
];

/// Greatest group: all places that a service has for clients.
const MAX_GROUP: u32 = 16;

/// Smallest group.
const MIN_GROUP: u32 = 2;

/// Age at which a group ends, ms, or its time after the first client was heard.
const AGE_MS: (f64, f64) = (10.0, 40.0);

/// The bridge warms up during one part in this many of the clients: what it holds then at most, it may hold at the end.
///
/// Half of them: the bridge keeps open what a group that died last has left until it cleans up, and the largest group may
/// come late. What leaks still grows with the other half.
const WARM_UP: u32 = 2;

/// Starts and ends clients as planned, or until `goes_on` says no, or until the bridge dies.
///
/// # Panics
///
/// When an interrupted client hangs, when a bridge that lives does not answer any more, or when something is left.
pub fn run(site: &Site, plan: &Plan, goes_on: &dyn Fn() -> bool) -> Outcome {
    let count = plan.count.unwrap_or(20_000);
    let [sim, mut bridge, mut status] = site.start_flight();
    let mut chance = Random::new(plan.seed, 0);
    let mut ended = Ended::default();
    let mut survivors: Option<Survivors> = None;
    while ended.clients < count && bridge.is_running() && goes_on() {
        let size = MIN_GROUP + (chance.next_u64() % u64::from(MAX_GROUP - MIN_GROUP + 1)) as u32;
        end_a_group(site, &mut chance, size, &mut ended);
        if ended.clients <= count / WARM_UP || survivors.is_none() {
            // Whatever it says: it is the occasion to clean up, and the bridge may have died by now.
            site.finish("echo dsp --count 1");
            if !bridge.is_running() {
                break;
            }
            let survivors = survivors.get_or_insert_with(|| Survivors::of([("bridge", &bridge)]));
            survivors.warm_up();
        }
    }
    let mut outcome = Outcome::default();
    outcome.cell("clients", ended.clients);
    outcome.cell("groups", ended.groups);
    outcome.cell("killed", ended.killed);
    outcome.cell("ended in order", ended.in_order);
    let link_losses = count_lines(&mut bridge, " link from=\"up\"");
    outcome.cell("link lost", link_losses);
    outcome.require(
        link_losses == 0,
        "the link, which no process has touched, was lost",
    );
    // The buffer of status holds more than half a second of samples.
    let losses = status.lines().iter().filter_map(|line| {
        let is_it = line.text.contains("samples were lost on the way");
        let (_, total) = line.text.rsplit_once("total=").filter(|_| is_it)?;
        total.parse::<u64>().ok()
    });
    outcome.cell("samples lost", losses.max().unwrap_or_default());
    if !bridge.is_running() {
        outcome.require(false, "the bridge DIED");
        drop((status, bridge, sim));
        site.domain.sweep();
        return outcome;
    }
    if let Some(survivors) = survivors {
        // Whatever it says: a second of telemetry is the occasion.
        let took = survivors.wait_until_flat(|| _ = site.finish("echo dsp --duration 1s"), || true);
        survivors.report(&mut outcome);
        outcome.require(took.is_some(), "the bridge holds more descriptors");
    }
    outcome.require(site.lands(), "NOT landed");
    for request in [
        "status",
        "stop",
        "start",
        "takeoff --altitude 5",
        "land",
        "stop",
    ] {
        site.ask(request);
    }
    site.end([sim, bridge, status], false);
    outcome
}

/// How clients ended.
#[derive(Default)]
struct Ended {
    clients: u32,
    groups: u32,
    killed: u32,
    /// Interrupted clients that ended by themselves, with an exit code.
    in_order: u32,
}

fn end_a_group(site: &Site, chance: &mut Random, size: u32, ended: &mut Ended) {
    let mut group: Vec<_> = (0..size)
        .map(|_| {
            let request = chance.next_u64() % REQUESTS.len() as u64;
            site.start(REQUESTS[request as usize])
        })
        .collect();
    // Half of the groups end as they are served, the others while they start and later.
    if chance.next_u64().is_multiple_of(2) {
        group[0].wait_for_line(|_| true);
    }
    let (least, most) = AGE_MS;
    let age_ms = least + (most - least) * chance.uniform();
    // The moment is what is tried here, not something that is waited for.
    thread::sleep(Duration::from_secs_f64(age_ms / 1e3));
    let signal = match chance.next_u64() % 2 {
        0 => Signal::KILL,
        _ => Signal::INT,
    };
    group.iter().for_each(|client| client.signal(signal));
    for client in &mut group {
        let is_in_order = client.wait_exit().code().is_some();
        ended.in_order += u32::from(signal == Signal::INT && is_in_order);
    }
    ended.clients += size;
    ended.groups += 1;
    ended.killed += if signal == Signal::KILL { size } else { 0 };
}
