//! [`Journaled`]: the core with a journal of all that goes in and what it publishes. Who records is told by the [`Writer`]; while
//! nobody does, every call goes straight on.

use ipc_types::MonotonicNs;
use ipc_types::module::State;
use ipc_types::payload::{DspTelemetry, HeroTelemetry};
use module_kit::journal::Writer;

use crate::config::Config;
use crate::core::{Event, InputCounts, Status, Summary};
use crate::estimator::Estimator;
use crate::journal::{Encoder, Input, Snapshot};

/// A [`Status`] whose inputs and outputs are recorded.
pub struct Journaled {
    status: Status,
    /// The configuration as a text, once for all snapshots.
    text: String,
    writer: Writer,
    encoder: Encoder,
    /// A sample that was translated and is not in the journal yet: publishing it comes first.
    translated: Option<(MonotonicNs, HeroTelemetry)>,
}

impl Journaled {
    /// `status`, which was made with `config`. Nothing is recorded until `writer` is started.
    pub fn new(status: Status, config: &Config, writer: Writer) -> Journaled {
        Journaled {
            status,
            text: Snapshot::text_of(config),
            writer,
            encoder: Encoder::new(),
            translated: None,
        }
    }

    /// The same with another estimator than the configured one.
    #[must_use]
    pub fn with_estimator(mut self, estimator: Box<dyn Estimator + Send>) -> Journaled {
        self.status = self.status.with_estimator(estimator);
        self
    }

    /// The writer: to start and stop it, and to take its pieces.
    pub fn writer(&mut self) -> &mut Writer {
        &mut self.writer
    }

    /// The writer, to ask when it has something.
    pub fn journal(&self) -> &Writer {
        &self.writer
    }

    /// See [`Status::translate`].
    pub fn translate(&mut self, dsp: &DspTelemetry, now: MonotonicNs) -> HeroTelemetry {
        let hero = self.status.translate(dsp, now);
        if self.writer.is_on() {
            self.translated = Some((now, hero));
        }
        hero
    }

    /// See [`Status::record`].
    pub fn record(&mut self, dsp: &DspTelemetry, outcome: Result<(), String>, now: MonotonicNs) {
        if let Some((then, hero)) = self.translated.take() {
            self.input(then, &Input::Translate(*dsp));
            let encoder = &mut self.encoder;
            self.writer
                .record(now, |record| encoder.telemetry(&hero, record));
            self.input(now, &Input::Record(outcome.is_ok()));
        }
        self.status.record(outcome, now);
    }

    /// See [`Status::count`] and [`Status::on_time`].
    pub fn step(&mut self, counts: InputCounts, now: MonotonicNs) {
        if self.writer.is_started() {
            if self.writer.wants_snapshot(now) {
                let snapshot = Snapshot::take(&self.status, &self.text);
                let encoder = &mut self.encoder;
                self.writer
                    .snapshot(now, |record| encoder.snapshot(now, &snapshot, record));
            }
            self.input(now, &Input::Step(counts));
        }
        self.status.count(counts, now);
        self.status.on_time(now);
    }

    /// The state to publish, but for the publisher's fields and its time: in any case when `always`, else if it has changed.
    pub fn state(&mut self, always: bool, now: MonotonicNs) -> Option<State> {
        let is_changed = self.status.take_state_changed();
        if !is_changed && !always {
            return None;
        }
        let state = self.status.state();
        self.input(now, &Input::State { always });
        let encoder = &mut self.encoder;
        self.writer
            .record(now, |record| encoder.state(&state, record));
        Some(state)
    }

    /// See [`Status::deadline`].
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.status.deadline()
    }

    /// See [`Status::take_events`].
    pub fn take_events(&mut self) -> Vec<Event> {
        self.status.take_events()
    }

    /// See [`Status::finish`].
    pub fn finish(&mut self) -> Summary {
        self.status.finish()
    }

    fn input(&mut self, now: MonotonicNs, input: &Input) {
        let encoder = &mut self.encoder;
        self.writer
            .record(now, |record| encoder.input(now, input, record));
    }
}
