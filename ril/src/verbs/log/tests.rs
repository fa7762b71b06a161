//! What `ril log` makes of the rows of logs: summaries, chosen columns, formats.

use std::path::Path;

use status::log::read::LogReader;

use super::recording::{LogEntry, LogFormat};
use super::row::{Chosen, JsonRow, UtcSource, UtcTimes};
use super::summary::{Summarizer, Summary};

/// 2006-08-28T20:39:26Z.
const CREATED_UNIX_S: u64 = 1_156_797_566;

/// The summary of a log's text.
fn summary(text: &str) -> Summary {
    assert_eq!(
        LogFormat::of(Path::new("a.tsv"), text.as_bytes()),
        LogFormat::Tsv
    );
    let mut log = LogReader::new(text.as_bytes());
    assert!(log.begin().unwrap());
    let source = UtcSource::of(log.columns(), Some(CREATED_UNIX_S));
    let mut summarizer = Summarizer::new("x.tsv".to_owned(), Some(1), log.columns(), source);
    while let Some(entry) = log.next().unwrap() {
        match entry {
            LogEntry::Row(row) => summarizer.row(&row),
            LogEntry::Damaged(damage) => summarizer.damage(&damage),
        }
    }
    summarizer.finish(log.unfinished_bytes())
}

/// A flight of 100 m to the north, 10 m high, after 1 s on the ground; a sample is missing, and 3 s without any.
fn flight() -> String {
    let mut text = "flying\tsequence\treceived_ns\tlatitude_deg\tlongitude_deg\taltitude_m\tgps_horizontal_speed_mps\tbattery_mv\tfuel_percent\tauto_switch\n".to_owned();
    let mut row =
        |flying: u32, sequence: u64, ms: u64, north_m: f64, altitude: f64, speed: f64, mv: u32| {
            let latitude = 37.0 + north_m / 111_195.0;
            text += &format!(
                "{flying}\t{sequence}\t{}\t{latitude}\t-6\t{altitude}\t{speed}\t{mv}\t90\t1\n",
                5_000_000_000 + ms * 1_000_000
            );
        };
    row(0, 7, 0, 0.0, 12.0, 0.0, 25_200);
    row(0, 8, 1000, 0.0, 12.0, 0.0, 25_000);
    for step in 0..=100_u64 {
        let missed = u64::from(step > 50);
        let gap_ms = if step > 50 { 3000 } else { 0 };
        row(
            1,
            9 + step + missed,
            1100 + step * 100 + gap_ms,
            step as f64,
            22.0,
            10.0,
            24_000,
        );
    }
    row(0, 111, 15_000, 100.0, 12.0, 0.0, 24_500);
    text
}

#[test]
fn a_flight_is_summed_up() {
    let summary = summary(&flight());
    assert_eq!((summary.rows, summary.take_offs), (104, 1));
    assert_eq!(
        summary.start_utc.as_deref(),
        Some("2006-08-28T20:39:26.000000Z")
    );
    assert_eq!(
        summary.end_utc.as_deref(),
        Some("2006-08-28T20:39:41.000000Z")
    );
    assert!((summary.duration_s - 15.0).abs() < 1e-9);
    assert!((summary.flight_s - 13.9).abs() < 1e-9);
    assert!(
        (summary.distance_m.unwrap() - 100.0).abs() < 2.0,
        "{summary:?}"
    );
    assert_eq!(
        (summary.max_altitude_m, summary.max_height_m),
        (Some(22.0), Some(10.0))
    );
    assert_eq!(summary.max_speed_mps, Some(10.0));
    let battery = summary.battery_v.unwrap();
    assert_eq!(
        (battery.first, battery.last, battery.min),
        (25.2, 24.5, 24.0)
    );
    assert_eq!((summary.lost_samples, summary.bridge_restarts), (1, 0));
    assert_eq!((summary.gaps, summary.longest_gap_s), (1, 3.1));
    assert_eq!(summary.dsp_errors, None);
    assert!(summary.is_whole());
    let text = summary.to_string();
    for line in [
        "start       2006-08-28T20:39:26.000000Z (from the file's name; true times may be later)",
        "duration    15.0s, 104 rows",
        "altitude    at most 22.0 m, 10.0 m above take-off",
        "battery     25.2 V to 24.5 V, 0.7 V used, at least 24.0 V",
        "losses      1 sample of 105 (0.95 %), 0 restarts of the bridge",
        "gaps        1 longer than 1 s, the longest 3.1s",
        "DSP errors  not in this log",
    ] {
        assert!(text.contains(line), "{line}\n{text}");
    }
}

#[test]
fn numbers_of_a_publisher_that_counts_nothing_are_summed_up() {
    let all = u64::MAX;
    let rows = [1, all, 1, all].map(|sequence| format!("1\t{sequence}\t{all}\t{}\n", u32::MAX));
    let text = "flying\tsequence\treceived_ns\tdsp_errors\n".to_owned() + &rows.concat();
    let summary = summary(&text);
    assert_eq!((summary.rows, summary.lost_samples), (4, all));
    assert!(summary.to_string().contains("100.00 %"), "{summary}");
}

#[test]
fn a_helicopter_that_hovers_goes_no_way_though_its_gps_is_noisy() {
    let mut text = "flying\tsequence\treceived_ns\tlatitude_deg\tlongitude_deg\n".to_owned();
    for index in 0..1000_u64 {
        let noise = if index % 2 == 0 { 1e-6 } else { -1e-6 };
        text += &format!(
            "1\t{index}\t{}\t{}\t179.9999999\n",
            index * 20_000_000,
            37.0 + noise
        );
    }
    let summary = summary(&text);
    assert_eq!(summary.distance_m, Some(0.0));
    assert_eq!((summary.max_height_m, summary.take_offs), (None, 1));
}

#[test]
fn a_lost_fix_and_a_damaged_place_are_no_way() {
    let mut text =
        "flying\tsequence\treceived_ns\tlatitude_deg\tlongitude_deg\taltitude_m\tgps_quality\n"
            .to_owned();
    for index in 0..100_u64 {
        let place = match index {
            20..30 => "0\t0\t0\t0".to_owned(),
            50 => "77\t-6\t20\t4".to_owned(),
            _ => format!("{}\t-6\t20\t4", 37.0 + index as f64 / 111_195.0),
        };
        text += &format!("1\t{index}\t{}\t{place}\n", index * 20_000_000);
    }
    let summary = summary(&text);
    let distance_m = summary.distance_m.unwrap();
    assert!((95.0..101.0).contains(&distance_m), "{distance_m}");
}

#[test]
fn a_restart_of_the_bridge_is_no_loss_and_its_errors_count_anew() {
    let text = "flying\tsequence\treceived_ns\tdsp_errors\tlast_dsp_error_code\n\
        0\t100\t1\t2\t30\n0\t101\t2\t3\t30\n0\t1\t3\t0\t\n0\t2\t4\t1\t30\n";
    let summary = summary(text);
    assert_eq!((summary.lost_samples, summary.bridge_restarts), (0, 1));
    assert_eq!(summary.dsp_errors, Some(2));
}

#[test]
fn damage_is_said_and_the_rest_is_summed_up() {
    let text = "flying\tsequence\treceived_ns\n0\t1\t1\nnonsense\n0\t2\t2\n0\t3";
    let summary = summary(text);
    assert_eq!(
        (
            summary.rows,
            summary.damaged_lines,
            summary.unfinished_bytes
        ),
        (2, 1, 3)
    );
    assert!(!summary.is_whole());
    let text = summary.to_string();
    assert!(
        text.contains("damage      1 line without a row; first line 3: 1 cells"),
        "{text}"
    );
    assert!(text.contains("unfinished  3 bytes"), "{text}");
}

#[test]
fn an_empty_log_has_an_empty_summary() {
    let summary = summary("flying\tsequence\treceived_ns\n");
    assert_eq!((summary.rows, summary.duration_s), (0, 0.0));
    assert_eq!(
        (summary.start_utc.as_ref(), summary.distance_m),
        (None, None)
    );
    assert!(summary.to_string().contains("start       unknown"));
}

#[test]
fn rows_are_shown_by_chosen_columns() {
    let text = "flying\tsequence\treceived_ns\tutc\taltitude_m\tgps_quality\n\
        1\t7\t5\t2006-08-28T20:39:26.000250Z\t1.5\t\n";
    let mut log = LogReader::new(text.as_bytes());
    assert!(log.begin().unwrap());
    let columns = log.columns().to_vec();
    let mut times = UtcTimes::new(UtcSource::of(&columns, None));
    let Some(LogEntry::Row(row)) = log.next().unwrap() else {
        panic!()
    };
    let time = times.of(&row);
    let chosen = Chosen::present(
        &columns,
        &["flying", "altitude_m", "battery_mv", "gps_quality"],
    );
    let line = "2006-08-28T20:39:26.000250Z  flying=1  altitude_m=1.5  gps_quality=-";
    assert_eq!(chosen.line(time, &row), line);
    let all = Chosen::all(&columns);
    let json = serde_json::to_string(&JsonRow {
        chosen: &all,
        time,
        row: &row,
    })
    .unwrap();
    assert_eq!(
        json,
        "{\"schema\":\"ril.LogRow.v1\",\"utc\":\"2006-08-28T20:39:26.000250Z\",\"flying\":1,\"sequence\":7,\
         \"received_ns\":5,\"altitude_m\":1.5,\"gps_quality\":null}"
    );
    let unknown = Chosen::named(&columns, &["altitud_m".to_owned()]).unwrap_err();
    assert!(unknown.contains("did you mean `altitude_m`?"), "{unknown}");
    let unknown = Chosen::named(&columns, &["x".to_owned()]).unwrap_err();
    assert!(unknown.contains("it has flying, sequence"), "{unknown}");
}

#[test]
fn a_file_of_another_format_is_named() {
    let of = |name: &str, beginning: &[u8]| LogFormat::of(Path::new(name), beginning);
    assert_eq!(of("a", b"\x89MCAP0\r\n"), LogFormat::Mcap);
    assert_eq!(of("a.mcap", b"\x88MCAP0\r\n"), LogFormat::Mcap);
    assert_eq!(of("a.tsv", b""), LogFormat::Tsv);
}

#[test]
fn a_column_has_the_unit_of_its_field_and_is_found_by_the_name_that_echo_prints() {
    use ipc_types::Schema;
    use ipc_types::payload::DspTelemetry;
    let schema = Schema::of::<DspTelemetry>();
    let columns: Vec<String> = status::fields::all()
        .map(|field| field.name.to_owned())
        .collect();
    let unit = |name: &str| name.rsplit('_').next().map(str::to_owned);
    for field in status::fields::all() {
        let path = field.path();
        assert!(
            schema.number(&path).is_some(),
            "{path} is no field of `ril echo dsp`"
        );
        if field.name.contains('_') {
            assert_eq!(unit(field.name), unit(&path), "{}", field.name);
        }
        let chosen = Chosen::named(&columns, std::slice::from_ref(&path)).unwrap();
        assert_eq!(chosen.names().collect::<Vec<_>>(), [field.name], "{path}");
    }
}
