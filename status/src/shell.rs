//! The process around the core: ports, clock, and the one wait. It decides nothing.
//!
//! One thread sleeps until telemetry, a subscriber, a signal or the core's next deadline wakes it. Then it services
//! every source that may have woken it. It never touches a file: each log has a thread of its own for that.

mod log_thread;
mod messages;
#[cfg(test)]
mod tests;

use std::time::Duration;

use ipc_types::configuration::ConfigurationText;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, StatusJournal};
use ipc_types::{Ipc, MonotonicNs, Publisher, StateOf, StatusModule, Subscriber, WaitError, Wake};
use module_kit::configuration::ConfigurationPort;
use module_kit::journal::JournalPort;
use module_kit::process::{self, Process, Sources};
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::notify::Notifier;
use runtime::realtime::{self, RealtimeConfig, latency::ProcessorLatency};
use runtime::signal::Termination;

use crate::config::Config;
use crate::core::{Input, InputCounts, Output, Status, Summary};
use crate::estimator::Estimator;
use crate::journal::Journaled;
use crate::log::store::{FileStore, Store};
use log_thread::{END_TIMEOUT, LogThreads};

/// The process with its surroundings.
pub struct Shell {
    status: Journaled,
    journal: JournalPort<StatusJournal>,
    configuration: ConfigurationPort<StatusModule>,
    log_threads: LogThreads,
    realtime: RealtimeConfig,
    latency: ProcessorLatency,
    /// Whether the helicopter was in the air in the newest sample.
    is_flying: bool,
    /// How long the end waits for the disks.
    end_timeout: Duration,
    input: Subscriber<DspTelemetry>,
    output: Publisher<HeroTelemetry>,
    state: Publisher<StateOf<StatusModule>>,
    ipc: Ipc,
    /// Whether the last attempt to receive failed, so that a series of failures is logged once.
    input_failing: bool,
    /// Whether the last attempt to publish the state failed, so that a series of failures is logged once.
    state_failing: bool,
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

    /// Replaces the configured estimator by `estimator`.
    #[must_use]
    pub fn with_estimator(mut self, estimator: Box<dyn Estimator + Send>) -> Shell {
        self.status = self.status.with_estimator(estimator);
        self
    }

    /// Publishes `text` as the configuration, in place of the one without the origins of values.
    #[must_use]
    pub fn with_configuration(mut self, text: ConfigurationText) -> Shell {
        self.configuration.replace(text);
        self
    }

    /// Opens the ports of status, and starts the logs with the files that `store` makes.
    fn open_with<S>(ipc: Ipc, config: &Config, store: impl FnMut() -> S) -> Result<Shell, Failure>
    where
        S: Store + Send + 'static,
        S::File: Send,
    {
        let output = ipc
            .publisher::<HeroTelemetry>()
            .or_fail_with(ExitCode::Internal, "status cannot publish telemetry")?;
        let state = ipc
            .publisher()
            .or_fail_with(ExitCode::Internal, "status cannot publish its state")?;
        let journal = JournalPort::open(&ipc)
            .or_fail_with(ExitCode::Internal, "status cannot publish its journal")?;
        let configuration = ConfigurationText::new(config.to_toml());
        let configuration = ConfigurationPort::open(&ipc, configuration).or_fail_with(
            ExitCode::Internal,
            "status cannot publish its configuration",
        )?;
        let input = ipc
            .subscriber::<DspTelemetry>()
            .or_fail_with(ExitCode::Internal, "status cannot receive telemetry")?;
        // Last, so that a process that cannot start leaves no files.
        let (logs, log_threads) = LogThreads::start(&config.log, ipc.robot(), store);
        let mut status = Status::new(config.calibration.clone(), logs, MonotonicNs::now());
        if let Some(estimator) = config.estimator.build() {
            status = status.with_estimator(estimator);
        }
        let writer = JournalPort::<StatusJournal>::writer();
        Ok(Shell {
            status: Journaled::new(status, config, writer),
            journal,
            configuration,
            log_threads,
            realtime: config.realtime.clone(),
            latency: ProcessorLatency::start(config.realtime.low_latency_processor),
            is_flying: false,
            end_timeout: END_TIMEOUT,
            input,
            output,
            state,
            ipc,
            input_failing: false,
            state_failing: false,
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
        realtime::begin(&self.realtime);
        tracing::info!(robot = %self.ipc.robot(), "ready");
        let result = process::run(&mut self, termination, supervisor);
        // What was published before the end still counts.
        self.step();
        let mut summary = self.status.finish();
        self.log_events();
        // Frees the place in shared memory before the disks have answered.
        self.journal
            .finish(self.status.writer(), MonotonicNs::now());
        drop((self.input, self.output, self.state, self.journal));
        drop((self.configuration, self.ipc));
        self.log_threads.end(&mut summary.logs, self.end_timeout);
        result.map(|()| summary).or_fail(ExitCode::Internal)
    }

    /// Services every source that may have woken us, and does what is due.
    fn step(&mut self) {
        self.journal.follow(self.status.writer());
        self.drain();
        let now = MonotonicNs::now();
        let losses = self.input.losses();
        let counts = InputCounts {
            received: losses.received,
            lost: losses.lost,
            publisher_restarts: losses.publisher_restarts,
        };
        self.status.apply(now, Input::Step(counts));
        self.log_events();
        self.publish_state(false, now);
        self.configuration.publish(now);
        self.journal.publish(self.status.writer(), now);
        self.latency.follow(self.is_flying);
    }

    /// Publishes the state: in any case, or if it has changed.
    fn publish_state(&mut self, always: bool, now: MonotonicNs) {
        let state = self.status.apply(now, Input::State { always });
        let Some(Output::State(mut state)) = state else {
            return;
        };
        state.published_ns = now.0;
        let result = self.state.publish(|sample| *sample = StateOf::new(state));
        let was_failing = std::mem::replace(&mut self.state_failing, result.is_err());
        if let Err(error) = result
            && !was_failing
        {
            tracing::warn!(%error, "the state cannot be published");
        }
    }

    /// Publishes every sample that has been received, each before it is logged.
    fn drain(&mut self) {
        let (status, output) = (&mut self.status, &mut self.output);
        let is_flying = &mut self.is_flying;
        let result = self.input.drain(|dsp| {
            let now = MonotonicNs::now();
            *is_flying = dsp.is_flying();
            let published = output.publish_batched(|hero| {
                if let Some(Output::Telemetry(sample)) = status.apply(now, Input::Sample(*dsp)) {
                    *hero = sample;
                }
            });
            let outcome = published
                .map(|_sequence| ())
                .map_err(|error| error.to_string());
            status.apply(now, Input::Published(outcome));
        });
        output.end_batch();
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
        sources.port(&mut self.state);
        sources.port(self.journal.source());
        sources.port(self.configuration.source());
    }

    fn drain(&mut self, _wake: Wake) -> Result<(), WaitError> {
        self.step();
        Ok(())
    }

    /// The state comes at least once a second without a wake of its own: a round is due every half second, and comes
    /// with the next wake, [`LONGEST_SLEEP`](ipc_types::waiter::LONGEST_SLEEP) after the one before at the latest.
    fn round(&mut self, now: MonotonicNs) {
        self.publish_state(true, now);
    }

    fn deadline(&self) -> Option<MonotonicNs> {
        let journal = self.journal.deadline(self.status.journal());
        [
            self.status.deadline(),
            self.configuration.deadline(),
            journal,
        ]
        .into_iter()
        .flatten()
        .min()
    }
}
