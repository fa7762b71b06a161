use std::io::BufReader;

use proptest::prelude::*;

use super::*;
use crate::log::clock::ClockAnchor;
use crate::log::groups::LogGroups;
use crate::log::tsv::Table;
use crate::test_samples::full_sample;
use ipc_types::MonotonicNs;

const HEADER: &str = "flying\tsequence\treceived_ns\tgps_quality\n";

/// All rows and damages of a file, in words.
fn all(text: &[u8]) -> Result<(Vec<String>, usize), String> {
    // A small buffer: lines are put together of pieces.
    let mut log = LogReader::new(BufReader::with_capacity(7, text));
    let mut found = Vec::new();
    loop {
        match log.next() {
            Ok(Some(LogEntry::Row(row))) => found.push(format!("row {}", row.sample.sequence)),
            Ok(Some(LogEntry::Damaged(damage))) => found.push(damage.to_string()),
            Ok(None) => return Ok((found, log.unfinished_bytes())),
            Err(error) => return Err(error.to_string()),
        }
    }
}

#[test]
fn what_a_log_writes_is_read_again_cell_by_cell() {
    let mut table = Table::new(LogGroups::ALL).with_utc(true);
    table.set_clock(ClockAnchor {
        unix_ns: 1_156_797_566_000_250_000,
        monotonic: MonotonicNs(full_sample().received_ns),
    });
    let mut text = Vec::new();
    table.header(&mut text);
    table.row(&full_sample(), &mut text);
    let lines = String::from_utf8(text.clone()).unwrap();
    let mut log = LogReader::new(text.as_slice());
    assert!(log.columns().is_empty());
    let Some(LogEntry::Row(row)) = log.next().unwrap() else {
        panic!("{lines}");
    };
    // A log has none of these.
    let expected = DspTelemetry {
        epoch_ns: 0,
        sent_ns: 0,
        sent_uncertainty_s: 0.0,
        dsp_boots: 0,
        ..full_sample()
    };
    assert_eq!(*row.sample, expected);
    assert_eq!(row.unix_ns, Some(1_156_797_566_000_250_000));
    let cells: Vec<&str> = row.cells().collect();
    let [header, row] = [0, 1].map(|index| lines.lines().nth(index).unwrap());
    assert_eq!(cells, row.split('\t').collect::<Vec<_>>());
    assert_eq!(log.columns(), header.split('\t').collect::<Vec<_>>());
    assert!(log.next().unwrap().is_none());
    assert!(header.len() < MAX_LINE_BYTES / 4 && row.len() < MAX_LINE_BYTES / 4);
}

#[test]
fn each_line_that_is_no_row_is_named_and_the_others_are_read() {
    let long = "9".repeat(MAX_LINE_BYTES + 1);
    let mut text = format!("{HEADER}0\t1\t10\t4\n\n0\t2\t20\n{long}\n1\t3\t30\t\n2\t4\t40\t4\n");
    text += "0\t5\t\x1b[2J\t4\n0\t6\t60\tvier\n0\t7\t70\t4";
    let mut bytes = text.into_bytes();
    let (found, unfinished) = all(&bytes).unwrap();
    let expected = [
        "row 1",
        "line 3: 1 cells where the log has 4 columns",
        "line 4: 3 cells where the log has 4 columns",
        "line 5: longer than 8192 bytes",
        "row 3",
        "line 7: `flying` is no 0 or 1: 2",
        "line 8: `received_ns` is no number: \\u{1b}[2J",
        "line 9: `gps_quality` is no number: vier",
    ];
    assert_eq!(found, expected);
    assert_eq!(unfinished, "0\t7\t70\t4".len());
    bytes.extend_from_slice(b"\n\xff\xfe\n");
    let (found, unfinished) = all(&bytes).unwrap();
    assert_eq!(found[expected.len()..], ["row 7", "line 11: no text"]);
    assert_eq!(unfinished, 0);
}

#[test]
fn a_log_that_an_editor_on_windows_saved_is_the_same_log() {
    let plain = format!("{HEADER}1\t2\t3\n0\t3\t4\n");
    let windows = format!("\u{feff}{}", plain.replace('\n', "\r\n"));
    assert_eq!(
        all(windows.as_bytes()).unwrap().0,
        all(plain.as_bytes()).unwrap().0
    );
}

#[test]
fn what_is_no_log_is_refused_with_the_reason() {
    for (text, expected) in [
        (
            &b"time,altitude\n1,2\n"[..],
            "begins with time,altitude, not with flying, sequence, received_ns",
        ),
        (
            b"flying\tsequence\treceived_ns\tx\tx\n",
            "names a column twice",
        ),
        (
            b"flying\tsequence\treceived_ns\t\x07\n",
            "names a column twice, or one by no name",
        ),
        (b"\x89MCAP0\r\n", "no text"),
        (b"\n", "begins with , not with"),
    ] {
        let error = all(text).unwrap_err();
        assert!(error.contains(expected), "{error}");
    }
    for text in ["", "flying", "flying\tsequence\treceived_ns"] {
        assert_eq!(all(text.as_bytes()).unwrap(), (vec![], text.len()));
    }
    assert_eq!(all(HEADER.as_bytes()).unwrap(), (vec![], 0));
}

#[test]
fn a_file_that_grows_is_read_on() {
    /// Text that comes in pieces; between two there is an end for now.
    struct Growing(Vec<&'static [u8]>);
    impl io::Read for Growing {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            match self.0.is_empty() {
                true => Ok(0),
                false => self.0.remove(0).read(buffer),
            }
        }
    }
    let pieces: Vec<&[u8]> = vec![
        b"flying\tsequ",
        b"",
        b"ence\treceived_ns\n1\t2",
        b"",
        b"\t3\n",
    ];
    let mut log = LogReader::new(BufReader::new(Growing(pieces)));
    assert!(log.next().unwrap().is_none());
    assert_eq!(log.unfinished_bytes(), "flying\tsequ".len());
    assert!(log.next().unwrap().is_none());
    assert_eq!((log.columns().len(), log.unfinished_bytes()), (3, 3));
    assert!(matches!(log.next().unwrap(), Some(LogEntry::Row(row)) if row.sample.sequence == 2));
    assert!(log.next().unwrap().is_none());
}

proptest! {
    #[test]
    fn no_file_panics(bytes in prop::collection::vec(any::<u8>(), 0..500), with_header: bool) {
        let header = if with_header { HEADER.as_bytes() } else { b"" };
        let _ = all(&[header, &bytes].concat());
    }
}
