//! The bridge's input journal: every input of the core in order with its time, what the core said, and snapshots of the
//! whole core from which it can be gone on with. `docs/journal.md` has every byte.
//!
//! * [`Journaled`]: a wrapper around the core that writes the journal while a program records it;
//! * [`Snapshot`]: the configuration and the whole core as bytes, bit for bit;
//! * [`Record`]: what a [`JournalReader`](module_kit::journal::JournalReader) finds in the pieces of the topic
//!   `bridge/journal`.

use std::ops::Deref;

use ipc_types::MonotonicNs;
use ipc_types::payload::{DspTelemetry, ModuleState, RequestReport};
use module_kit::journal::{JournalWriter, NotASnapshot, snapshot};
use serde::{Deserialize, Serialize};

use crate::config::BridgeConfig;
use crate::core::{Bridge, Input};
use crate::outputs::{AsValues, Notice, Output, Outputs, RequestKey};
use crate::safety::fence::Fence;

/// An entry of the bridge's journal.
pub type Record<'a> = module_kit::journal::JournalRecord<'a, Input<'a>, Output<'a>>;

/// A [`Bridge`] whose inputs and outputs are recorded, while its writer is started. What only looks at the bridge is
/// there as its own.
#[derive(Debug)]
pub struct Journaled {
    bridge: Bridge,
    config: BridgeConfig,
    /// The configuration as a text, once for all snapshots.
    text: String,
    writer: JournalWriter,
}

impl Deref for Journaled {
    type Target = Bridge;

    fn deref(&self) -> &Bridge {
        &self.bridge
    }
}

impl Journaled {
    /// A new bridge. Nothing is recorded until `writer` is started.
    pub fn new(config: &BridgeConfig, writer: JournalWriter) -> Journaled {
        Journaled {
            bridge: Bridge::new(config),
            config: config.clone(),
            text: Snapshot::text_of(config),
            writer,
        }
    }

    /// The writer: to start and stop it, and to take its pieces.
    pub fn writer(&mut self) -> &mut JournalWriter {
        &mut self.writer
    }

    /// The writer, to ask when it has something.
    pub fn journal(&self) -> &JournalWriter {
        &self.writer
    }

    /// See [`Bridge::apply`]. While bytes become samples no snapshot is taken, unless nothing can be written without
    /// it: another input follows at once.
    pub fn apply(&mut self, now: MonotonicNs, input: Input<'_>, out: &mut dyn Outputs) {
        if !(self.writer.is_on() && matches!(input, Input::Received(_))) {
            self.snapshot_if_due(now);
        }
        if !self.writer.is_on() {
            return self.bridge.apply(now, input, out);
        }
        self.writer.input(now, &input);
        let writer = &mut self.writer;
        let record = AsValues(|output: Output<'_>| writer.output(&output));
        self.bridge.apply(now, input, &mut Tee { out, record });
    }

    /// See [`Bridge::transmit`].
    pub fn transmit(&mut self, now: MonotonicNs) -> &[u8] {
        self.snapshot_if_due(now);
        if !self.bridge.transmit(now).is_empty() {
            self.writer.input(now, &Input::Transmit);
        }
        self.bridge.unsent()
    }

    /// See [`Bridge::take_discard_unsent`].
    pub fn take_discard_unsent(&mut self, now: MonotonicNs) -> bool {
        self.snapshot_if_due(now);
        let discards = self.bridge.take_discard_unsent();
        if discards {
            self.writer.input(now, &Input::DiscardUnsent);
        }
        discards
    }

    fn snapshot_if_due(&mut self, now: MonotonicNs) {
        if self.writer.wants_snapshot(now) {
            let snapshot = Snapshot::take(&self.bridge, &self.config, &self.text);
            self.writer.snapshot(now, &snapshot);
        }
    }
}

/// Gives the outputs on, and then to the record: a consumer does not wait for the journal.
struct Tee<'a, R> {
    out: &'a mut dyn Outputs,
    record: R,
}

impl<R: Outputs> Outputs for Tee<'_, R> {
    fn telemetry(&mut self, fill: &mut dyn FnMut(&mut DspTelemetry)) {
        let mut copy = None;
        self.out.telemetry(&mut |sample| {
            fill(sample);
            copy = Some(*sample);
        });
        // A sample that could not be published was the core's decision all the same.
        self.record.telemetry(&mut |sample| match copy {
            Some(copy) => *sample = copy,
            None => fill(sample),
        });
    }

    fn state(&mut self, state: &ModuleState) {
        self.out.state(state);
        self.record.state(state);
    }

    fn report(&mut self, to: RequestKey, report: &RequestReport) {
        self.out.report(to, report);
        self.record.report(to, report);
    }

    fn sent(&mut self, bytes: &[u8]) {
        self.out.sent(bytes);
        self.record.sent(bytes);
    }

    fn notice(&mut self, notice: &Notice) {
        self.out.notice(notice);
    }
}

/// The version of the bytes. Another version of the core has another one.
const VERSION: u32 = 9;

/// A bridge and its configuration.
///
/// The core has what it has seen; what the configuration says stands beside it as a text. A trajectory generator that
/// was given to [`Bridge::with_trajectory`] is not in it: a core from a snapshot has the one that its configuration
/// chooses.
#[derive(Debug)]
pub struct Snapshot {
    /// The configuration, but for the port.
    pub config: BridgeConfig,
    /// The core.
    pub bridge: Bridge,
}

#[derive(Serialize)]
struct Saved<'a> {
    config: &'a str,
    fence: Option<&'a str>,
    bridge: &'a Bridge,
}

#[derive(Deserialize)]
struct Loaded {
    config: String,
    fence: Option<String>,
    bridge: Bridge,
}

impl Snapshot {
    /// A bridge as it begins, before its first input.
    pub fn fresh(config: &BridgeConfig) -> Snapshot {
        Snapshot {
            config: config.clone(),
            bridge: Bridge::new(config),
        }
    }

    /// Whether it has had no input.
    pub fn is_fresh(&self) -> bool {
        let text = Snapshot::text_of(&self.config);
        let bytes = |bridge| Snapshot::take(bridge, &self.config, &text);
        bytes(&self.bridge) == bytes(&Bridge::new(&self.config))
    }

    /// The configuration as the text that a snapshot has, as `bridge.toml` has it.
    pub fn text_of(config: &BridgeConfig) -> String {
        // Every value came from such a text.
        toml::to_string(config).unwrap_or_default()
    }

    /// The bytes of `bridge`; `config` is what it was made with, and `text` the same as a text.
    pub fn take(bridge: &Bridge, config: &BridgeConfig, text: &str) -> Vec<u8> {
        let fence = (*bridge.fence() != config.fence)
            .then(|| toml::to_string(bridge.fence()).unwrap_or_default());
        let saved = Saved {
            config: text,
            fence: fence.as_deref(),
            bridge,
        };
        snapshot::to_bytes(VERSION, &saved)
    }

    /// The bridge that these bytes are.
    ///
    /// # Errors
    /// They are no snapshot, or one of another version.
    pub fn restore(bytes: &[u8]) -> Result<Snapshot, NotASnapshot> {
        let loaded: Loaded = snapshot::from_bytes(VERSION, bytes)?;
        let config: BridgeConfig = snapshot::config_of(&loaded.config)?;
        let fence: Fence = match loaded.fence {
            Some(text) => snapshot::config_of(&text)?,
            None => config.fence.clone(),
        };
        let mut bridge = loaded.bridge;
        bridge.configure(&config, fence)?;
        Ok(Snapshot { config, bridge })
    }

    /// This bridge with `config` in the place of its configuration: what it would do from here on. Parameters and a
    /// geofence that were set at run time stay.
    ///
    /// # Errors
    /// Never for a snapshot that was restored.
    pub fn against(mut self, config: &BridgeConfig) -> Result<Snapshot, NotASnapshot> {
        let fence = match *self.bridge.fence() == self.config.fence {
            true => config.fence.clone(),
            false => self.bridge.fence().clone(),
        };
        self.bridge
            .replace_parameters(&self.config.parameters, &config.parameters);
        self.bridge.configure(config, fence)?;
        self.config = config.clone();
        Ok(self)
    }
}

#[cfg(test)]
mod tests;
