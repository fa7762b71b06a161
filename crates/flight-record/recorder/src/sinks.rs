//! [`Sinks`]: what the recorder makes of some topics beside recording them.

use std::collections::BTreeMap;
use std::time::Duration;

use ipc_types::configuration::{BridgeConfiguration, ConfigurationReader, StatusConfiguration};
use ipc_types::payload::{
    BridgeJournal, BridgeOutline, ConfigurationPiece, DspTelemetry, HeroTelemetry, ModuleState,
    RelayStations, SharedStruct, StatusJournal,
};
use ipc_types::{MonotonicNs, RobotId, Topic as _};
use module_kit::journal::LogLine;
use recording::{Anchor, Recorder};
use ros_messages::{StandardMessage, UnixOffset, ViewerMessage};
use runtime::logging::LogLines;

use super::journal::JournalTopics;
use super::log::{LogTopic, RecorderTopic, offset_of};
use super::paths::Paths;

/// A topic that more is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SinkTopic {
    Dsp,
    Hero,
    State,
    BridgeJournal,
    StatusJournal,
    BridgeConfiguration,
    StatusConfiguration,
    Stations,
    Outline,
}

impl SinkTopic {
    /// The topic `key` whose samples have this type; `None` if nothing is made of it.
    pub fn of(type_name: &str, key: &str) -> Option<SinkTopic> {
        Some(match (type_name, key) {
            (DspTelemetry::TYPE_NAME, DspTelemetry::KEY) => SinkTopic::Dsp,
            (HeroTelemetry::TYPE_NAME, HeroTelemetry::KEY) => SinkTopic::Hero,
            (ModuleState::TYPE_NAME, ModuleState::KEY) => SinkTopic::State,
            (BridgeJournal::TYPE_NAME, BridgeJournal::KEY) => SinkTopic::BridgeJournal,
            (StatusJournal::TYPE_NAME, StatusJournal::KEY) => SinkTopic::StatusJournal,
            (BridgeConfiguration::TYPE_NAME, BridgeConfiguration::KEY) => {
                SinkTopic::BridgeConfiguration
            }
            (StatusConfiguration::TYPE_NAME, StatusConfiguration::KEY) => {
                SinkTopic::StatusConfiguration
            }
            (RelayStations::TYPE_NAME, RelayStations::KEY) => SinkTopic::Stations,
            (BridgeOutline::TYPE_NAME, BridgeOutline::KEY) => SinkTopic::Outline,
            _ => return None,
        })
    }
}

/// The processes that publish their configuration.
const CONFIGURED: [&str; 2] = ["bridge", "status"];

/// Takes the samples of the topics that more is made of.
pub(crate) struct Sinks {
    /// Where flights end; `None` if a file may have several.
    flights: Option<Flights>,
    viewers: Viewers,
    paths: Paths,
    log: LogTopic,
    journal: JournalTopics,
    /// The recorder's own lines.
    lines: Option<LogLines>,
    /// What the processes run with, by the files that say so.
    running: BTreeMap<String, Vec<u8>>,
    configurations: [ConfigurationReader; CONFIGURED.len()],
    has_news: bool,
}

impl Sinks {
    /// For `robot`. `has_flights` says whether each flight has a file of its own; the times of messages for viewers
    /// count from `anchor`. `lines` are those that the recorder itself logs.
    pub fn new(
        robot: RobotId,
        has_flights: bool,
        anchor: Anchor,
        lines: Option<LogLines>,
    ) -> Sinks {
        Sinks {
            running: BTreeMap::new(),
            configurations: Default::default(),
            has_news: false,
            lines,
            flights: has_flights.then(Flights::default),
            viewers: Viewers::new(robot, offset_of(anchor)),
            paths: Paths::new(robot, offset_of(anchor)),
            log: LogTopic::new(robot, anchor),
            journal: JournalTopics::new(robot),
        }
    }

    /// Makes of a sample what is to be made of it.
    pub fn take(
        &mut self,
        topic: SinkTopic,
        recorder: &mut Recorder,
        sample: &[u8],
        now: MonotonicNs,
    ) {
        match topic {
            SinkTopic::Dsp => {
                if let Some(flights) = &mut self.flights
                    && let Some(sample) = DspTelemetry::from_bytes(sample)
                {
                    flights.take(sample.is_flying(), sample.received());
                }
            }
            SinkTopic::Hero => {
                if let Some(sample) = HeroTelemetry::from_bytes(sample) {
                    self.viewers.take(recorder, &sample, now);
                    self.paths.telemetry(recorder, &sample, now);
                }
            }
            SinkTopic::State => {
                if let Some(state) = ModuleState::from_bytes(sample) {
                    self.log.state(recorder, &state, now);
                }
            }
            SinkTopic::Outline => {
                if let Some(piece) = BridgeOutline::from_bytes(sample) {
                    self.paths.outline(recorder, &piece, now);
                }
            }
            SinkTopic::Stations => {
                if let Some(stations) = RelayStations::from_bytes(sample) {
                    self.journal.stations(&stations);
                }
            }
            SinkTopic::BridgeJournal => {
                self.journal.take(recorder, &mut self.log, sample, now);
            }
            SinkTopic::StatusJournal => self.log.status(recorder, sample, now),
            SinkTopic::BridgeConfiguration => self.runs_with(0, sample),
            SinkTopic::StatusConfiguration => self.runs_with(1, sample),
        }
    }

    /// A file has begun, and its readers may have no other one.
    pub fn begin_file(&mut self) {
        self.paths.begin_file();
    }

    /// When a flight is over unless telemetry says otherwise.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.flights.as_ref().and_then(Flights::deadline)
    }

    /// Whether a flight is over at `now` that has a file of its own; once for each.
    pub fn is_flight_over(&mut self, recorder: &mut Recorder, now: MonotonicNs) -> bool {
        let is_over = self
            .flights
            .as_mut()
            .is_some_and(|flights| flights.is_over(now));
        if is_over {
            self.paths.end(recorder, now);
            self.paths.forget_track();
        }
        is_over
    }

    /// What is left to be said at the end.
    pub fn end(&mut self, recorder: &mut Recorder, now: MonotonicNs) {
        self.paths.end(recorder, now);
    }

    /// What the processes run with, as they publish it: files by name.
    pub fn running(&self) -> &BTreeMap<String, Vec<u8>> {
        &self.running
    }

    /// Whether that has changed since the last call.
    pub fn take_news(&mut self) -> bool {
        std::mem::take(&mut self.has_news)
    }

    /// Takes a piece of the configuration of the process with this place in [`CONFIGURED`].
    fn runs_with(&mut self, process: usize, sample: &[u8]) {
        let reader = &mut self.configurations[process];
        if let Some(piece) = ConfigurationPiece::from_bytes(sample)
            && reader.take(&piece)
            && let Some(text) = reader.text()
        {
            let file = format!("{}.running.toml", CONFIGURED[process]);
            self.running.insert(file, text.as_bytes().to_vec());
            self.has_news = true;
        }
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
}

/// How far apart messages about the battery are: it changes slowly.
const BATTERY_PERIOD: Duration = Duration::from_secs(1);

/// Makes messages for viewers out of the robot's telemetry.
#[derive(Debug)]
struct Viewers {
    robot: RobotId,
    offset: UnixOffset,
    topics: [(ViewerMessage, RecorderTopic); ViewerMessage::ALL.len()],
    /// When the battery was last said.
    battery: Option<MonotonicNs>,
}

impl Viewers {
    fn new(robot: RobotId, offset: UnixOffset) -> Viewers {
        let topic =
            |one: ViewerMessage| RecorderTopic::new(one.topic(robot), one.type_name(), one.qos());
        Viewers {
            robot,
            offset,
            topics: ViewerMessage::ALL.map(|one| (one, topic(one))),
            battery: None,
        }
    }

    /// Makes of a sample what its valid groups allow.
    fn take(&mut self, recorder: &mut Recorder, sample: &HeroTelemetry, now: MonotonicNs) {
        let at = sample.received();
        for (message, topic) in &mut self.topics {
            let is_battery = *message == ViewerMessage::Standard(StandardMessage::BatteryState);
            if is_battery && self.battery.is_some_and(|last| at < last + BATTERY_PERIOD) {
                continue;
            }
            if let Some(bytes) = message.write(sample, self.robot, self.offset) {
                topic.add(recorder, now, at, &bytes);
                if is_battery {
                    self.battery = Some(at);
                }
            }
        }
    }
}

/// How long the helicopter must have stood on the ground after a flight: a touchdown that bounces ends none, and what
/// the processes say about the landing still belongs to it.
const ON_GROUND_FOR: Duration = Duration::from_secs(5);

/// Watches the helicopter.
#[derive(Debug, Default)]
struct Flights {
    /// Whether it has been in the air since the last end of a flight.
    has_flown: bool,
    /// Since when it is on the ground again.
    landed: Option<MonotonicNs>,
}

impl Flights {
    /// Takes what telemetry says of the moment `at`.
    fn take(&mut self, is_flying: bool, at: MonotonicNs) {
        self.has_flown |= is_flying;
        self.landed = match is_flying {
            true => None,
            false => self.landed.or(self.has_flown.then_some(at)),
        };
    }

    /// When the flight is over unless telemetry says otherwise.
    fn deadline(&self) -> Option<MonotonicNs> {
        self.landed.map(|landed| landed + ON_GROUND_FOR)
    }

    /// Whether a flight is over at `now`; once for each.
    fn is_over(&mut self, now: MonotonicNs) -> bool {
        let is_over = self.deadline().is_some_and(|end| end <= now);
        if is_over {
            *self = Flights::default();
        }
        is_over
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Feeds (ms, flying); returns the moments at which a flight was over, ms, looked at every 100 ms.
    fn ends(steps: &[(u64, bool)]) -> Vec<u64> {
        let mut flights = Flights::default();
        let mut steps = steps.iter().peekable();
        let mut ends = Vec::new();
        for ms in (0..60_000).step_by(100) {
            let now = MonotonicNs(ms * 1_000_000);
            while let Some((_, is_flying)) = steps.next_if(|(at, _)| *at <= ms) {
                flights.take(*is_flying, now);
            }
            if flights.is_over(now) {
                ends.push(ms);
            }
        }
        ends
    }

    #[test]
    fn a_flight_is_over_some_seconds_after_the_landing_and_each_once() {
        for (steps, expected) in [
            (&[(0, false), (9000, false)][..], &[][..]),
            (&[(0, false), (1000, true), (20_000, false)], &[25_000]),
            // It bounces.
            (
                &[(0, true), (10_000, false), (11_000, true), (12_000, false)],
                &[17_000],
            ),
            // Telemetry goes on after it.
            (
                &[(0, true), (10_000, false), (15_000, false), (40_000, false)],
                &[15_000],
            ),
            (
                &[(0, true), (10_000, false), (20_000, true), (30_000, false)],
                &[15_000, 35_000],
            ),
            // It begins in the air, and telemetry ends with the landing.
            (&[(0, true), (50_000, false)], &[55_000]),
        ] {
            assert_eq!(ends(steps), expected, "{steps:?}");
        }
    }
}
