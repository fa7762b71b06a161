//! The text of a log: lines of tab-separated values.
//!
//! Names of fields and numbers hold neither tab nor newline nor quote, so nothing needs quoting; [`fields`] tests that.
//! A line is a row exactly if it ends with a newline: that is how half rows are recognised.

use std::io::Write;

use ipc_types::TelemetryGroup as Group;
use ipc_types::payload::DspTelemetry;

use super::fields::{self, Field};
use crate::group::GroupSet;

/// The columns of a log of some groups.
pub struct Table {
    /// Each with the group that must be valid for it.
    columns: Vec<(Option<Group>, &'static Field)>,
}

impl Table {
    /// The columns that every log has, and those of `groups`.
    pub fn new(groups: GroupSet) -> Table {
        let always = fields::ALWAYS.iter().map(|field| (None, field));
        let of_group = |group| {
            let fields = fields::of(group).iter();
            fields.map(move |field| (Some(group), field))
        };
        Table {
            columns: always.chain(groups.groups().flat_map(of_group)).collect(),
        }
    }

    /// Appends the first line, with the names of the fields.
    pub fn header(&self, text: &mut Vec<u8>) {
        for (_, field) in &self.columns {
            text.extend_from_slice(field.name.as_bytes());
            text.push(b'\t');
        }
        end_line(text);
    }

    /// Appends a row; cells of groups that are not valid in `sample` stay empty.
    pub fn row(&self, sample: &DspTelemetry, text: &mut Vec<u8>) {
        let valid = GroupSet(sample.valid_groups);
        for (group, field) in &self.columns {
            if group.is_none_or(|group| valid.contains(group)) {
                // Writing to a vector cannot fail.
                let _ = write!(text, "{}", field.value(sample));
            }
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
