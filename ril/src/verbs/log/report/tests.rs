//! Logs as reports.

use operator::robot::chart::Chart;
use status::log::read::LogReader;
use view::page::Weight;
use view::report::FlightReport;

use super::collector::Collector;
use super::words;
use crate::verbs::log::recording::LogEntry;
use crate::verbs::log::row::UtcSource;
use crate::verbs::log::summary::Summarizer;

const HEADER: &str = "flying\tsequence\treceived_ns\tdsp_time_ms\tlatitude_deg\tlongitude_deg\taltitude_m\tgps_quality\tbattery_mv\tfuel_percent\tauto_switch\tdsp_errors\tlast_dsp_error_code\n";

/// The flight of a log's text, and its sentences.
fn flight(text: &str) -> (FlightReport, Vec<String>) {
    let mut log = LogReader::new(text.as_bytes());
    assert!(log.begin().unwrap());
    let columns = log.columns().to_vec();
    let mut summarizer = Summarizer::new("x.tsv".to_owned(), Some(1), &columns, UtcSource::Nowhere);
    let mut collector = Collector::default();
    while let Some(entry) = log.next().unwrap() {
        match entry {
            LogEntry::Row(row) => {
                summarizer.row(&row);
                collector.sample(row.sample);
            }
            LogEntry::Damaged(damage) => {
                summarizer.damage(&damage);
                collector.damage(&damage.to_string());
            }
        }
    }
    let summary = summarizer.finish(log.unfinished_bytes());
    (
        collector.finish("x".to_owned(), &Chart::default()),
        words::sentences(&summary),
    )
}

struct Rows {
    text: String,
    sequence: u64,
    at_ms: u64,
    dsp_ms: u64,
}

impl Rows {
    fn new() -> Rows {
        Rows {
            text: HEADER.to_owned(),
            sequence: 0,
            at_ms: 5000,
            dsp_ms: 100,
        }
    }

    /// So many samples, 20 ms apart.
    fn add(&mut self, count: u64, flying: u8, fix: u8, switch: u8, errors: u32) {
        for _ in 0..count {
            self.sequence += 1;
            self.at_ms += 20;
            self.dsp_ms += 20;
            let north = self.at_ms as f64 * 1e-9;
            self.text += &format!(
                "{flying}\t{}\t{}\t{}\t{}\t-6\t{}\t{fix}\t25200\t90\t{switch}\t{errors}\t30\n",
                self.sequence,
                self.at_ms * 1_000_000,
                self.dsp_ms,
                37.0 + north,
                10 + flying,
            );
        }
    }
}

fn texts(flight: &FlightReport) -> Vec<(&str, Weight)> {
    flight
        .events
        .iter()
        .map(|event| (event.text.as_str(), event.weight))
        .collect()
}

#[test]
fn a_flight_with_faults_has_its_events_in_order() {
    let mut rows = Rows::new();
    rows.add(100, 0, 4, 1, 0);
    rows.add(100, 1, 4, 1, 0);
    rows.sequence += 3;
    rows.add(100, 1, 4, 1, 0);
    rows.at_ms += 4000;
    rows.dsp_ms += 4000;
    rows.add(100, 1, 0, 1, 0);
    rows.add(100, 1, 1, 0, 2);
    rows.dsp_ms = 0;
    rows.add(100, 0, 1, 0, 2);
    rows.sequence = 0;
    rows.add(10, 0, 1, 0, 2);
    rows.text += "nonsense\n";
    let (flight, sentences) = flight(&rows.text);
    assert_eq!(
        texts(&flight),
        [
            ("took off", Weight::Note),
            ("3 samples were lost", Weight::Warning),
            ("no sample for 4.0 s in flight", Weight::Alarm),
            ("the GPS lost its fix", Weight::Alarm),
            (
                "the DSP reported dsp-error-30 (invalid command), 2 times",
                Weight::Warning
            ),
            (
                "the pilot took control: the switch is at manual",
                Weight::Warning
            ),
            ("the GPS fix is GPS", Weight::Note),
            ("the DSP booted", Weight::Alarm),
            ("landed", Weight::Note),
            ("the bridge began anew", Weight::Alarm),
            (
                "the recording is damaged: line 612: 1 cells where the log has 13 columns",
                Weight::Warning
            ),
        ]
    );
    assert_eq!(flight.gaps.len(), 1);
    let [from_s, to_s] = flight.gaps[0];
    assert!((to_s - from_s - 4.02).abs() < 1e-9, "{:?}", flight.gaps);
    let phases: Vec<&str> = flight
        .phases
        .iter()
        .map(|span| span.name.as_str())
        .collect();
    assert_eq!(
        phases,
        ["on the ground", "in the air", "in the air", "on the ground"]
    );
    assert!(
        sentences[0].starts_with("The helicopter took off once"),
        "{sentences:?}"
    );
    assert!(
        sentences
            .last()
            .unwrap()
            .starts_with("3 of the 613 samples"),
        "{sentences:?}"
    );
    view::report::page(&flight);
}

#[test]
fn a_flight_without_faults_says_so() {
    let mut rows = Rows::new();
    for flying in [0, 1, 0] {
        rows.add(200, flying, 4, 1, 0);
    }
    let (flight, sentences) = flight(&rows.text);
    assert_eq!(
        texts(&flight),
        [("took off", Weight::Note), ("landed", Weight::Note)]
    );
    assert_eq!(
        sentences.last().unwrap(),
        "All 600 samples that the bridge published are there, without a gap, a restart of the bridge or an error of the DSP."
    );
    let names: Vec<&str> = flight
        .plots
        .iter()
        .filter(|plot| !plot.is_empty())
        .map(|plot| plot.id)
        .collect();
    assert_eq!(names, ["altitude", "battery", "fuel", "link", "ages"]);
}

#[test]
fn a_flight_with_a_gap_alone_says_that_and_that_no_sample_was_lost() {
    let mut rows = Rows::new();
    rows.add(100, 1, 4, 1, 0);
    rows.at_ms += 4000;
    rows.dsp_ms += 4000;
    rows.add(100, 1, 4, 1, 0);
    let (_, sentences) = flight(&rows.text);
    assert_eq!(
        sentences.last().unwrap(),
        "None of the 200 samples that the bridge published was lost, but there was one gap of 4.0s."
    );
}

#[test]
fn a_log_with_few_columns_or_no_row_is_a_report() {
    for text in [
        "flying\tsequence\treceived_ns\n",
        "flying\tsequence\treceived_ns\n0\t1\t5\n",
        "flying\tsequence\treceived_ns\n1\t1\t5\n1\t2\t18446744073709551615\n1\t3\t6\n",
    ] {
        let (flight, sentences) = flight(text);
        assert!(!sentences.is_empty());
        assert!(flight.duration_s < 1.0, "{}", flight.duration_s);
        view::report::page(&flight);
    }
}

#[test]
fn numbers_of_a_publisher_that_counts_nothing_are_reported() {
    let all = u64::MAX;
    let rows = [1, all, 1, all].map(|sequence| format!("1\t{sequence}\t{all}\t{}\n", u32::MAX));
    let text = "flying\tsequence\treceived_ns\tdsp_errors\n".to_owned() + &rows.concat();
    let (_, sentences) = flight(&text);
    let sentences = sentences.concat();
    assert!(sentences.contains("100.00 %"), "{sentences}");
}
