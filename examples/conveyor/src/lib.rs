//! A conveyor belt: [`Drive`] publishes how it runs and serves requests for its speed, [`Counter`] reads where it is.
//! [`Motor`] is the decision, without ports.

use std::time::Duration;

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::RequestReport;
use ipc_types::{Ipc, MonotonicNs, OpenError, Publisher, Server, Source, Subscriber, Waiter};
use ipc_types::{request, shared_struct, topic};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

shared_struct! {
    /// How the belt runs.
    pub struct Belt("conveyor.Belt.v1") = 32 {
        /// Counts the samples of this publisher from 1.
        pub sequence: u64,
        /// When the publisher began, host monotonic ns.
        pub epoch_ns: u64,
        /// Of the belt [m/s].
        pub speed_mps: f64,
        /// How far it has moved since the drive began [m].
        pub moved_m: f64,
    }
}
topic!(Belt, "conveyor/belt");

shared_struct! {
    /// Sets the speed of the belt.
    pub struct SetSpeed("conveyor.SetSpeed.v1") = 16 {
        /// Chosen by the sender, not 0, never used before by any sender; every report repeats it.
        pub request_id: u64,
        /// Of the belt, 0 to 3 [m/s].
        pub speed_mps: f64,
    }
}
request!(SetSpeed, "conveyor/speed");

/// How often the drive publishes.
pub const PERIOD: Duration = Duration::from_millis(20);

/// Moves the belt.
#[derive(Debug, Default)]
pub struct Motor {
    speed_mps: f64,
    moved_m: f64,
    last: Option<MonotonicNs>,
}

impl Motor {
    /// The report about a request.
    pub fn set(&mut self, request: &SetSpeed) -> RequestReport {
        if !(0.0..=3.0).contains(&request.speed_mps) {
            return RequestReport::new(Stage::Refused, Reason::OutOfRange);
        }
        self.speed_mps = request.speed_mps;
        RequestReport::new(Stage::Done, Reason::None)
    }

    /// Where the belt is `now`.
    pub fn step(&mut self, now: MonotonicNs) -> Belt {
        let passed = self.last.map_or(Duration::ZERO, |last| now.since(last));
        self.last = Some(now);
        self.moved_m += self.speed_mps * passed.as_secs_f64();
        Belt {
            speed_mps: self.speed_mps,
            moved_m: self.moved_m,
            ..Belt::default()
        }
    }
}

/// The motor with its ports.
pub struct Drive {
    motor: Motor,
    belt: Publisher<Belt>,
    speed: Server<SetSpeed>,
}

impl Drive {
    /// Opens the ports.
    pub fn open(ipc: &Ipc) -> std::result::Result<Drive, OpenError> {
        Ok(Drive {
            motor: Motor::default(),
            belt: ipc.publisher()?,
            speed: ipc.server()?,
        })
    }

    /// Works until `is_over`, which is asked after each period.
    pub fn run(&mut self, mut is_over: impl FnMut() -> bool) -> Result<()> {
        let waiter = Waiter::new();
        let mut next = MonotonicNs::now();
        while !is_over() {
            let mut answers = Vec::new();
            let motor = &mut self.motor;
            (self.speed).drain(|ticket, request| answers.push((ticket, motor.set(request))))?;
            for (ticket, report) in answers {
                // Its client may be gone.
                let _ = self.speed.report(ticket, &report);
            }
            let now = MonotonicNs::now();
            if now >= next {
                next = now + PERIOD;
                let sample = motor.step(now);
                self.belt.publish(|slot| *slot = sample)?;
            }
            let mut sources: [((), &mut dyn Source); 2] =
                [((), &mut self.belt), ((), &mut self.speed)];
            waiter.wait(&mut sources, Some(next.since(MonotonicNs::now())))?;
        }
        Ok(())
    }
}

/// Counts what passed on the belt.
pub struct Counter {
    belt: Subscriber<Belt>,
    moved_m: f64,
}

impl Counter {
    /// Reads the belt.
    pub fn open(ipc: &Ipc) -> std::result::Result<Counter, OpenError> {
        Ok(Counter {
            belt: ipc.subscriber()?,
            moved_m: 0.0,
        })
    }

    /// Waits until the belt has moved so far, over restarts of its drive, and says how many samples that took.
    pub fn wait_for_metres(&mut self, metres: f64, limit: Duration) -> Result<u64> {
        let mut before_m = 0.0;
        while self.moved_m < metres {
            if !self.belt.wait(limit)?.is_ready() {
                return Err("the belt stands still".into());
            }
            let moved_m = &mut self.moved_m;
            self.belt.drain(|sample| {
                // What is no number, or goes back, is a fault of the drive or its new beginning.
                if sample.moved_m > before_m && sample.moved_m.is_finite() {
                    *moved_m += sample.moved_m - before_m;
                }
                before_m = if sample.moved_m.is_finite() {
                    sample.moved_m
                } else {
                    before_m
                };
            })?;
        }
        Ok(self.belt.losses().received)
    }
}
