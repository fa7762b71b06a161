//! [`Recording`]: a flight as status has logged it, as telemetry again.
//!
//! It reads the text that `status` writes (tab-separated values, docs/reference.md): what was flown once, on the
//! simulator or in earnest, is what a consumer is tested against from then on.

use std::fmt::Display;
use std::path::Path;

use ipc_types::MonotonicNs;
use ipc_types::payload::{DspTelemetry, HeroTelemetry};
use status::calibration::Calibration;
use status::log::read::{LogEntry, LogReadError, LogReader};
use status::translate::translate;

use crate::script::only_groups;

/// Samples that were read from a log.
///
/// ```
/// use ril_tests::Recording;
///
/// let log = "flying\tsequence\treceived_ns\tdsp_time_ms\tsonar_adc\n1\t41\t5000\t20\t1200\n0\t42\t6000\t40\t\n";
/// let flight = Recording::parse(log).unwrap();
/// assert_eq!(flight.dsp()[0].sonar_adc, 1200);
/// assert!(!flight.dsp()[1].valid(ipc_types::TelemetryGroup::Sonar));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    samples: Vec<DspTelemetry>,
}

/// Why a text is no log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordingError(String);

impl Display for RecordingError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for RecordingError {}

impl Recording {
    /// Reads the log at `path`.
    ///
    /// # Panics
    ///
    /// When it cannot be read or is no log, with the reason and the line.
    #[track_caller]
    pub fn read(path: &Path) -> Recording {
        let text = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(error) => panic!("{} cannot be read: {error}", path.display()),
        };
        match Recording::parse(&text) {
            Ok(recording) => recording,
            Err(error) => panic!("{}: {error}", path.display()),
        }
    }

    /// Reads a log. A last line without an end was cut off by a kill and is left out, as status leaves it out.
    ///
    /// # Errors
    ///
    /// The first line that is none of a log, and why.
    pub fn parse(text: &str) -> Result<Recording, RecordingError> {
        let none = |error: LogReadError| RecordingError(error.to_string());
        let mut log = LogReader::new(text.as_bytes());
        if !log.begin().map_err(none)? {
            return Err(RecordingError("there is no line with names".to_owned()));
        }
        let mut samples = Vec::new();
        while let Some(entry) = log.next().map_err(none)? {
            match entry {
                // Number and time of then are those of another publisher.
                LogEntry::Row(row) => samples.push(DspTelemetry {
                    sequence: 0,
                    received_ns: 0,
                    ..only_groups(row.sample, row.sample.valid_groups)
                }),
                LogEntry::Damaged(damage) => return Err(RecordingError(damage.to_string())),
            }
        }
        Ok(Recording { samples })
    }

    /// The flight as the bridge publishes it. `received_ns` is 0, because the host's times of then mean nothing now: a
    /// stand-in fills in the moment of publishing.
    pub fn dsp(&self) -> &[DspTelemetry] {
        &self.samples
    }

    /// The flight as status publishes it, with the default calibration.
    pub fn hero(&self) -> Vec<HeroTelemetry> {
        let calibration = Calibration::default();
        self.samples
            .iter()
            .map(|sample| translate(sample, &calibration, MonotonicNs(0)))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::TelemetryGroup;
    use status::group::GroupSet;
    use status::log::groups::LogGroups;
    use status::log::tsv::Table;

    use super::*;
    use crate::Script;

    /// The log that status writes of `samples`.
    fn log(groups: impl Into<LogGroups>, samples: &[DspTelemetry]) -> String {
        let (table, mut text) = (Table::new(groups), Vec::new());
        table.header(&mut text);
        samples
            .iter()
            .for_each(|sample| table.row(sample, &mut text));
        String::from_utf8(text).unwrap()
    }

    #[test]
    fn what_status_logs_is_read_back() {
        let flight = Script::at(37.123_456_7, -5.9, 10.0)
            .stand(0.3)
            .take_off(7.0)
            .groups(&[TelemetryGroup::Time, TelemetryGroup::Attitude])
            .fly(-3.0, 4.0)
            .land();
        let recording = Recording::parse(&log(GroupSet::ALL, flight.dsp())).unwrap();
        assert_eq!(recording.dsp(), flight.dsp());
        assert_eq!(recording.hero(), flight.hero());
    }

    #[test]
    fn every_field_of_a_log_is_read() {
        // A different number in each field, so that none can be taken for another.
        let header = log(LogGroups::ALL, &[]);
        let names = header.trim_end().split('\t');
        let row: Vec<String> = (1..)
            .zip(names)
            .map(|(number, _): (u8, _)| number.to_string())
            .collect();
        let text = format!("{header}{}\n", row.join("\t"));
        let recording = Recording::parse(&text).unwrap();
        let again = log(LogGroups::ALL, recording.dsp());
        let again: Vec<&str> = again.lines().nth(1).unwrap().split('\t').collect();
        assert_eq!(again[0], row[0]);
        assert_eq!(
            again[1..3],
            ["0", "0"],
            "number and time are those of another publisher"
        );
        assert_eq!(again[3..], row[3..]);
    }

    #[test]
    fn groups_that_were_not_logged_are_not_valid() {
        let flight = Script::at(37.0, -6.0, 10.0).stand(0.1);
        let text = log(GroupSet(TelemetryGroup::Sonar.bit()), flight.dsp());
        let recording = Recording::parse(&text).unwrap();
        assert_eq!(recording.dsp()[0].valid_groups, TelemetryGroup::Sonar.bit());
    }

    #[test]
    fn a_row_that_a_kill_cut_off_is_left_out() {
        let text = "flying\tsequence\treceived_ns\n1\t2\t3\n1\t3\t";
        assert_eq!(Recording::parse(text).unwrap().dsp().len(), 1);
    }

    #[test]
    fn what_is_no_log_is_told_with_its_line() {
        for (text, expected) in [
            ("", "there is no line with names"),
            ("flying\tsequence", "there is no line with names"),
            (
                "flying\tspeed\n",
                "it is no log of the RIL: its first line begins with flying\\tspeed, not with flying, sequence, received_ns",
            ),
            (
                "flying\tsequence\treceived_ns\tsonar_adc\n1\t2\t3\t4\n1\n",
                "line 3: 1 cells where the log has 4 columns",
            ),
            (
                "flying\tsequence\treceived_ns\tsonar_adc\n1\t2\t3\tx\n",
                "line 2: `sonar_adc` is no number: x",
            ),
            (
                "flying\tsequence\treceived_ns\n\t5\t6\n",
                "line 2: `flying` is no number: ",
            ),
        ] {
            let error = Recording::parse(text).unwrap_err().to_string();
            assert_eq!(error, expected, "{text:?}");
        }
    }
}
