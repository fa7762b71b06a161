//! Shown ages against the true ones, by the robot's own stamps: the station shows when a sample was received in its own clock,
//! and how far that may be from the truth. The robot's clock is ahead by a known time.

use std::collections::HashMap;

use ipc_types::payload::{HeroTelemetry, RelayLink};
use ipc_types::{MonotonicNs, Wake};
use ril_tests::process::{Stream, WAIT_LIMIT};
use ril_tests::sandbox::TopicWatch;
use ril_tests::{Process, Sandbox};

use super::site::AHEAD_S;

/// A sample as the station has it.
#[derive(Clone, Copy, Debug)]
pub struct Shown {
    /// Number that the robot's bridge gave it.
    pub number: u64,
    /// When it was received from the DSP, as the station shows it.
    pub received: MonotonicNs,
    /// When it came to the observer at the station.
    pub came: MonotonicNs,
    /// How far `received` may be from the truth, as the station showed it at that time, s.
    pub uncertainty_s: f64,
}

/// Samples at the station, from now on.
pub struct Observer {
    telemetry: TopicWatch<HeroTelemetry>,
    links: TopicWatch<RelayLink>,
    uncertainty_s: f64,
    /// What came so far, in order.
    pub shown: Vec<Shown>,
}

impl Observer {
    /// Begins when the clocks are known.
    pub fn new(station: &Sandbox) -> Observer {
        let mut links = station.subscribe::<RelayLink>(1);
        let link = links.until("the clocks are known", |link| link.clock_valid == 1);
        Observer {
            telemetry: station.subscribe(1),
            links,
            uncertainty_s: link.clock_uncertainty_s,
            shown: Vec::new(),
        }
    }

    /// Watches until this moment.
    pub fn watch_until(&mut self, end: MonotonicNs) {
        loop {
            let left = end.since(MonotonicNs::now());
            if left.is_zero() {
                return;
            }
            self.step(left.min(WAIT_LIMIT));
        }
    }

    /// Watches until a sample comes that was received after this moment, and returns it.
    pub fn watch_for_fresh(&mut self, moment: MonotonicNs) -> Shown {
        let from = self.shown.len();
        loop {
            let fresh = self.shown[from..]
                .iter()
                .find(|shown| shown.received >= moment);
            if let Some(fresh) = fresh {
                return *fresh;
            }
            let wake = self.step(WAIT_LIMIT);
            assert_ne!(wake, Wake::TimedOut, "nothing fresh comes");
        }
    }

    fn step(&mut self, timeout: std::time::Duration) -> Wake {
        let wake = self.telemetry.port.wait(timeout).expect("a wait");
        if let Ok(Some(link)) = self.links.port.latest() {
            self.uncertainty_s = link.clock_uncertainty_s;
        }
        let (came, uncertainty_s, shown) =
            (MonotonicNs::now(), self.uncertainty_s, &mut self.shown);
        // What cannot be received now can be by the next call, says the subscriber.
        let _ = self.telemetry.port.drain(|sample| {
            shown.push(Shown {
                number: sample.source_sequence,
                received: MonotonicNs(sample.received_ns),
                came,
                uncertainty_s,
            });
        });
        wake
    }
}

/// Writes down when the robot received each sample.
pub struct Truth(Process);

impl Truth {
    /// Begins to write.
    pub fn start(robot: &Sandbox) -> Truth {
        let mut echo = robot.start("echo dsp --json --field sequence --field received_ns");
        echo.wait_for_line(|line| line.stream == Stream::Stdout);
        Truth(echo)
    }

    /// When each sample was received, in the station's clock.
    pub fn end(self, robot: &Sandbox) -> HashMap<u64, MonotonicNs> {
        let lines = robot.kill(self.0).stdout;
        let mut truth = HashMap::new();
        for line in lines {
            let Ok(sample) = serde_json::from_str::<serde_json::Value>(&line) else {
                continue;
            };
            if let (Some(number), Some(received_ns)) =
                (sample["sequence"].as_u64(), sample["received_ns"].as_u64())
            {
                let ahead_ns = AHEAD_S.unsigned_abs() * 1_000_000_000;
                truth.insert(number, MonotonicNs(received_ns.saturating_sub(ahead_ns)));
            }
        }
        truth
    }
}

/// Shown ages against the truth.
#[derive(Clone, Copy, Debug, Default)]
pub struct Comparison {
    /// Samples of which the truth is known.
    pub compared: usize,
    /// Those that were further from the truth than the uncertainty that was shown.
    pub untrue: usize,
    /// Greatest error, s.
    pub error_s: f64,
    /// Greatest uncertainty, s.
    pub uncertainty_s: f64,
}

/// Compares what was shown with the truth.
pub fn compare(shown: &[Shown], truth: &HashMap<u64, MonotonicNs>) -> Comparison {
    let mut comparison = Comparison::default();
    for shown in shown {
        let Some(truth) = truth.get(&shown.number) else {
            continue;
        };
        let error_s = shown.received.0.abs_diff(truth.0) as f64 * 1e-9;
        comparison.compared += 1;
        comparison.untrue += usize::from(error_s > shown.uncertainty_s);
        comparison.error_s = comparison.error_s.max(error_s);
        comparison.uncertainty_s = comparison.uncertainty_s.max(shown.uncertainty_s);
    }
    comparison
}
