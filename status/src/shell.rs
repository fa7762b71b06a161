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
use ipc_types::{Ipc, MonotonicNs, Publisher, Subscriber, WaitError, Wake};
use module_kit::process::{self, Process, Sources};
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
    /// Whether the last attempt to receive failed, so that a series of failures is logged once.
    input_failing: bool,
}

impl Shell {
    /// Opens the ports of status and starts the logs of `config`.
    ///
    /// # Errors
    /// Another process is the status of this robot, or shared memory cannot be used. Logs that cannot be created are no
    /// error: telemetry matters more.
    pub fn open(ipc: Ipc, config: &Config) -> Result<Shell, Failure> {
        Shell::open_with(ipc, config, || FileStore)
    }

    /// The same with `estimator` in the place of the configured one.
    #[must_use]
    pub fn with_estimator(mut self, estimator: Box<dyn Estimator + Send>) -> Shell {
        self.status = self.status.with_estimator(estimator);
        self
    }

    /// The same with another place for the files.
    fn open_with<S>(ipc: Ipc, config: &Config, store: impl FnMut() -> S) -> Result<Shell, Failure>
    where
        S: Store + Send + 'static,
        S::File: Send,
    {
        let output = ipc
            .publisher::<HeroTelemetry>()
            .or_fail_with(ExitCode::Internal, "status cannot publish telemetry")?;
        let input = ipc
            .subscriber::<DspTelemetry>()
            .or_fail_with(ExitCode::Internal, "status cannot receive telemetry")?;
        // Last, so that a process that cannot start leaves no files.
        let (logs, log_threads) = LogThreads::start(&config.log, ipc.robot(), store);
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
            input_failing: false,
        })
    }

    /// Works until `termination` is requested; then waits, for a bounded time, until the logs have written what they
    /// have in memory.
    ///
    /// # Errors
    /// The operating system cannot wait any more.
    pub fn run(
        mut self,
        termination: &Termination,
        supervisor: &Notifier,
    ) -> Result<Summary, Failure> {
        tracing::info!(robot = %self.ipc.robot(), "ready");
        let result = process::run(&mut self, termination, supervisor);
        // What was published before the end still counts.
        self.step();
        let mut summary = self.status.finish();
        self.log_events();
        // Frees the place in shared memory before the disks have answered.
        drop((self.input, self.output, self.ipc));
        self.log_threads.end(&mut summary.logs, self.end_timeout);
        result.map(|()| summary).or_fail(ExitCode::Internal)
    }

    /// Services every source that may have woken us, and does what is due.
    fn step(&mut self) {
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

    fn log_events(&mut self) {
        for event in self.status.take_events() {
            messages::log(&event);
        }
    }
}

impl Process for Shell {
    type Error = WaitError;
    type Key = ();

    /// Telemetry goes on sooner when nothing but the doorbell wakes status.
    const IS_PORTS_ALONE: bool = true;

    fn sources<'a>(&'a mut self, sources: &mut Sources<'a>) {
        sources.port(&mut self.input);
        sources.port(&mut self.output);
    }

    fn drain(&mut self, _wake: Wake) -> Result<(), WaitError> {
        self.step();
        Ok(())
    }

    fn deadline(&self) -> Option<MonotonicNs> {
        self.status.deadline()
    }
}
