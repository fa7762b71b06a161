//! What a record of `ril record` has beyond the samples of the DSP: samples of status, states of the bridge, requests, events of the
//! recording, and what it says of itself.
//!
//! [`SampleReader`]: a row of a log becomes the sample that it was made of, as far as the log has its columns.

use std::collections::BTreeMap;

use ipc_types::TelemetryGroup as Group;
use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState, SharedStruct};
use ipc_types::schema::CDR_HEADER;
use recording::EventKind;
use recording::read::{self, RecordFile, RecordedEvent, RecordedMessage};
use ros_messages::{Level, Log};
use view::report::flight::{Table, Weight};

use super::collector::Collector;
use super::events::LoggedEventKind;
use crate::recorded::{FLIGHT, REQUEST_EVENT, RequestEvent};
use crate::verbs::log::recording::Row;

/// Ends of the names of topics.
const HERO: &str = "/hero/telemetry";
const STATE: &str = "/bridge/state";

/// Takes everything of the file, whose first sample of the DSP was at `start_unix_ns`, after these samples were taken.
pub fn take(collector: &mut Collector, file: &RecordFile, start_unix_ns: Option<u64>) {
    let since = |unix_ns: u64| Some(unix_ns.saturating_sub(start_unix_ns?));
    for message in read::messages(file).flatten() {
        let payload = || message.data().get(CDR_HEADER.len()..);
        if message.topic().ends_with(HERO) {
            if let Some(hero) = payload().and_then(HeroTelemetry::from_bytes) {
                collector.hero(&hero);
            }
        } else if message.topic().ends_with(STATE) {
            if let Some(state) = payload().and_then(ModuleState::from_bytes) {
                collector.state(&state);
            }
        } else if let Some(event) = request(&message) {
            collector.request(&event);
        } else if let Some((weight, text)) = complaint(&message) {
            if let Some(since_ns) = since(message.publish_time_ns) {
                collector.happened(LoggedEventKind::Process, since_ns, weight, &text);
            }
        } else if let Some(event) = RecordedEvent::of(&message) {
            recorded(collector, &event, since(event.log_time_ns));
        }
    }
}

/// What happened to the recording itself, and the ends of processes.
fn recorded(collector: &mut Collector, event: &RecordedEvent, since_ns: Option<u64>) {
    let of_recording = || format!("recording: {}", event.text);
    let (kind, weight, text) = match event.kind {
        EventKind::Loss | EventKind::Late | EventKind::Disk => {
            (LoggedEventKind::Recording, Weight::Warning, of_recording())
        }
        EventKind::Split | EventKind::Clock | EventKind::Note => {
            (LoggedEventKind::Recording, Weight::Note, of_recording())
        }
        // Also at the end of each flight, so it is no warning.
        EventKind::End => (LoggedEventKind::Process, Weight::Note, event.text.clone()),
        // Samples that are missing and starts of the bridge are seen in the samples themselves.
        _ => return,
    };
    if let Some(since_ns) = since_ns {
        collector.happened(kind, since_ns, weight, &text);
    }
}

/// The lines of the bridge's audit trail that the page has from requests, states and samples: shown again they would be events that
/// happened twice.
const SEEN_ELSEWHERE: [&str; 3] = ["report ", "safety rule ", "DSP error "];

/// What a process warned of in its log. Some of it is seen in the samples and states as well, so it weighs less than there.
fn complaint(message: &RecordedMessage) -> Option<(Weight, String)> {
    if message.schema_name() != Log::TYPE_NAME {
        return None;
    }
    let log = Log::read(message.data()).filter(|log| log.process != FLIGHT)?;
    let is_audit = log.module.ends_with("shell::audit");
    if is_audit && SEEN_ELSEWHERE.iter().any(|line| log.text.starts_with(line)) {
        return None;
    }
    let weight = match log.level {
        Level::Debug | Level::Info => return None,
        Level::Warn => Weight::Note,
        Level::Error | Level::Fatal => Weight::Warning,
    };
    Some((weight, format!("{} logged: {}", log.process, log.text)))
}

fn request(message: &RecordedMessage) -> Option<RequestEvent<'_>> {
    (message.schema_name() == REQUEST_EVENT).then_some(())?;
    RequestEvent::read(message.data())
}

/// What the file says of itself.
pub fn tables(summary: &read::RecordSummary) -> Vec<Table> {
    let text = |text: &str| text.to_owned();
    let mut tables = Vec::new();
    let topics = summary.topics.iter();
    let topics =
        topics.map(|(topic, (_, messages))| (topic.clone(), format!("{messages} messages")));
    tables.push(Table {
        title: text("Topics"),
        rows: topics.collect(),
    });
    // Of those with one name the last one holds.
    let metadata: BTreeMap<_, _> = summary
        .metadata
        .iter()
        .map(|(name, entries)| (name, entries))
        .collect();
    tables.extend(metadata.into_iter().map(|(name, entries)| Table {
        title: name.clone(),
        rows: entries.clone().into_iter().collect(),
    }));
    let files = summary.attachments.iter();
    let files: BTreeMap<_, _> = files
        .map(|file| (file.name.clone(), format!("{} bytes", file.data.len())))
        .collect();
    tables.push(Table {
        title: text("Files in the record"),
        rows: files.into_iter().collect(),
    });
    tables.retain(|table| !table.rows.is_empty());
    tables
}

/// Puts a number into a sample.
type Put = fn(&mut DspTelemetry, f64);

/// A column, the group that its value makes valid, and where the value goes.
type Column = (&'static str, Option<Group>, Put);

/// The columns that a report needs. A cell that is empty leaves its group invalid.
const COLUMNS: [Column; 15] = [
    ("dsp_time_ms", Some(Group::Time), |dsp, value| {
        dsp.dsp_time_ms = value as u32
    }),
    ("latitude_deg", Some(Group::Geographic), |dsp, value| {
        dsp.geographic.latitude_deg = value
    }),
    ("longitude_deg", Some(Group::Geographic), |dsp, value| {
        dsp.geographic.longitude_deg = value
    }),
    ("altitude_m", Some(Group::Geographic), |dsp, value| {
        dsp.geographic.altitude_m = value
    }),
    (
        "gps_horizontal_speed_mps",
        Some(Group::GpsVelocity),
        |dsp, value| {
            dsp.gps_velocity.horizontal_speed_mps = value as f32;
        },
    ),
    (
        "gps_vertical_speed_mps",
        Some(Group::GpsVelocity),
        |dsp, value| {
            dsp.gps_velocity.vertical_speed_mps = value as f32;
        },
    ),
    ("gps_heading_deg", Some(Group::GpsVelocity), |dsp, value| {
        dsp.gps_velocity.heading_deg = value as f32;
    }),
    ("gps_quality", Some(Group::GpsQuality), |dsp, value| {
        dsp.gps_quality = value as u8
    }),
    ("battery_mv", Some(Group::Supply), |dsp, value| {
        dsp.supply.battery_mv = value as u32
    }),
    ("fuel_percent", Some(Group::Supply), |dsp, value| {
        dsp.supply.fuel_percent = value as u32
    }),
    ("auto_switch", Some(Group::Supply), |dsp, value| {
        dsp.supply.auto_switch = value as u32
    }),
    ("rotor_rpm", Some(Group::RotorSpeed), |dsp, value| {
        dsp.rotor_rpm = value as u32
    }),
    (
        "reference_altitude_m",
        Some(Group::References),
        |dsp, value| {
            dsp.references.altitude_m = value as f32;
        },
    ),
    ("dsp_errors", None, |dsp, value| {
        dsp.dsp_errors = value as u32
    }),
    ("last_dsp_error_code", None, |dsp, value| {
        dsp.last_dsp_error_code = value as u32
    }),
];

/// See the module's documentation.
#[derive(Clone, Debug)]
pub struct SampleReader {
    /// Where in a row a value stands, and where it goes.
    places: Vec<(usize, &'static Column)>,
}

impl SampleReader {
    /// A reader of logs with `columns`.
    pub fn new(columns: &[String]) -> SampleReader {
        let place = |column: &'static Column| {
            let place = columns.iter().position(|name| name == column.0)?;
            Some((place, column))
        };
        let mut places: Vec<_> = COLUMNS.iter().filter_map(place).collect();
        places.sort_by_key(|(place, _)| *place);
        SampleReader { places }
    }

    /// The sample of `row`.
    pub fn sample(&self, row: &Row<'_>) -> DspTelemetry {
        let mut sample = DspTelemetry {
            sequence: row.sequence,
            received_ns: row.received_ns,
            flying: u8::from(row.flying),
            ..DspTelemetry::default()
        };
        let mut wanted = self.places.iter().peekable();
        for (index, cell) in row.cells().enumerate() {
            let Some((place, (_, group, put))) = wanted.peek() else {
                break;
            };
            if *place != index {
                continue;
            }
            if let Some(value) = cell.parse::<f64>().ok().filter(|value| value.is_finite()) {
                put(&mut sample, value);
                sample.valid_groups |= group.map_or(0, |group| group.bit());
            }
            wanted.next();
        }
        sample
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::chart::Chart;

    #[test]
    fn the_end_of_a_process_is_an_event_and_what_the_samples_show_is_none() {
        let mut collector = Collector::default();
        for kind in [EventKind::End, EventKind::Restart, EventKind::Gap] {
            let event = RecordedEvent {
                log_time_ns: 0,
                kind,
                topic: "/robot1/bridge/state".to_owned(),
                count: 1,
                first_ns: 0,
                last_ns: 0,
                text: kind.name().to_owned(),
            };
            recorded(&mut collector, &event, Some(0));
            recorded(&mut collector, &event, None);
        }
        let flight = collector.finish(String::new(), &Chart::default());
        let events = flight.events.iter();
        let events: Vec<_> = events
            .map(|event| (event.text.as_str(), event.weight))
            .collect();
        assert_eq!(events, [("end", Weight::Note)]);
    }
}
