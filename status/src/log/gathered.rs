//! Rows that wait in memory for a file: always whole rows, in their order, never more than a bound.

use ipc_types::MonotonicNs;

/// Most bytes that wait while nothing can be written. Rows of all groups are about 400 bytes, so this is 13 s at 50
/// samples a second: more than the longest pause between two attempts, so that short trouble costs no row at all.
/// Beyond it the newest rows are refused.
pub const MAX_GATHERED_BYTES: usize = 256 * 1024;

/// Rows that wait.
#[derive(Default)]
pub struct Gathered {
    text: Vec<u8>,
    rows: u64,
    /// When the oldest of them came.
    since: Option<MonotonicNs>,
}

impl Gathered {
    /// Takes the row that `write` appends at `now`. Gives false if there is no room for it.
    pub fn push(&mut self, now: MonotonicNs, write: impl FnOnce(&mut Vec<u8>)) -> bool {
        let before = self.text.len();
        write(&mut self.text);
        if self.text.len() > MAX_GATHERED_BYTES {
            self.text.truncate(before);
            return false;
        }
        self.rows += 1;
        self.since.get_or_insert(now);
        true
    }

    /// The rows from the oldest on that fit into `room` bytes.
    pub fn fitting(&self, room: u64) -> &[u8] {
        let room = usize::try_from(room).unwrap_or(usize::MAX);
        match self.text.get(..room) {
            Some(start) => &start[..whole_rows(start)],
            None => &self.text,
        }
    }

    /// The oldest row, or nothing.
    pub fn oldest(&self) -> &[u8] {
        let end = self.text.iter().position(|byte| *byte == b'\n');
        &self.text[..end.map_or(0, |end| end + 1)]
    }

    /// Forgets the oldest `bytes`, which must be whole rows; says how many rows they were.
    pub fn forget(&mut self, bytes: usize) -> u64 {
        let rows = count_rows(&self.text[..bytes]);
        self.text.drain(..bytes);
        self.rows -= rows;
        if self.rows == 0 {
            self.since = None;
        }
        rows
    }

    /// Forgets everything; says how many rows it was.
    pub fn clear(&mut self) -> u64 {
        self.forget(self.text.len())
    }

    /// How many bytes wait.
    pub fn bytes(&self) -> usize {
        self.text.len()
    }

    /// Since when the oldest row waits. As long as there are others it is not made younger by its going: that would
    /// only make them wait longer.
    pub fn since(&self) -> Option<MonotonicNs> {
        self.since
    }

    /// Whether no row waits.
    pub fn is_empty(&self) -> bool {
        self.rows == 0
    }
}

/// How many bytes of `text` are whole rows.
pub fn whole_rows(text: &[u8]) -> usize {
    let last = text.iter().rposition(|byte| *byte == b'\n');
    last.map_or(0, |end| end + 1)
}

fn count_rows(text: &[u8]) -> u64 {
    text.iter().filter(|byte| **byte == b'\n').count() as u64
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    const START: MonotonicNs = MonotonicNs(1_000);

    fn gathered(rows: &[&str]) -> Gathered {
        let mut gathered = Gathered::default();
        for row in rows {
            assert!(gathered.push(START, |text| text.extend_from_slice(row.as_bytes())));
        }
        gathered
    }

    #[test]
    fn only_whole_rows_fit() {
        let gathered = gathered(&["one\n", "four\n", "5\n"]);
        for (room, expected) in [
            (0, ""),
            (3, ""),
            (4, "one\n"),
            (8, "one\n"),
            (9, "one\nfour\n"),
            (10, "one\nfour\n"),
            (11, "one\nfour\n5\n"),
            (u64::MAX, "one\nfour\n5\n"),
        ] {
            assert_eq!(gathered.fitting(room), expected.as_bytes(), "{room}");
        }
        assert_eq!(gathered.oldest(), b"one\n");
        assert_eq!(Gathered::default().oldest(), b"");
        assert_eq!(whole_rows(b"one\ntw"), 4);
    }

    #[test]
    fn the_oldest_go_first() {
        let mut gathered = gathered(&["one\n", "four\n", "5\n"]);
        assert_eq!(gathered.forget(9), 2);
        assert_eq!((gathered.bytes(), gathered.since()), (2, Some(START)));
        assert_eq!(gathered.clear(), 1);
        assert!(gathered.is_empty() && gathered.since().is_none());
    }

    #[test]
    fn beyond_the_bound_the_newest_are_refused_until_there_is_room() {
        let row = [[b'x'; 99].as_slice(), b"\n"].concat();
        let mut gathered = Gathered::default();
        let push = |gathered: &mut Gathered| {
            gathered.push(START + Duration::from_secs(1), |text| {
                text.extend_from_slice(&row);
            })
        };
        let mut taken = 0;
        while push(&mut gathered) {
            taken += 1;
        }
        assert_eq!(taken, MAX_GATHERED_BYTES / 100);
        assert_eq!(gathered.bytes(), taken * 100);
        assert!(!push(&mut gathered));
        gathered.forget(100);
        assert!(push(&mut gathered) && !push(&mut gathered));
    }
}
