//! One log: rows of tab-separated values that reach the file as whole rows.
//!
//! Rows are gathered in memory and handed over in blocks, so that a kill never leaves half a row. A row is a row only
//! when it was handed over: the counts never promise more than the file holds.

use std::fmt::Write as _;
use std::io::{self, Write};

use ipc_types::TelemetryGroup as Group;
use ipc_types::payload::DspTelemetry;

use crate::group::GroupSet;
use crate::log::fields::{self, Field};
use crate::log::store::Sink;

/// Gathered bytes after which a block is written before its time: rows of all groups are about 400 bytes, so this is
/// more than a flush period's worth at 300 samples a second. Faster telemetry is written in more blocks; nothing is
/// dropped.
const MAX_BLOCK_BYTES: usize = 64 * 1024;

/// A log file in the making.
pub struct TsvLog {
    groups: GroupSet,
    rows: csv::Writer<Block>,
    /// Rows in the file.
    written: u64,
    /// Rows gathered since.
    pending: u64,
    /// A cell in the making, kept for its memory.
    cell: String,
}

impl TsvLog {
    /// A log of `groups` into `sink`; the first line, with the names of the fields, is written at once.
    ///
    /// # Errors
    /// The sink does not take the line.
    pub fn new(groups: GroupSet, sink: Sink) -> io::Result<TsvLog> {
        let block = Block {
            gathered: Vec::new(),
            sink,
        };
        let rows = csv::WriterBuilder::new()
            .delimiter(b'\t')
            .from_writer(block);
        let mut log = TsvLog {
            groups,
            rows,
            written: 0,
            pending: 0,
            cell: String::new(),
        };
        log.rows
            .write_record(columns(groups).map(|(_, field)| field.name))?;
        log.rows.flush()?;
        Ok(log)
    }

    /// Adds a row; cells of groups that are not valid in `sample` stay empty.
    ///
    /// # Errors
    /// The sink does not take a block. The rows that it had not taken are lost, and the log must not be used again.
    pub fn record(&mut self, sample: &DspTelemetry) -> io::Result<()> {
        let valid = GroupSet(sample.valid_groups);
        for (group, field) in columns(self.groups) {
            self.cell.clear();
            if group.is_none_or(|group| valid.contains(group)) {
                // Writing to a string cannot fail.
                let _ = write!(self.cell, "{}", field.value(sample));
            }
            self.rows.write_field(&self.cell)?;
        }
        self.rows.write_record(None::<&[u8]>)?;
        self.pending += 1;
        if self.rows.get_ref().gathered.len() >= MAX_BLOCK_BYTES {
            self.flush()?;
        }
        Ok(())
    }

    /// Writes the gathered rows.
    ///
    /// # Errors
    /// As for [`record`](Self::record).
    pub fn flush(&mut self) -> io::Result<()> {
        self.rows.flush()?;
        self.written += std::mem::take(&mut self.pending);
        Ok(())
    }

    /// The groups of the log.
    pub fn groups(&self) -> GroupSet {
        self.groups
    }

    /// Rows in the file, the first line not counted.
    pub fn written(&self) -> u64 {
        self.written
    }

    /// Whether rows wait to be written.
    pub fn is_pending(&self) -> bool {
        self.pending > 0
    }
}

/// The columns of a log of `groups`, each with the group that must be valid for it.
fn columns(groups: GroupSet) -> impl Iterator<Item = (Option<Group>, &'static Field)> {
    let always = fields::ALWAYS.iter().map(|field| (None, field));
    let of_group = |group| {
        fields::of(group)
            .iter()
            .map(move |field| (Some(group), field))
    };
    always.chain(groups.groups().flat_map(of_group))
}

/// Gathers bytes and hands them over when it is flushed, never before.
struct Block {
    gathered: Vec<u8>,
    sink: Sink,
}

impl Write for Block {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.gathered.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let result = self.sink.write_all(&self.gathered);
        // After an error too: the sink may have taken a part, and nobody may offer it a second time.
        self.gathered.clear();
        result?;
        self.sink.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_samples::{Memory, full_sample, sample};

    #[test]
    fn the_first_line_has_the_names_and_each_sample_a_row() {
        let memory = Memory::default();
        let groups = [Group::Time, Group::Geographic, Group::GpsQuality];
        let mut log = TsvLog::new(groups.into_iter().collect(), memory.sink()).unwrap();
        assert_eq!(
            memory.text(),
            "flying\tsequence\treceived_ns\tdsp_time_ms\tlatitude_deg\tlongitude_deg\taltitude_m\tgps_quality\n"
        );
        log.record(&full_sample()).unwrap();
        log.flush().unwrap();
        let text = memory.text();
        let rows: Vec<_> = text.lines().skip(1).collect();
        assert_eq!(rows, ["1\t41\t5000000000\t12345\t30\t-45\t123.456\t4"]);
    }

    #[test]
    fn a_row_of_all_groups_by_hand() {
        let memory = Memory::default();
        let mut log = TsvLog::new(GroupSet::ALL, memory.sink()).unwrap();
        log.record(&full_sample()).unwrap();
        log.flush().unwrap();
        let text = memory.text();
        let row = text.lines().nth(1).unwrap();
        #[rustfmt::skip]
        let expected = [
            "1", "41", "5000000000", "12345", "30", "-45", "123.456", "-3.5", "4.25", "10", "-1.5", "300", "4",
            "-30", "45", "180", "0.5", "-0.25", "-9.75", "0.125", "-0.5", "1.5",
            "1000", "1250", "1500", "1750", "2000", "1200", "11100", "75", "1", "3072", "0", "1500", "1000",
            "2000", "1750", "1500", "1250", "1000", "1.5", "-2.5", "50.25", "-5", "10", "-90",
        ];
        assert_eq!(row.split('\t').collect::<Vec<_>>(), expected);
        assert_eq!(
            text.lines().next().unwrap().split('\t').count(),
            expected.len()
        );
    }

    #[test]
    fn groups_that_are_not_valid_are_empty_cells() {
        let memory = Memory::default();
        let groups = [Group::Xy, Group::Sonar, Group::Barometer];
        let mut log = TsvLog::new(groups.into_iter().collect(), memory.sink()).unwrap();
        let mut sample = full_sample();
        sample.valid_groups = Group::Sonar.bit();
        log.record(&sample).unwrap();
        log.flush().unwrap();
        assert_eq!(
            memory.text().lines().nth(1),
            Some("1\t41\t5000000000\t\t\t1200\t")
        );
    }

    #[test]
    fn rows_reach_the_file_whole_and_are_counted_when_they_do() {
        let memory = Memory::default();
        let mut log = TsvLog::new(GroupSet::ALL, memory.sink()).unwrap();
        let mut blocks = 0;
        let mut length = memory.text().len();
        let mut recorded = 0;
        while blocks < 3 {
            recorded += 1;
            log.record(&sample(1, recorded)).unwrap();
            let text = memory.text();
            let rows_in_file = text.lines().count() as u64 - 1;
            assert_eq!(log.written(), rows_in_file);
            assert_eq!(log.is_pending(), rows_in_file < recorded);
            if text.len() > length {
                blocks += 1;
                length = text.len();
                assert!(text.ends_with('\n'));
                assert_eq!(rows_in_file, recorded);
            }
        }
    }

    #[test]
    fn what_is_pending_is_written_when_the_log_is_dropped() {
        let memory = Memory::default();
        let mut log = TsvLog::new(GroupSet::ALL, memory.sink()).unwrap();
        log.record(&full_sample()).unwrap();
        drop(log);
        assert_eq!(memory.text().lines().count(), 2);
    }

    #[test]
    fn a_sink_that_fails_is_offered_nothing_twice() {
        let memory = Memory::default();
        let mut log = TsvLog::new(GroupSet::ALL, memory.sink()).unwrap();
        let header = memory.text();
        memory.fail();
        log.record(&full_sample()).unwrap();
        assert!(log.flush().is_err());
        assert_eq!(log.written(), 0);
        memory.recover();
        drop(log);
        assert_eq!(memory.text(), header);
    }
}
