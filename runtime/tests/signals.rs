//! A signal that comes while its handlers are being installed. A process of its own, because signals have one owner.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use runtime::signal::Termination;
use rustix::process::{Signal, getpid, kill_process};

/// Enough that several signals come in the middle.
const ROUNDS: usize = 10_000;

/// Longest time from the beginning of a round to its signal, ns.
const SPAN_NS: usize = 40_000;

#[test]
fn a_signal_that_comes_while_the_handlers_are_installed_is_not_forgotten() {
    // From here on no signal ends this process.
    drop(Termination::install().unwrap());
    let begun = Arc::new(AtomicUsize::new(0));
    let sent = Arc::new(AtomicUsize::new(0));
    let sender = thread::spawn({
        let (begun, sent) = (Arc::clone(&begun), Arc::clone(&sent));
        move || {
            for round in 1..=ROUNDS {
                while begun.load(Ordering::Acquire) < round {
                    thread::yield_now();
                }
                let begin = Instant::now();
                let wait = Duration::from_nanos((round * 7919 % SPAN_NS) as u64);
                while begin.elapsed() < wait {}
                kill_process(getpid(), Signal::INT).unwrap();
                sent.store(round, Ordering::Release);
            }
        }
    });
    let mut seen = 0;
    for round in 1..=ROUNDS {
        begun.store(round, Ordering::Release);
        let termination = Termination::install().unwrap();
        while sent.load(Ordering::Acquire) < round {
            thread::yield_now();
        }
        // One that came before the first handler is nobody's.
        if termination.signal().is_some() {
            assert!(termination.requested(), "round {round}");
            seen += 1;
        }
    }
    sender.join().unwrap();
    assert!(seen > 0, "all signals came too early");
}
