//! [`Journaled`]: the core with a journal of all that goes in and comes out. Who records is told by the
//! [`Writer`]; while nobody does, every call goes straight on.

use std::ops::Deref;

use ipc_types::MonotonicNs;
use ipc_types::payload::{DspTelemetry, ModuleState, RequestReport};
use module_kit::journal::Writer;

use crate::config::BridgeConfig;
use crate::core::Bridge;
use crate::flight::request::RequestKey;
use crate::journal::{Encoder, Input, Snapshot};
use crate::outputs::{Notice, Outputs};

/// A [`Bridge`] whose inputs and outputs are recorded. What only looks at the bridge is there as its own.
#[derive(Debug)]
pub struct Journaled {
    bridge: Bridge,
    config: BridgeConfig,
    /// The configuration as a text, once for all snapshots.
    text: String,
    journal: Journal,
}

#[derive(Debug)]
struct Journal {
    writer: Writer,
    encoder: Encoder,
    now: MonotonicNs,
}

impl Deref for Journaled {
    type Target = Bridge;

    fn deref(&self) -> &Bridge {
        &self.bridge
    }
}

impl Journaled {
    /// A new bridge. Nothing is recorded until `writer` is started.
    pub fn new(config: &BridgeConfig, writer: Writer) -> Journaled {
        Journaled {
            bridge: Bridge::new(config),
            config: config.clone(),
            text: Snapshot::text_of(config),
            journal: Journal {
                writer,
                encoder: Encoder::new(),
                now: MonotonicNs(0),
            },
        }
    }

    /// The writer: to start and stop it, and to take its pieces.
    pub fn writer(&mut self) -> &mut Writer {
        &mut self.journal.writer
    }

    /// The writer, to ask when it has something.
    pub fn journal(&self) -> &Writer {
        &self.journal.writer
    }

    /// Calls the core with an input.
    pub fn apply<O: Outputs>(&mut self, now: MonotonicNs, input: Input<'_>, out: &mut O) {
        if !self.begin(now) {
            return self.bridge.apply(now, input, out);
        }
        let journal = &mut self.journal;
        let mut tee = Tee {
            out,
            journal,
            received: None,
        };
        match input {
            // Telemetry follows from it, which does not wait for the journal.
            Input::Received(bytes) => {
                tee.journal.now = now;
                tee.received = Some(bytes);
            }
            ref input => tee.journal.input(now, input),
        }
        self.bridge.apply(now, input, &mut tee);
        tee.write_received();
    }

    /// See [`Bridge::transmit`].
    pub fn transmit(&mut self, now: MonotonicNs) -> &[u8] {
        let is_on = self.begin(now);
        // Without bytes nothing has happened.
        if self.bridge.transmit(now).is_empty() {
            return &[];
        }
        if is_on {
            self.journal.input(now, &Input::Transmit);
        }
        self.bridge.unsent()
    }

    /// See [`Bridge::transmitted`].
    pub fn transmitted(&mut self, count: usize) {
        if count > 0 && self.journal.writer.is_on() {
            let now = self.journal.now;
            self.journal.input(now, &Input::Transmitted(count));
            let unsent = self.bridge.unsent();
            let sent = &unsent[..count.min(unsent.len())];
            let Journal {
                writer, encoder, ..
            } = &mut self.journal;
            writer.record(now, |record| encoder.sent(sent, record));
        }
        self.bridge.transmitted(count);
    }

    /// See [`Bridge::take_discard_unsent`].
    pub fn take_discard_unsent(&mut self, now: MonotonicNs) -> bool {
        let is_on = self.begin(now);
        let discards = self.bridge.take_discard_unsent();
        if discards && is_on {
            self.journal.input(now, &Input::DiscardUnsent);
        }
        discards
    }

    /// Writes a snapshot if one is due. Says whether the journal is written.
    fn begin(&mut self, now: MonotonicNs) -> bool {
        let Journal {
            writer, encoder, ..
        } = &mut self.journal;
        if !writer.is_started() {
            return false;
        }
        if writer.wants_snapshot(now) {
            let snapshot = Snapshot::take(&self.bridge, &self.config, &self.text);
            writer.snapshot(now, |record| encoder.snapshot(now, &snapshot, record));
        }
        writer.is_on()
    }
}

impl Journal {
    fn input(&mut self, now: MonotonicNs, input: &Input<'_>) {
        self.now = now;
        let encoder = &mut self.encoder;
        self.writer
            .record(now, |record| encoder.input(now, input, record));
    }
}

/// Gives the outputs on, and writes them into the journal when they are on their way.
struct Tee<'a, O> {
    out: &'a mut O,
    journal: &'a mut Journal,
    /// The input, while it is not in the journal yet: it comes before the first output.
    received: Option<&'a [u8]>,
}

impl<O> Tee<'_, O> {
    fn write_received(&mut self) {
        if let Some(bytes) = self.received.take() {
            let now = self.journal.now;
            self.journal.input(now, &Input::Received(bytes));
        }
    }

    fn record(&mut self, encode: impl FnOnce(&mut Encoder, &mut Vec<u8>)) {
        self.write_received();
        let Journal {
            writer,
            encoder,
            now,
        } = &mut *self.journal;
        writer.record(*now, |record| encode(encoder, record));
    }
}

impl<O: Outputs> Outputs for Tee<'_, O> {
    fn telemetry(&mut self, fill: impl FnOnce(&mut DspTelemetry)) {
        let mut copy = DspTelemetry::default();
        let mut fill = Some(fill);
        self.out.telemetry(|sample| {
            if let Some(fill) = fill.take() {
                fill(sample);
            }
            copy = *sample;
        });
        // A sample that could not be published was the core's decision all the same.
        if let Some(fill) = fill {
            fill(&mut copy);
        }
        self.record(|encoder, record| encoder.telemetry(&copy, record));
    }

    fn state(&mut self, state: &ModuleState) {
        self.out.state(state);
        self.record(|encoder, record| encoder.state(state, record));
    }

    fn report(&mut self, to: RequestKey, report: &RequestReport) {
        self.out.report(to, report);
        self.record(|encoder, record| encoder.report(to, report, record));
    }

    fn notice(&mut self, notice: &Notice) {
        self.out.notice(notice);
    }
}
