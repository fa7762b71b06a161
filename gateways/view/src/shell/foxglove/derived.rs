//! [`Derived`]: topics that no process publishes, for panels of Foxglove and Lichtblick. Those that are made of
//! telemetry are the same in [recordings](ViewerMessage); `/diagnostics`, `chart`, `track` and `log` say what a page
//! shows.
//!
//! What no client wants is not made.

use std::collections::BTreeMap;
use std::time::Duration;

use ipc_types::payload::HeroTelemetry;
use ipc_types::{Ipc, MonotonicNs, RobotId, Subscriber};
use operator::robot::clock::Clocks;
use operator::robot::geo::Place;
use operator::robot::history::EventLine;
use operator::robot::model::{Process, WatchedRobot};
use recording::{FLIGHT, topic};
use ros_messages::{
    DIAGNOSTIC_ARRAY, Diagnostic, DiagnosticLevel, GEO_JSON, Log, UnixOffset, ViewerMessage,
    definition, diagnostic_array, geojson_message,
};

use super::geojson;
use crate::messages;
use crate::shell::fleet::ShownRobot;
use crate::{Channel, ChannelId, Server, page};

/// How often conditions are sent although they did not change: all robots share the topic, and a client that comes
/// later gets its newest message alone.
const CONDITIONS_PERIOD: Duration = Duration::from_secs(1);

/// Time between two tracks: each has all places.
const TRACK_PERIOD: Duration = Duration::from_secs(1);

/// Topics that no process publishes, for panels of Foxglove and Lichtblick.
#[derive(Default)]
pub(crate) struct Derived {
    robots: BTreeMap<RobotId, RobotTopics>,
}

/// What is made of one robot. A channel is `None` if there are too many.
struct RobotTopics {
    of_telemetry: Vec<(ViewerMessage, ChannelId)>,
    /// `None` while no client wants what is made of it.
    telemetry: Option<Subscriber<HeroTelemetry>>,
    diagnostics: DerivedTopic<Vec<Diagnostic>>,
    conditions: Diagnostics,
    chart: DerivedTopic<page::Chart>,
    track: DerivedTopic<Vec<Vec<Place>>>,
    log: Option<ChannelId>,
    /// Lines of the robot's journal that were sent.
    said_lines: u64,
}

/// A topic that says one thing, when it changes.
struct DerivedTopic<T> {
    channel: Option<ChannelId>,
    /// The last sample and its time; `None` while no client subscribes.
    said: Option<(T, MonotonicNs)>,
}

impl Derived {
    /// Offers the topics of a robot, and sends what is new of those that a client wants.
    pub fn drain(&mut self, shown: &ShownRobot, server: &mut Server, clock: Clocks) {
        let robot = shown.robot.id;
        let topics = self.robots.entry(robot);
        let topics = topics.or_insert_with(|| RobotTopics::offer(robot, server));
        topics.telemetry(robot, shown.ports.ipc(), server, clock);
        topics.conditions(&shown.robot, server, clock);
        topics.map(shown, server, clock);
        topics.log(&shown.robot, server, clock);
    }
}

impl RobotTopics {
    fn offer(robot: RobotId, server: &mut Server) -> RobotTopics {
        let mut offer = |topic, type_name| offer(topic, type_name, server);
        RobotTopics {
            of_telemetry: ViewerMessage::ALL
                .into_iter()
                .filter_map(|one| Some((one, offer(one.topic(robot), one.type_name())?)))
                .collect(),
            telemetry: None,
            diagnostics: DerivedTopic::new(offer("/diagnostics".to_owned(), DIAGNOSTIC_ARRAY)),
            conditions: Diagnostics::default(),
            chart: DerivedTopic::new(offer(topic(robot, "chart"), GEO_JSON)),
            track: DerivedTopic::new(offer(topic(robot, "track"), GEO_JSON)),
            log: offer(topic(robot, "log"), Log::TYPE_NAME),
            said_lines: 0,
        }
    }

    /// What telemetry says, in messages that panels understand.
    fn telemetry(&mut self, robot: RobotId, ipc: &Ipc, server: &mut Server, clock: Clocks) {
        let wanted = self
            .of_telemetry
            .iter()
            .filter(|(_, channel)| server.is_subscribed(*channel));
        let wanted: Vec<_> = wanted.copied().collect();
        if wanted.is_empty() {
            self.telemetry = None;
            return;
        }
        if self.telemetry.is_none() {
            self.telemetry = ipc
                .subscriber()
                .inspect_err(|error| tracing::warn!(%robot, %error, "telemetry cannot be read"))
                .ok();
        }
        let Some(telemetry) = &mut self.telemetry else {
            return;
        };
        let offset = UnixOffset(i64::try_from(clock.zero_unix_ns).unwrap_or(i64::MAX));
        let drained = telemetry.drain(|sample: &HeroTelemetry| {
            let at = clock.unix_ns(sample.received().min(clock.now));
            for (message, channel) in &wanted {
                if let Some(bytes) = message.write(sample, robot, offset) {
                    server.time(clock.unix_ns(clock.now));
                    server.sample(*channel, at, bytes);
                }
            }
        });
        if let Err(error) = drained {
            tracing::debug!(%robot, %error, "telemetry cannot be read");
        }
    }

    fn conditions(&mut self, robot: &WatchedRobot, server: &mut Server, clock: Clocks) {
        let now = clock.now;
        let Some(channel) = self.diagnostics.wanted(server) else {
            return;
        };
        let is_fresh = robot.process(Process::Bridge, now).is_fresh();
        let conditions = self.conditions.take(&messages::robot(robot, now), is_fresh);
        if self.diagnostics.is_new(&conditions) || self.diagnostics.is_older(CONDITIONS_PERIOD, now)
        {
            let unix_ns = clock.unix_ns(now);
            let message = diagnostic_array(i64::try_from(unix_ns).unwrap_or(i64::MAX), &conditions);
            send(server, channel, clock, message);
            self.diagnostics.said = Some((conditions, now));
        }
    }

    /// Fence, path and home, and the track.
    fn map(&mut self, shown: &ShownRobot, server: &mut Server, clock: Clocks) {
        if let Some(channel) = self.chart.wanted(server) {
            let chart = messages::chart(&shown.robot);
            let is_flying = shown.robot.pilot.flying == Some(true);
            let before = self.chart.said.as_ref();
            if before
                .is_none_or(|(before, _)| messages::is_another_chart(before, &chart, is_flying))
            {
                send(
                    server,
                    channel,
                    clock,
                    geojson_message(&geojson::chart(&chart)),
                );
                self.chart.said = Some((chart, clock.now));
            }
        }
        if let Some(channel) = self.track.wanted(server) {
            let places: Vec<_> = shown.robot.track.pieces().map(<[Place]>::to_vec).collect();
            let is_due = self.track.said.is_none() || self.track.is_older(TRACK_PERIOD, clock.now);
            if is_due && self.track.is_new(&places) {
                send(
                    server,
                    channel,
                    clock,
                    geojson_message(&geojson::track(&places)),
                );
                self.track.said = Some((places, clock.now));
            }
        }
    }

    /// What happened. The first client that comes gets all that is kept.
    fn log(&mut self, robot: &WatchedRobot, server: &mut Server, clock: Clocks) {
        let Some(channel) = self.log.filter(|channel| server.is_subscribed(*channel)) else {
            self.said_lines = 0;
            return;
        };
        for line in robot.journal.since(self.said_lines) {
            let unix_ns = clock.unix_ns(line.at);
            server.time(clock.unix_ns(clock.now));
            server.line(channel, unix_ns, log_line(line, unix_ns));
        }
        self.said_lines = robot.journal.added();
    }
}

impl<T: PartialEq> DerivedTopic<T> {
    fn new(channel: Option<ChannelId>) -> DerivedTopic<T> {
        let said = None;
        DerivedTopic { channel, said }
    }

    /// The channel if a client subscribes to it. If none does, the last sample is forgotten, so that the next
    /// subscriber gets it again.
    fn wanted(&mut self, server: &Server) -> Option<ChannelId> {
        let wanted = self
            .channel
            .filter(|channel| server.is_subscribed(*channel));
        if wanted.is_none() {
            self.said = None;
        }
        wanted
    }

    fn is_new(&self, what: &T) -> bool {
        self.said.as_ref().is_none_or(|(said, _)| said != what)
    }

    fn is_older(&self, period: Duration, now: MonotonicNs) -> bool {
        self.said
            .as_ref()
            .is_some_and(|(_, at)| now >= *at + period)
    }
}

fn offer(topic: String, type_name: &str, server: &mut Server) -> Option<ChannelId> {
    let channel = server.channel(Channel {
        schema: definition(type_name)?.into(),
        encoding: "cdr".to_owned(),
        schema_name: type_name.to_owned(),
        schema_encoding: "ros2msg".to_owned(),
        topic: topic.clone(),
    });
    if channel.is_none() {
        tracing::warn!(topic, "not offered: there are too many topics");
    }
    channel
}

/// Sends what is so at this moment, behind the moment.
fn send(server: &mut Server, channel: ChannelId, clock: Clocks, message: Vec<u8>) {
    let unix_ns = clock.unix_ns(clock.now);
    server.time(unix_ns);
    server.sample(channel, unix_ns, message);
}

fn log_line(line: &EventLine, unix_ns: u64) -> Vec<u8> {
    Log {
        unix_ns: i64::try_from(unix_ns).unwrap_or(i64::MAX),
        level: line.weight.into(),
        process: FLIGHT,
        text: &line.text,
        module: "",
    }
    .write()
}

/// Most alarms that are remembered when they are over. There are fewer kinds, but for DSP errors. The oldest goes.
const MAX_KNOWN: usize = 64;

/// What `/diagnostics` says of a robot.
#[derive(Debug, Default)]
pub(crate) struct Diagnostics {
    /// Names of alarms that there were.
    known: Vec<String>,
}

impl Diagnostics {
    /// The conditions of `robot`: what it does, and each alarm. `is_fresh` says whether its bridge's state is of the
    /// present.
    pub fn take(&mut self, robot: &page::RobotStatus, is_fresh: bool) -> Vec<Diagnostic> {
        let hardware = format!("robot{}", robot.robot);
        let condition = |name: &str, level, message: &str| Diagnostic {
            level,
            name: format!("{hardware}: {name}"),
            message: message.to_owned(),
            hardware: hardware.clone(),
            values: Vec::new(),
        };
        let level = match is_fresh {
            true => DiagnosticLevel::Ok,
            false => DiagnosticLevel::Stale,
        };
        let mut conditions = vec![condition("phase", level, &robot.phase)];
        for alarm in &robot.alarms {
            let mut one = condition(&alarm.id, diagnostic_level(alarm.severity), &alarm.text);
            let next_step = alarm.next_step.iter();
            one.values
                .extend(next_step.map(|step| ("next step".to_owned(), step.clone())));
            conditions.push(one);
            if !self.known.contains(&alarm.id) {
                self.known.push(alarm.id.clone());
            }
        }
        let over = self.known.len().saturating_sub(MAX_KNOWN);
        self.known.drain(..over);
        for name in &self.known {
            if !robot.alarms.iter().any(|alarm| alarm.id == *name) {
                conditions.push(condition(name, DiagnosticLevel::Ok, "over"));
            }
        }
        conditions
    }
}

fn diagnostic_level(severity: page::Severity) -> DiagnosticLevel {
    match severity {
        page::Severity::Ok | page::Severity::Note => DiagnosticLevel::Ok,
        page::Severity::Warning => DiagnosticLevel::Warn,
        page::Severity::Alarm => DiagnosticLevel::Error,
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::RobotId;

    use super::*;
    use crate::messages;
    use operator::robot::fixture::{at, fly};
    use operator::robot::model::{Process, WatchedRobot};

    fn said(
        diagnostics: &mut Diagnostics,
        robot: &WatchedRobot,
        ms: u64,
    ) -> Vec<(DiagnosticLevel, String, String)> {
        let is_fresh = robot.process(Process::Bridge, at(ms)).is_fresh();
        let conditions = diagnostics.take(&messages::robot(robot, at(ms)), is_fresh);
        assert!(conditions.iter().all(|one| one.hardware == "robot1"));
        conditions
            .into_iter()
            .map(|one| (one.level, one.name, one.message))
            .collect()
    }

    #[test]
    fn alarms_come_and_are_over() {
        let mut robot = WatchedRobot::new(RobotId::DEFAULT);
        fly(&mut robot);
        robot.judge(at(20_000));
        let mut diagnostics = Diagnostics::default();
        let phase = "robot1: phase".to_owned();
        let flying = "flying the path, waypoint 2 of 3".to_owned();
        let expected = [(DiagnosticLevel::Ok, phase.clone(), flying.clone())];
        assert_eq!(said(&mut diagnostics, &robot, 20_100), expected);

        robot.provider(Process::Bridge, false, at(21_500));
        robot.judge(at(21_500));
        let gone = said(&mut diagnostics, &robot, 21_500);
        assert_eq!(gone[0], (DiagnosticLevel::Stale, phase, flying));
        assert_eq!(
            (gone[1].0, &*gone[1].1),
            (DiagnosticLevel::Error, "robot1: bridge-gone")
        );

        let state = robot.state.unwrap();
        let state = ipc_types::payload::ModuleState {
            published_ns: at(22_000).0,
            ..state
        };
        robot.state(&state, at(22_000));
        robot.provider(Process::Bridge, true, at(22_000));
        robot.judge(at(22_000));
        let back = said(&mut diagnostics, &robot, 22_000);
        let over = (
            DiagnosticLevel::Ok,
            "robot1: bridge-gone".to_owned(),
            "over".to_owned(),
        );
        assert!(back.contains(&over), "{back:?}");
    }
}
