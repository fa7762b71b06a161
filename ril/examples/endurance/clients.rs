//! Groups of operator's commands that end at the same moment with their requests open: does the bridge live on, and does it
//! hold any more than before?

use std::fmt;
use std::thread;
use std::time::{Duration, Instant};

use dsp_sim::random::Random;
use ril_tests::Process;
use ril_tests::process::Signal;

use crate::crew::{Holdings, Site, ask, end, is_alive, start_chain};

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

/// How long the remains of what was killed may take to be removed: twice what was left half made needs.
const SETTLE_LIMIT: Duration = Duration::from_secs(30);

/// What to do.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// How many clients, in all.
    pub clients: u32,
    /// Seed of sizes, requests, moments and signals.
    pub seed: u64,
}

/// What came of it.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// How many clients were started.
    pub clients: u32,
    /// In how many groups.
    pub groups: u32,
    /// How many of them were killed; the others were interrupted.
    pub killed: u32,
    /// Interrupted clients that ended by themselves, with an exit code.
    pub ended_in_order: u32,
    /// Whether the bridge is the same process, and runs.
    pub bridge_lives: bool,
    /// How often the bridge lost its link to the DSP, which nobody has touched.
    pub link_losses: usize,
    /// Samples of the bridge's that status missed; its buffer holds more than half a second of them.
    pub samples_lost: u64,
    /// Whether the helicopter could be landed as if nothing had been.
    pub flies_on: bool,
    /// What the bridge held at most while it warmed up, and at the end.
    pub holdings: Option<(Holdings, Holdings)>,
}

impl Outcome {
    /// Whether the bridge lives, flies on, and holds no more descriptors than before.
    pub fn is_clean(&self) -> bool {
        let is_flat = self
            .holdings
            .is_some_and(|(before, after)| after.descriptors <= before.descriptors);
        self.bridge_lives && self.flies_on && self.link_losses == 0 && is_flat
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let life = match self.bridge_lives {
            true => "lives",
            false => "DIED",
        };
        write!(
            f,
            "| {} in {} groups, {} killed, {} ended in order | {life}, link lost {} times, {} samples lost, {} | ",
            self.clients,
            self.groups,
            self.killed,
            self.ended_in_order,
            self.link_losses,
            self.samples_lost,
            if self.flies_on {
                "landed"
            } else {
                "NOT landed"
            },
        )?;
        match self.holdings {
            Some((before, after)) => write!(
                f,
                "{} → {} descriptors, {} → {} KiB |",
                before.descriptors, after.descriptors, before.memory_kib, after.memory_kib
            ),
            None => f.write_str("– |"),
        }
    }
}

/// Starts and ends clients as planned, or until `goes_on` says no, or until the bridge dies.
///
/// # Panics
///
/// When an interrupted client hangs, when a bridge that lives does not answer any more, or when something is left.
pub fn run(site: &Site, plan: &Plan, goes_on: &dyn Fn() -> bool) -> Outcome {
    let [sim, mut bridge, mut status] = start_chain(site);
    ask(site, "start");
    ask(site, "takeoff --altitude 5");
    let mut chance = Random::new(plan.seed, 0);
    let mut outcome = Outcome::default();
    let mut warm: Option<Holdings> = None;
    while outcome.clients < plan.clients && is_alive(bridge.id()) && goes_on() {
        let size = MIN_GROUP + (chance.next_u64() % u64::from(MAX_GROUP - MIN_GROUP + 1)) as u32;
        end_a_group(site, &mut chance, size, &mut outcome);
        let is_warming = outcome.clients <= plan.clients / WARM_UP || warm.is_none();
        if is_warming && is_alive(bridge.id()) {
            // Whatever it says: it is the occasion to clean up, and the bridge may have died by now.
            site.run("echo dsp --count 1");
            if !is_alive(bridge.id()) {
                break;
            }
            let now = Holdings::of(bridge.id());
            let most = warm.get_or_insert(now);
            most.descriptors = most.descriptors.max(now.descriptors);
            most.memory_kib = most.memory_kib.max(now.memory_kib);
        }
    }
    outcome.bridge_lives = is_alive(bridge.id());
    outcome.link_losses = said(&mut bridge, " link from=\"up\"").count();
    outcome.samples_lost = said(&mut status, "samples were lost on the way")
        .filter_map(|line| line.rsplit_once("total=")?.1.parse().ok())
        .max()
        .unwrap_or_default();
    if !outcome.bridge_lives {
        drop((status, bridge, sim));
        site.domain.sweep();
        return outcome;
    }
    let before = warm.unwrap_or_else(|| Holdings::of(bridge.id()));
    let begun = Instant::now();
    let after = loop {
        let now = Holdings::of(bridge.id());
        let is_over = begun.elapsed() > SETTLE_LIMIT;
        if now.descriptors <= before.descriptors || is_over {
            break now;
        }
        // Whatever it says: a second of telemetry is the occasion, the bridge cleans up by itself.
        site.run("echo dsp --duration 1s");
    };
    outcome.holdings = Some((before, after));
    // A path, or nothing, is under way: what the last client that was heard wanted.
    outcome.flies_on = site.run("land --preempt").code() == Some(0);
    if !outcome.flies_on {
        ask(site, "start");
        ask(site, "land --preempt");
    }
    let again = [
        "status",
        "stop",
        "start",
        "takeoff --altitude 5",
        "land",
        "stop",
    ];
    for request in again {
        ask(site, request);
    }
    [status, bridge, sim].into_iter().for_each(end);
    site.domain.assert_empty();
    outcome
}

/// What a process has printed, of that what contains `text`.
fn said<'a>(process: &'a mut Process, text: &'a str) -> impl Iterator<Item = &'a str> {
    let lines = process.lines().iter().map(|line| line.text.as_str());
    lines.filter(move |line| line.contains(text))
}

fn end_a_group(site: &Site, chance: &mut Random, size: u32, outcome: &mut Outcome) {
    let mut group: Vec<_> = (0..size)
        .map(|_| {
            let request = chance.next_u64() % REQUESTS.len() as u64;
            site.start(REQUESTS[request as usize])
        })
        .collect();
    // Half of the groups end as they are heard, the others while they start and later.
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
        outcome.ended_in_order += u32::from(signal == Signal::INT && is_in_order);
    }
    outcome.clients += size;
    outcome.groups += 1;
    outcome.killed += if signal == Signal::KILL { size } else { 0 };
}
