//! What a record of `ril record` has beyond the samples of the DSP: samples of status, states of the bridge, requests,
//! events of the recording, and what it says of itself.

use std::collections::BTreeMap;

use ipc_types::payload::{HeroTelemetry, ModuleState, SharedStruct};
use ipc_types::schema::CDR_HEADER;
use recording::EventKind;
use recording::read::{self, RecordFile, RecordedEvent, RecordedMessage};
use recording::{FLIGHT, REQUEST_EVENT, RequestEvent};
use ros_messages::{Level, Log};
use view::page::Weight;
use view::report::flight::Table;

use super::collector::Collector;
use super::events::LoggedEventKind;

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

/// The lines of the bridge's audit trail that the page has from requests, states and samples: shown again they would be
/// events that happened twice.
const SEEN_ELSEWHERE: [&str; 3] = ["report ", "safety rule ", "DSP error "];

/// What a process warned of in its log. Some of it is seen in the samples and states as well, so it weighs less than
/// there.
fn complaint(message: &RecordedMessage) -> Option<(Weight, String)> {
    if message.schema_name() != Log::TYPE_NAME {
        return None;
    }
    let log = Log::read(message.data()).filter(|log| log.process != FLIGHT)?;
    let is_audit = log.module.contains("shell::audit");
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

#[cfg(test)]
mod tests {
    use super::*;
    use operator::robot::chart::Chart;

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
