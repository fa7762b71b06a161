//! Clients that send one request after the other without a pause: an operator must get through.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use ipc_types::payload::MovementData;
use ipc_types::{Domain, Ipc, RobotId};

use crate::crew::{Site, end, start_chain};
use crate::spread::Spread;

/// How many clients flood the bridge; half of the places that a service has.
const FLOODERS: usize = 8;

/// How long a flooder waits for answers before it tries to send again: there are none while others have filled the queue.
const FULL_LIMIT: Duration = Duration::from_millis(10);

/// What the operator asks for.
const ORDERS: [&str; 8] = [
    "start",
    "takeoff --altitude 5",
    "goto 37.4112,-6.0010,25 --no-wait",
    "hold",
    "status",
    "land",
    "echo hero --count 50",
    "stop",
];

/// Those of them that are done as soon as they are heard.
const AT_ONCE: [&str; 3] = ["start", "goto 37.4112,-6.0010,25 --no-wait", "stop"];

/// What to do.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// How often all orders are given.
    pub rounds: u32,
}

/// What came of it.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Requests of the flood that were answered.
    pub flood: u64,
    /// Orders that were done.
    pub done: u32,
    /// From the start of a command that waits for nothing in the air until it had its answer.
    pub answer: Spread,
    /// What was said to those that were not.
    pub failures: Vec<String>,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (flood, failed) = (self.flood, self.failures.len());
        write!(
            f,
            "| {flood} answered | {} done, {failed} not | {} | ",
            self.done, self.answer
        )?;
        for failure in self.failures.iter().take(3) {
            write!(f, "{failure}; ")?;
        }
        f.write_str("|")
    }
}

/// Flies while others flood the bridge.
///
/// # Panics
///
/// When an order hangs, when a flooder cannot send, or when something is left.
pub fn run(site: &Site, plan: &Plan, goes_on: &dyn Fn() -> bool) -> Outcome {
    let [sim, bridge, status] = start_chain(site);
    let over = Arc::new(AtomicBool::new(false));
    let answered = Arc::new(AtomicU64::new(0));
    let flooders: Vec<_> = (0..FLOODERS)
        .map(|number| flooder(&site.domain, number as u64, &over, &answered))
        .collect();
    let mut outcome = Outcome::default();
    for _ in 0..plan.rounds {
        for order in ORDERS {
            if !goes_on() {
                break;
            }
            let started = Instant::now();
            let finished = site.run(order);
            match finished.code() {
                Some(0) if AT_ONCE.contains(&order) => {
                    outcome.answer.push(started.elapsed());
                    outcome.done += 1;
                }
                Some(0) => outcome.done += 1,
                // What a machine shows that stalls is old.
                Some(4) if order == "state" && !finished.stdout.is_empty() => outcome.done += 1,
                code => {
                    let words = finished.stderr.join(", ");
                    outcome.failures.push(format!("{order}: {code:?} {words}"));
                }
            }
        }
    }
    over.store(true, Ordering::Relaxed);
    for flooder in flooders {
        flooder.join().expect("it ends in order");
    }
    outcome.flood = answered.load(Ordering::Relaxed);
    [status, bridge, sim].into_iter().for_each(end);
    site.domain.sweep();
    outcome
}

/// Sends a request that is always refused, as soon as the one before it was. As many as that are of one process: they have
/// nothing in common but the processor.
fn flooder(
    domain: &Domain,
    number: u64,
    over: &Arc<AtomicBool>,
    answered: &Arc<AtomicU64>,
) -> JoinHandle<()> {
    let (domain, over, answered) = (domain.clone(), Arc::clone(over), Arc::clone(answered));
    thread::spawn(move || {
        let ipc = Ipc::join(&domain, RobotId::DEFAULT, "flooder").expect("a part");
        let mut client = ipc.client::<MovementData>().expect("a client");
        // Ids that no other client has.
        let mut id = (number + 1) << 48;
        while !over.load(Ordering::Relaxed) {
            // As many as there is room for. What does not fit now does after the answers.
            while client.send(&MovementData::take_off(id, f64::NAN)).is_ok() {
                id += 1;
            }
            client.wait(FULL_LIMIT).expect("a wait");
            client.drain(|_| {
                answered.fetch_add(1, Ordering::Relaxed);
            });
        }
    })
}
