//! Clients that send one request after the other without a pause: an operator must get through.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::MovementData;
use ipc_types::{Domain, Ipc, RobotId};

use crate::outcome::{Outcome, Times};
use crate::plan::Plan;
use crate::site::{Site, is_done};

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

/// Those of them that are done as soon as they are answered.
const AT_ONCE: [&str; 3] = ["start", "goto 37.4112,-6.0010,25 --no-wait", "stop"];

/// Flies while others flood the bridge.
///
/// # Panics
///
/// When an order hangs, when a flooder cannot send, or when something is left.
pub fn run(site: &Site, plan: &Plan, goes_on: &dyn Fn() -> bool) -> Outcome {
    let chain = site.start_chain();
    let over = Arc::new(AtomicBool::new(false));
    let answered = Arc::new(AtomicU64::new(0));
    let flooders: Vec<_> = (0..FLOODERS)
        .map(|number| flooder(&site.domain, number as u64, &over, &answered))
        .collect();
    let mut outcome = Outcome::default();
    let (mut done, mut answers) = (0, Times::default());
    for _ in 0..plan.count.unwrap_or(20) {
        for order in ORDERS {
            if !goes_on() {
                break;
            }
            let started = Instant::now();
            let finished = site.finish(order);
            let is_done = is_done(order, &finished);
            if is_done && AT_ONCE.contains(&order) {
                answers.push(started.elapsed());
            }
            done += u32::from(is_done);
            let (code, words) = (finished.code(), finished.stderr.join(", "));
            outcome.require(is_done, format!("{order}: {code:?} {words}"));
        }
    }
    over.store(true, Ordering::Relaxed);
    for flooder in flooders {
        flooder.join().expect("it ends in order");
    }
    outcome.cell("requests of the flood", answered.load(Ordering::Relaxed));
    outcome.cell("orders done", done);
    outcome.cell("answered", answers);
    site.end(chain, true);
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
        let mut own = 0;
        while !over.load(Ordering::Relaxed) {
            // As many as there is room for. What does not fit now does after the answers.
            while client.send(&MovementData::take_off(id, f64::NAN)).is_ok() {
                id += 1;
            }
            client.wait(FULL_LIMIT).expect("a wait");
            client.drain(|report| {
                let end = (report.stage(), report.reason());
                let refusals = [Reason::NotFinite, Reason::TooManyRequests];
                let is_refusal = |reason| refusals.contains(&reason);
                assert!(
                    end.0 == Some(Stage::Refused) && end.1.is_some_and(is_refusal),
                    "{end:?}"
                );
                answered.fetch_add(1, Ordering::Relaxed);
                own += 1;
            });
        }
        let sent = id - ((number + 1) << 48);
        assert_eq!(own + client.outstanding() as u64, sent, "none is missing");
    })
}
