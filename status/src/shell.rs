//! The process around the core: ports, clock, and the one wait. It decides nothing.
//!
//! One thread sleeps until telemetry, a subscriber, a signal or the core's next deadline wakes it. Then it services every
//! source that may have woken it. It never touches a file: each log has a thread of its own for that.

mod log_thread;
mod messages;
#[cfg(test)]
mod tests;

use std::time::Duration;

use ipc_types::payload::{DspTelemetry, HeroTelemetry};
use ipc_types::waiter::SAFETY_BOUND;
use ipc_types::{
    Domain, Ipc, MonotonicNs, Place, Publisher, RobotId, Subscriber, Waiter, wake_promptly,
};
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::notify::Notifier;
use runtime::signal::Termination;

use crate::config::Config;
use crate::core::{InputCounts, Status, Summary};
use crate::estimator::Estimator;
use crate::log::store::{FileStore, Store};
use log_thread::{END_TIMEOUT, LogThreads};

/// The process with its surroundings.
pub struct Shell {
    status: Status,
    log_threads: LogThreads,
    /// How long the end waits for the disks.
    end_timeout: Duration,
    input: Subscriber<DspTelemetry>,
    output: Publisher<HeroTelemetry>,
    ipc: Ipc,
    notifier: Notifier,
    next_watchdog: Option<MonotonicNs>,
    /// Whether the last attempt to receive failed, so that a series of failures is logged once.
    input_failing: bool,
}

impl Shell {
    /// Joins the robot's shared memory in `domain` and starts the logs of `config`.
    ///
    /// # Errors
    /// Shared memory cannot be used, or another process is the status of this robot. Logs that cannot be created are
    /// no error: telemetry matters more.
    pub fn open(
        domain: &Domain,
        robot: RobotId,
        config: &Config,
        notifier: Notifier,
    ) -> Result<Shell, Failure> {
        Shell::open_with(domain, robot, config, notifier, || FileStore)
    }

    /// The same with `estimator` in the place of the configured one.
    #[must_use]
    pub fn with_estimator(mut self, estimator: Box<dyn Estimator + Send>) -> Shell {
        self.status = self.status.with_estimator(estimator);
        self
    }

    /// The same with another place for the files.
    fn open_with<S>(
        domain: &Domain,
        robot: RobotId,
        config: &Config,
        notifier: Notifier,
        store: impl FnMut() -> S,
    ) -> Result<Shell, Failure>
    where
        S: Store + Send + 'static,
        S::File: Send,
    {
        let ipc = Ipc::join(domain, robot, "status")
            .or_fail_with(ExitCode::Internal, "status cannot join the shared memory")?;
        let output = ipc
            .publisher::<HeroTelemetry>()
            .or_fail_with(ExitCode::Internal, "status cannot publish telemetry")?;
        let input = ipc
            .subscriber::<DspTelemetry>()
            .or_fail_with(ExitCode::Internal, "status cannot receive telemetry")?;
        // Last, so that a process that cannot start leaves no files.
        let (logs, log_threads) = LogThreads::start(&config.log, robot, store);
        let now = MonotonicNs::now();
        let mut status = Status::new(config.calibration.clone(), logs);
        if let Some(estimator) = config.estimator.build() {
            status = status.with_estimator(estimator);
        }
        Ok(Shell {
            status,
            log_threads,
            end_timeout: END_TIMEOUT,
            input,
            output,
            ipc,
            next_watchdog: notifier.watchdog_period().map(|period| now + period),
            notifier,
            input_failing: false,
        })
    }

    /// Works until `termination` is requested; then waits, for a bounded time, until the logs have written what they
    /// have in memory.
    ///
    /// # Errors
    /// The operating system cannot wait any more.
    pub fn run(mut self, termination: &Termination) -> Result<Summary, Failure> {
        let result = self.work(termination);
        self.notifier.stopping();
        let mut summary = self.status.finish();
        self.log_events();
        // Frees the place in shared memory before the disks have answered.
        drop((self.input, self.output, self.ipc));
        self.log_threads.end(&mut summary.logs, self.end_timeout);
        result.map(|()| summary)
    }

    fn work(&mut self, termination: &Termination) -> Result<(), Failure> {
        let waiter = Waiter::new();
        // Not for the logs' threads, which began before.
        wake_promptly(Place::Provider);
        self.notifier.ready();
        tracing::info!(robot = %self.ipc.robot(), "ready");
        while !termination.requested() {
            self.step();
            let timeout = self.deadline().since(MonotonicNs::now());
            // A signal ends the wait, unless it comes just before it begins; then the safety bound ends it.
            waiter
                .wait(
                    &[&self.input, &self.output],
                    Some(timeout.min(SAFETY_BOUND)),
                )
                .or_fail(ExitCode::Internal)?;
        }
        // What was published before the end still counts.
        self.step();
        Ok(())
    }

    /// Services every source that may have woken us, and does what is due.
    fn step(&mut self) {
        self.output.tend();
        self.drain();
        let now = MonotonicNs::now();
        let losses = self.input.losses();
        let counts = InputCounts {
            received: losses.received,
            lost: losses.lost,
            publisher_restarts: losses.publisher_restarts,
        };
        self.status.count(counts, now);
        self.status.on_time(now);
        self.log_events();
        if self.next_watchdog.is_some_and(|due| due <= now) {
            self.next_watchdog = self.notifier.watchdog_period().map(|period| now + period);
            self.notifier.watchdog();
        }
    }

    /// Publishes every sample that has been received, each before it is logged.
    fn drain(&mut self) {
        let (status, output) = (&mut self.status, &mut self.output);
        let result = self.input.drain(|dsp| {
            let now = MonotonicNs::now();
            let published = output.publish(|hero| *hero = status.translate(dsp, now));
            let outcome = published
                .map(|_sequence| ())
                .map_err(|error| error.to_string());
            status.record(dsp, outcome, now);
        });
        let was_failing = std::mem::replace(&mut self.input_failing, result.is_err());
        if let Err(error) = result
            && !was_failing
        {
            tracing::warn!(%error, "telemetry cannot be received");
        }
    }

    fn deadline(&self) -> MonotonicNs {
        [self.status.deadline(), self.next_watchdog]
            .into_iter()
            .flatten()
            .fold(MonotonicNs(u64::MAX), MonotonicNs::min)
    }

    fn log_events(&mut self) {
        for event in self.status.take_events() {
            messages::log(&event);
        }
    }
}
