//! [`Sinks`]: what the recorder makes of some topics beside recording them.

use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState, SharedStruct};
use ipc_types::{MonotonicNs, RobotId};
use module_kit::journal::LogLine;
use recording::{Anchor, Recorder};
use runtime::logging::LogLines;

use crate::record::flights::Flights;
use crate::record::journal::JournalTopics;
use crate::record::log::LogTopic;
use crate::record::viewers::Viewers;

/// Takes the samples of the topics that more is made of.
pub(super) struct Sinks {
    /// Where flights end; nothing when a file may have several.
    pub flights: Option<Flights>,
    viewers: Viewers,
    log: LogTopic,
    journal: JournalTopics,
    /// The recorder's own lines.
    lines: Option<LogLines>,
}

impl Sinks {
    /// For `robot`. `has_flights` says whether each flight has a file of its own; the times of messages for viewers count from
    /// `anchor`. `lines` are those that the recorder itself logs.
    pub fn new(
        robot: RobotId,
        has_flights: bool,
        anchor: Anchor,
        lines: Option<LogLines>,
    ) -> Sinks {
        Sinks {
            lines,
            flights: has_flights.then(Flights::default),
            viewers: Viewers::new(robot, anchor),
            log: LogTopic::new(robot, anchor),
            journal: JournalTopics::new(robot),
        }
    }

    /// A sample of raw telemetry.
    pub fn dsp(&mut self, sample: &[u8]) {
        if let (Some(flights), Some(sample)) = (&mut self.flights, DspTelemetry::from_bytes(sample))
        {
            flights.take(sample.is_flying(), sample.received());
        }
    }

    /// A sample of the robot's telemetry.
    pub fn hero(&mut self, recorder: &mut Recorder, sample: &[u8], now: MonotonicNs) {
        if let Some(sample) = HeroTelemetry::from_bytes(sample) {
            self.viewers.take(recorder, &sample, now);
        }
    }

    /// A state of the bridge.
    pub fn state(&mut self, recorder: &mut Recorder, sample: &[u8], now: MonotonicNs) {
        if let Some(state) = ModuleState::from_bytes(sample) {
            self.log.state(recorder, &state, now);
        }
    }

    /// A piece of status's journal.
    pub fn status_journal(&mut self, recorder: &mut Recorder, sample: &[u8], now: MonotonicNs) {
        self.log.status(recorder, sample, now);
    }

    /// What the recorder itself has logged.
    pub fn own_lines(&mut self, recorder: &mut Recorder, now: MonotonicNs) {
        let Some(lines) = &self.lines else { return };
        for line in lines.drain() {
            let times = (now, MonotonicNs(line.at_ns));
            let line = LogLine::new(&line, lines.take_lost());
            self.log.process(recorder, times, "record", &line);
        }
    }

    /// A piece of the bridge's journal.
    pub fn journal(&mut self, recorder: &mut Recorder, sample: &[u8], now: MonotonicNs) {
        self.journal.take(recorder, &mut self.log, sample, now);
    }
}
