//! The text of a log: lines of tab-separated values.
//!
//! Names of fields and numbers hold neither tab nor newline nor quote, so nothing needs quoting; [`fields`] tests that.
//! A line is a row exactly if it ends with a newline: that is how partial rows are recognised.

use std::io::Write;

use ipc_types::payload::DspTelemetry;
use ipc_types::{MonotonicNs, TelemetryGroup as Group};

use super::clock::ClockAnchor;
use super::groups::LogGroups;
use crate::fields::{self, Field};
use crate::group::GroupSet;

/// The name of the column with the time in UTC.
pub const UTC: &str = "utc";

/// The columns of a log of some groups.
pub struct Table {
    columns: Vec<Column>,
    /// What the times in UTC count from.
    clock: ClockAnchor,
}

/// What a column holds.
pub(super) enum Column {
    /// When the sample was received, by the wall clock.
    Utc,
    /// A field, with the group that must be valid for it, if there is one.
    Field(Option<Group>, &'static Field),
}

impl Column {
    /// The column of this name; `None` if there is none.
    pub(super) fn of_name(name: &str) -> Option<Column> {
        let of_group = |group| {
            fields::of(group)
                .iter()
                .map(move |field| (Some(group), field))
        };
        let always = fields::ALWAYS.iter().chain(fields::DSP_ERRORS);
        let mut all = always
            .map(|field| (None, field))
            .chain(Group::ALL.into_iter().flat_map(of_group));
        let found = all.find(|(_, field)| field.name == name);
        match name {
            UTC => Some(Column::Utc),
            _ => found.map(|(group, field)| Column::Field(group, field)),
        }
    }
}

impl Table {
    /// The columns that every log has, and those of `groups`.
    pub fn new(groups: impl Into<LogGroups>) -> Table {
        let groups = groups.into();
        let always = fields::ALWAYS.iter().map(|field| (None, field));
        let of_group = |group| {
            let fields = fields::of(group).iter();
            fields.map(move |field| (Some(group), field))
        };
        let telemetry = groups.telemetry.groups().flat_map(of_group);
        let errors: &[Field] = if groups.dsp_errors {
            fields::DSP_ERRORS
        } else {
            &[]
        };
        let errors = errors.iter().map(|field| (None, field));
        let columns = always.chain(telemetry).chain(errors);
        Table {
            columns: columns
                .map(|(group, field)| Column::Field(group, field))
                .collect(),
            clock: ClockAnchor::default(),
        }
    }

    /// Adds a column for the time in UTC, if it `is_wanted`, behind the columns that every log has.
    #[must_use]
    pub fn with_utc(mut self, is_wanted: bool) -> Table {
        if is_wanted {
            self.columns.insert(fields::ALWAYS.len(), Column::Utc);
        }
        self
    }

    /// From here on times in UTC count from `clock`.
    pub fn set_clock(&mut self, clock: ClockAnchor) {
        self.clock = clock;
    }

    /// Appends the first line, with the names of the fields.
    pub fn header(&self, text: &mut Vec<u8>) {
        for column in &self.columns {
            let name = match column {
                Column::Utc => UTC,
                Column::Field(_, field) => field.name,
            };
            text.extend_from_slice(name.as_bytes());
            text.push(b'\t');
        }
        end_line(text);
    }

    /// Appends a row; cells of groups that are not valid in `sample` stay empty.
    pub fn row(&self, sample: &DspTelemetry, text: &mut Vec<u8>) {
        let valid = GroupSet(sample.valid_groups);
        for column in &self.columns {
            // Writing to a vector cannot fail.
            let _ = match column {
                Column::Utc => {
                    write!(text, "{}", self.clock.iso(MonotonicNs(sample.received_ns)))
                }
                Column::Field(Some(group), _) if !valid.contains(*group) => Ok(()),
                Column::Field(_, field) => write!(text, "{}", field.value(sample)),
            };
            text.push(b'\t');
        }
        end_line(text);
    }
}

/// Turns the tab after the last cell into the end of the line.
fn end_line(text: &mut [u8]) {
    if let Some(last) = text.last_mut() {
        *last = b'\n';
    }
}

/// How many bytes of `text` are whole rows.
pub fn whole_rows(text: &[u8]) -> usize {
    let last = text.iter().rposition(|byte| *byte == b'\n');
    last.map_or(0, |end| end + 1)
}

/// How many rows `text` has.
pub fn count_rows(text: &[u8]) -> usize {
    text.iter().filter(|byte| **byte == b'\n').count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_samples::full_sample;

    /// The lines of a log of `groups` with a row for `sample`.
    fn lines(groups: GroupSet, sample: &DspTelemetry) -> [String; 2] {
        let table = Table::new(groups);
        let mut text = Vec::new();
        table.header(&mut text);
        table.row(sample, &mut text);
        let text = String::from_utf8(text).unwrap();
        assert!(text.ends_with('\n'));
        let lines: Vec<_> = text.lines().map(str::to_owned).collect();
        lines.try_into().unwrap()
    }

    #[test]
    fn the_first_line_has_the_names_and_each_sample_a_row() {
        let groups = [Group::Time, Group::Geographic, Group::GpsQuality];
        let expected = [
            "flying\tsequence\treceived_ns\tdsp_time_ms\tlatitude_deg\tlongitude_deg\taltitude_m\tgps_quality",
            "1\t41\t5000000000\t12345\t30\t-45\t123.456\t4",
        ];
        assert_eq!(
            lines(groups.into_iter().collect(), &full_sample()),
            expected
        );
    }

    #[test]
    fn a_row_of_all_groups_by_hand() {
        #[rustfmt::skip]
        let expected = [
            "1", "41", "5000000000", "12345", "30", "-45", "123.456", "-3.5", "4.25", "10", "-1.5", "300", "4",
            "-30", "45", "180", "0.5", "-0.25", "-9.75", "0.125", "-0.5", "1.5",
            "1000", "1250", "1500", "1750", "2000", "1200", "11100", "75", "1", "3072", "0", "1500", "1000",
            "2000", "1750", "1500", "1250", "1000", "1.5", "-2.5", "50.25", "-5", "10", "-90",
        ];
        let [header, row] = lines(GroupSet::ALL, &full_sample());
        assert_eq!(row.split('\t').collect::<Vec<_>>(), expected);
        assert_eq!(header.split('\t').count(), expected.len());
    }

    #[test]
    fn groups_that_are_not_valid_are_empty_cells() {
        let groups = [Group::Xy, Group::Sonar, Group::Barometer];
        let mut sample = full_sample();
        sample.valid_groups = Group::Sonar.bit();
        let [_, row] = lines(groups.into_iter().collect(), &sample);
        assert_eq!(row, "1\t41\t5000000000\t\t\t1200\t");
    }
}
