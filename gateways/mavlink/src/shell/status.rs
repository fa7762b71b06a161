//! `ril mavlink status`: which stations there are, what was not taken of them, and why nothing is sent.
//!
//! [`MavlinkReport`]: what it shows, as a value made of a sample and the time: as text for people, as JSON for
//! programs. It reads no clock and no port.

use std::fmt;

use ipc_types::code::MavlinkVehicle;
use ipc_types::payload::{MavlinkStation, MavlinkStations};
use ipc_types::{MonotonicNs, RobotId};
use operator::options::SampleArgs;
use operator::render::fields::{JsonLine, Tree};
use operator::render::print;
use operator::render::words::count;
use operator::robot::freshness::SampleAge;
use operator::robot::relay_link::{STALE_AFTER, UNREADABLE, ago, heard_ms, shown, since_ms};
use operator::session::{Latest, Session, other_domains, others_alive};
use runtime::duration::DurationText;
use runtime::exit::{ExitCode, Failure};
use serde::ser::{Serialize, Serializer};

/// `ril mavlink status`
///
/// # Errors
///
/// Code 3 when there is no gateway, 4 when it publishes nothing, 6 when the helicopter is not heard.
pub fn status(args: &SampleArgs) -> Result<(), Failure> {
    let (session, timeout) = Session::for_samples(args)?;
    let robot = session.ipc.robot();
    let Some(mut topic) = Latest::<MavlinkStations>::open_if_provided(&session)? else {
        let text = format!(
            "no gateway to MAVLink of robot {robot} is running here{}{}",
            others_alive(robot),
            other_domains()
        );
        return Err(Failure::new(ExitCode::ServiceAbsent, text)
            .with_next_step("start `ril run mavlink`, and try again"));
    };
    let give_up = MonotonicNs::now() + timeout;
    let is_there = |topic: &mut Latest<MavlinkStations>, _| Ok(topic.sample.is_some());
    if !session.gather(&mut topic, give_up, is_there)? && session.termination.requested() {
        return Ok(());
    }
    let Some(sample) = &topic.sample else {
        let text = format!(
            "nothing came from the gateway of robot {robot} in {}, although it is running",
            DurationText(timeout)
        );
        return Err(Failure::new(ExitCode::Timeout, text).with_next_step(
            "`ril doctor` shows whether it is stopped; is the machine overloaded?",
        ));
    };
    let report = MavlinkReport::new(robot, sample, MonotonicNs::now());
    print(&report, args.json)?;
    match report.trouble() {
        None => Ok(()),
        Some((text, next_step)) => {
            Err(Failure::new(ExitCode::LinkDown, text).with_next_step(next_step))
        }
    }
}

/// Name of the JSON object's layout.
pub const SCHEMA: &str = "ril.Mavlink.v1";

/// What `ril mavlink status` shows, made of a sample and the time.
#[derive(Clone, Debug)]
pub struct MavlinkReport {
    robot: RobotId,
    sample: MavlinkStations,
    now: MonotonicNs,
}

impl MavlinkReport {
    /// What the gateway's sample says at `now`.
    pub fn new(robot: RobotId, sample: &MavlinkStations, now: MonotonicNs) -> MavlinkReport {
        MavlinkReport {
            robot,
            sample: *sample,
            now,
        }
    }

    fn age(&self) -> SampleAge {
        let published = self.sample.published();
        SampleAge::with_limit(self.sample.sequence, published, self.now, STALE_AFTER)
    }

    /// Why no telemetry is sent, and what to do; `None` if it is.
    pub fn trouble(&self) -> Option<(String, String)> {
        if self.age().is_stale() {
            return Some((
                "the gateway says nothing any more".to_owned(),
                "`ril doctor` shows whether it is stopped; is the machine overloaded?".to_owned(),
            ));
        }
        let (why, next_step) = match self.sample.vehicle() {
            Some(MavlinkVehicle::Heard) => return None,
            Some(MavlinkVehicle::NoState) => (
                "nothing comes from the bridge",
                "is `ril run bridge` running, or the relay here? `ril status` says more",
            ),
            Some(MavlinkVehicle::LinkDown) => (
                "the bridge's line to the DSP is down",
                "`ril doctor` looks at the serial port",
            ),
            Some(MavlinkVehicle::NoTelemetry) => (
                "no telemetry comes",
                "is `ril run status` running? `ril hz hero` shows whether samples come",
            ),
            None => (
                "the gateway is of another version",
                "install `ril` anew, and restart all processes",
            ),
        };
        let text = format!("nothing is sent to stations: {why}");
        Some((text, next_step.to_owned()))
    }

    /// Counts of what was not taken: a name for programs, words for people.
    fn refused(&self) -> [(&'static str, &'static str, u64); 7] {
        let sample = &self.sample;
        [
            ("unreadable", "no frame", sample.refused_unreadable),
            (
                "unknown",
                "a message that is not read",
                sample.refused_unknown,
            ),
            ("checksum", "a wrong checksum", sample.refused_checksum),
            ("unsigned", "no signature", sample.refused_unsigned),
            (
                "signature",
                "a signature of another key",
                sample.refused_signature,
            ),
            ("replayed", "an old signature", sample.refused_replayed),
            ("full", "no room for another station", sample.refused_full),
        ]
    }
}

impl fmt::Display for MavlinkReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sample = &self.sample;
        writeln!(f, "robot       {}, system {}", self.robot, sample.system)?;
        let vehicle = sample.vehicle().map_or(UNREADABLE, MavlinkVehicle::name);
        write!(f, "helicopter  {vehicle}")?;
        if let Some(ms) = since_ms(sample.since_ns, self.now) {
            write!(f, " for {}", shown(ms))?;
        }
        writeln!(f)?;
        if sample.stations().is_empty() {
            writeln!(f, "station     none")?;
        }
        for station in sample.stations() {
            write_station(f, station, self.now)?;
        }
        writeln!(
            f,
            "frames      {} read; {} sent, {} dropped",
            sample.frames_read,
            count(sample.datagrams_sent, "datagram"),
            sample.datagrams_dropped
        )?;
        let refused = self.refused();
        let refused = refused.iter().filter(|(.., count)| *count > 0);
        let mut words: Vec<_> = refused
            .map(|(_, why, count)| format!("{count} with {why}"))
            .collect();
        if words.is_empty() {
            words.push("none".to_owned());
        }
        writeln!(f, "refused     {}", words.join(", "))?;
        let signing = match sample.is_signed {
            0 => "not asked for",
            _ => "asked for",
        };
        writeln!(f, "signatures  {signing}")?;
        writeln!(f, "gateway     {}", self.age())
    }
}

fn write_station(
    f: &mut fmt::Formatter<'_>,
    station: &MavlinkStation,
    now: MonotonicNs,
) -> fmt::Result {
    let (system, component) = (station.system, station.component);
    let address = station.address().unwrap_or(UNREADABLE);
    write!(f, "station     {system}/{component} at {address}")?;
    if let Some(ms) = since_ms(station.since_ns, now) {
        write!(f, ", there for {}", shown(ms))?;
    }
    let rights = match station.may_command {
        0 => "may not command",
        _ => "may command",
    };
    let heard = ago(heard_ms(Some(MonotonicNs(station.last_heard_ns)), now));
    let lost = if station.is_lost != 0 { " (lost)" } else { "" };
    writeln!(f, ", {rights}, last message {heard}{lost}")?;
    write!(
        f,
        "            {} taken, {} refused, last {}",
        count(station.commands, "command"),
        station.refused,
        ago(heard_ms(station.last_command(), now))
    )?;
    match station.has_movement {
        0 => writeln!(f),
        _ => writeln!(f, "; the movement under way is its own"),
    }
}

impl Serialize for MavlinkReport {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let sample = &self.sample;
        let (trouble, next_step) = self.trouble().unzip();
        let stations = sample.stations().iter();
        let stations = stations.map(|one| station(one, self.now)).collect();
        let refused = self.refused().map(|(name, _, count)| (name, count.into()));
        let vehicle = sample.vehicle().map(MavlinkVehicle::name);
        let tree = &Tree::nested([
            ("robot", self.robot.get().into()),
            ("system", sample.system.into()),
            ("heard", trouble.is_none().into()),
            ("trouble", trouble.into()),
            ("next_step", next_step.into()),
            ("helicopter", vehicle.into()),
            ("since_ms", since_ms(sample.since_ns, self.now).into()),
            ("stations", Tree::List(stations)),
            ("frames_read", sample.frames_read.into()),
            ("datagrams_sent", sample.datagrams_sent.into()),
            ("datagrams_dropped", sample.datagrams_dropped.into()),
            ("refused", Tree::nested(refused)),
            ("signed", (sample.is_signed != 0).into()),
            ("sample", self.age().tree()),
        ]);
        let schema = SCHEMA;
        JsonLine { schema, tree }.serialize(serializer)
    }
}

fn station(station: &MavlinkStation, now: MonotonicNs) -> Tree {
    let heard = Some(MonotonicNs(station.last_heard_ns));
    Tree::nested([
        ("system", station.system.into()),
        ("component", station.component.into()),
        ("address", station.address().into()),
        ("since_ms", since_ms(station.since_ns, now).into()),
        ("last_heard_age_ms", heard_ms(heard, now).into()),
        ("lost", (station.is_lost != 0).into()),
        ("may_command", (station.may_command != 0).into()),
        ("has_movement", (station.has_movement != 0).into()),
        ("commands", station.commands.into()),
        ("refused", station.refused.into()),
        (
            "last_command_age_ms",
            heard_ms(station.last_command(), now).into(),
        ),
    ])
}

#[cfg(test)]
mod tests {
    use ipc_types::payload::ascii_bytes;
    use serde_json::{Value, json};

    use super::*;

    const NOW: MonotonicNs = MonotonicNs(100_000_000_000);

    fn before(ms: u64) -> u64 {
        NOW.0 - ms * 1_000_000
    }

    fn sample() -> MavlinkStations {
        let mut sample = MavlinkStations {
            sequence: 5,
            published_ns: before(200),
            since_ns: before(12_300),
            frames_read: 990,
            datagrams_sent: 4711,
            refused_checksum: 3,
            refused_unknown: 7,
            vehicle: MavlinkVehicle::Heard.code(),
            system: 1,
            count: 2,
            ..MavlinkStations::default()
        };
        sample.stations[0] = MavlinkStation {
            address: ascii_bytes("127.0.0.1:14550"),
            last_heard_ns: before(450),
            since_ns: before(30_000),
            last_command_ns: before(2_000),
            commands: 4,
            refused: 1,
            system: 255,
            component: 190,
            may_command: 1,
            has_movement: 1,
            ..MavlinkStation::default()
        };
        sample.stations[1] = MavlinkStation {
            address: ascii_bytes("127.0.0.1:40000"),
            last_heard_ns: before(11_000),
            since_ns: before(20_000),
            system: 245,
            component: 190,
            is_lost: 1,
            ..MavlinkStation::default()
        };
        sample
    }

    fn report(sample: &MavlinkStations) -> MavlinkReport {
        MavlinkReport::new(RobotId::new(1).unwrap(), sample, NOW)
    }

    #[test]
    fn stations_and_refusals_are_shown_in_words() {
        assert_eq!(
            report(&sample()).to_string(),
            "robot       1, system 1\n\
             helicopter  heard for 12.3s\n\
             station     255/190 at 127.0.0.1:14550, there for 30s, may command, last message 450 ms ago\n            \
             4 commands taken, 1 refused, last 2000 ms ago; the movement under way is its own\n\
             station     245/190 at 127.0.0.1:40000, there for 20s, may not command, last message 11000 ms ago (lost)\n            \
             0 commands taken, 0 refused, last never\n\
             frames      990 read; 4711 datagrams sent, 0 dropped\n\
             refused     7 with a message that is not read, 3 with a wrong checksum\n\
             signatures  not asked for\n\
             gateway     sample 5, 200 ms old\n"
        );
        assert!(report(&sample()).trouble().is_none());
    }

    #[test]
    fn programs_get_the_same() {
        let value: Value = serde_json::to_value(report(&sample())).unwrap();
        assert_eq!(value["schema"], SCHEMA);
        assert_eq!(value["heard"], true);
        assert_eq!(value["stations"][0]["has_movement"], true);
        assert_eq!(value["stations"][1]["last_command_age_ms"], Value::Null);
        assert_eq!(value["refused"]["checksum"], 3);
        assert_eq!(
            value["sample"],
            json!({"sequence": 5, "age_ms": 200, "stale": false})
        );
    }

    #[test]
    fn why_nothing_is_sent_is_said_with_a_next_step() {
        let mut silent = sample();
        for (vehicle, says) in [
            (
                MavlinkVehicle::NoState.code(),
                "nothing comes from the bridge",
            ),
            (MavlinkVehicle::LinkDown.code(), "line to the DSP is down"),
            (MavlinkVehicle::NoTelemetry.code(), "no telemetry comes"),
            (99, "another version"),
        ] {
            silent.vehicle = vehicle;
            let (text, next_step) = report(&silent).trouble().unwrap();
            assert!(text.contains(says) && !next_step.is_empty(), "{text}");
        }
        let mut hung = sample();
        hung.published_ns = before(4_000);
        let (text, _) = report(&hung).trouble().unwrap();
        assert!(text.contains("says nothing any more"), "{text}");
        let empty = MavlinkStations::default();
        assert!(report(&empty).to_string().contains("station     none"));
    }
}
