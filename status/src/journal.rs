//! Status' input journal: every input of the core in order with its time, what it published, and snapshots of the core
//! from which it can be gone on with. `docs/journal.md` has every byte. Logs are not of it: nothing that is published
//! follows from them.
//!
//! * [`Journaled`]: a wrapper around the core that writes the journal while a recorder subscribes to it;
//! * [`Snapshot`]: the configuration and the core as bytes, bit for bit;
//! * [`Record`]: what a [`JournalReader`](module_kit::journal::JournalReader) finds in the pieces of the topic
//!   `status/journal`.

use ipc_types::MonotonicNs;
use module_kit::journal::{JournalWriter, NotASnapshot, snapshot};
use serde::{Deserialize, Serialize};

use crate::config::Config;
use crate::core::{CoreSnapshot, Event, Input, Output, Status, Summary};
use crate::estimator::Estimator;
use crate::log::Logs;

/// An entry of the journal of status.
pub type Record<'a> = module_kit::journal::JournalRecord<'a, Input, Output>;

/// A [`Status`] whose inputs and outputs are recorded, while its writer is started.
pub struct Journaled {
    status: Status,
    /// The configuration as a text, once for all snapshots.
    text: String,
    writer: JournalWriter,
    /// The last input and what the core said to it, which are not in the journal yet: publishing the output comes
    /// first.
    pending: Option<(MonotonicNs, Input, Option<Output>)>,
}

impl Journaled {
    /// `status`, which was made with `config`. Nothing is recorded until `writer` is started.
    pub fn new(status: Status, config: &Config, writer: JournalWriter) -> Journaled {
        Journaled {
            status,
            text: Snapshot::text_of(config),
            writer,
            pending: None,
        }
    }

    /// Replaces the configured estimator by `estimator`.
    #[must_use]
    pub fn with_estimator(mut self, estimator: Box<dyn Estimator + Send>) -> Journaled {
        self.status = self.status.with_estimator(estimator);
        self
    }

    /// The writer: to start and stop it, and to take its pieces.
    pub fn writer(&mut self) -> &mut JournalWriter {
        self.write_pending();
        &mut self.writer
    }

    /// The writer, to ask when it has something.
    pub fn journal(&self) -> &JournalWriter {
        &self.writer
    }

    /// See [`Status::apply`].
    pub fn apply(&mut self, now: MonotonicNs, input: Input) -> Option<Output> {
        self.write_pending();
        // Between a sample and the word that it was published, the core has more than a snapshot; and no sample waits
        // for one.
        let waits = self.writer.is_on() && matches!(input, Input::Sample(_));
        if !waits && !matches!(input, Input::Published(_)) && self.writer.wants_snapshot(now) {
            let snapshot = Snapshot::take(&self.status, &self.text);
            self.writer.snapshot(now, &snapshot);
        }
        if !self.writer.is_on() {
            return self.status.apply(now, input);
        }
        let output = self.status.apply(now, input.clone());
        if output.is_some() || !matches!(input, Input::State { .. }) {
            self.pending = Some((now, input, output.clone()));
        }
        output
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

    fn write_pending(&mut self) {
        if let Some((at, input, output)) = self.pending.take() {
            self.writer.input(at, &input);
            if let Some(output) = output {
                self.writer.output(&output);
            }
        }
    }
}

/// The version of the bytes. Another version of the core has another one.
const VERSION: u32 = 3;

/// Status and its configuration.
pub struct Snapshot {
    /// The configuration, but for the logs.
    pub config: Config,
    /// The core, without logs.
    pub status: Status,
}

#[derive(Serialize, Deserialize)]
struct Saved {
    config: String,
    kept: CoreSnapshot,
}

impl Snapshot {
    /// The configuration as the text that a snapshot has, as `status.toml` has it.
    pub fn text_of(config: &Config) -> String {
        // Every value came from such a text.
        toml::to_string(config).unwrap_or_default()
    }

    /// Status as it begins at `began`, before its first input.
    pub fn fresh(config: &Config, began: MonotonicNs) -> Snapshot {
        let mut status = Status::new(config.calibration.clone(), Logs::default(), began);
        if let Some(estimator) = config.estimator.build() {
            status = status.with_estimator(estimator);
        }
        Snapshot {
            config: config.clone(),
            status,
        }
    }

    /// When it began, if it has had no input.
    pub fn began(&self) -> Option<MonotonicNs> {
        let began = self.status.since();
        let text = Snapshot::text_of(&self.config);
        let fresh = Snapshot::fresh(&self.config, began);
        let is_fresh = Snapshot::take(&self.status, &text) == Snapshot::take(&fresh.status, &text);
        is_fresh.then_some(began)
    }

    /// The bytes of `status`; `text` is its configuration.
    pub fn take(status: &Status, text: &str) -> Vec<u8> {
        let saved = Saved {
            config: text.to_owned(),
            kept: status.keep(),
        };
        snapshot::to_bytes(VERSION, &saved)
    }

    /// The core that these bytes are.
    ///
    /// # Errors
    /// They are no snapshot, or one of another version, or its estimator could not say what it knows.
    pub fn restore(bytes: &[u8]) -> Result<Snapshot, NotASnapshot> {
        let saved: Saved = snapshot::from_bytes(VERSION, bytes)?;
        let config: Config = snapshot::config_of(&saved.config)?;
        let calibration = config.calibration.clone();
        let status = Status::from_kept(saved.kept, calibration, config.estimator.build());
        let status = status.ok_or(NotASnapshot)?;
        Ok(Snapshot { config, status })
    }

    /// This core with `config` in the place of its configuration: what it would do from here on.
    #[must_use]
    pub fn against(mut self, config: &Config) -> Snapshot {
        let calibration = config.calibration.clone();
        self.status
            .reconfigure(calibration, config.estimator.build());
        self.config = config.clone();
        self
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::payload::StatusJournal;
    use ipc_types::{JournalPiece, Topic};
    use module_kit::journal::{Entry, JournalReader};

    use super::*;
    use crate::core::InputCounts;
    use crate::test_samples::sample;

    #[test]
    fn what_the_core_was_given_and_said_is_read_again() {
        let at = MonotonicNs(1_000_000_007);
        let config = Config::default();
        let status = Status::new(config.calibration.clone(), Logs::default(), at);
        let mut status = Journaled::new(status, &config, JournalWriter::new(StatusJournal::ROOM));
        // Nothing before the first snapshot is recorded, and none is taken between a sample and the word that it was
        // published.
        status.apply(at, Input::Sample(sample(1, 1)));
        status.writer().start();
        status.apply(at, Input::Published(Ok(())));
        let inputs = [
            Input::Step(InputCounts {
                received: 7,
                lost: 0,
                publisher_restarts: 1,
            }),
            Input::Sample(sample(1, 2)),
            Input::Published(Err("no room".to_owned())),
            Input::State { always: true },
            // Nothing has changed: it is not recorded.
            Input::State { always: false },
            Input::Step(InputCounts::default()),
        ];
        let mut expected = Vec::new();
        for (index, input) in inputs.into_iter().enumerate() {
            // A clock that was read before the last one.
            let at = MonotonicNs(at.0 + 20 - index as u64);
            let output = status.apply(at, input.clone());
            if input != (Input::State { always: false }) {
                expected.push((at, Entry::Input(input)));
            }
            expected.extend(output.map(|output| (at, Entry::Output(output))));
        }
        let mut reader = JournalReader::new();
        for (piece, sequence) in status.writer().take_all().zip(1..) {
            let mut sample = StatusJournal::default();
            sample.fill(0, piece.begins, piece.beginnings, &piece.bytes);
            sample.stamp(sequence, 1);
            reader.take(&sample);
        }
        let snapshot: Option<Record<'_>> = reader.next().unwrap();
        assert!(matches!(snapshot.unwrap().entry, Entry::Snapshot(_)));
        for (at, entry) in expected {
            let record: Option<Record<'_>> = reader.next().unwrap();
            assert_eq!(record, Some(Record { at, entry }));
        }
        assert_eq!(reader.next::<Input, Output>(), Ok(None));
    }
}
