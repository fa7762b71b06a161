//! The ending of an unfinished file: what readers need to open it, and how it gives way to the next chunk.
//!
//! Behind the last chunk lies a filler, a record that readers skip, which reaches to the ending at the file's end:
//!
//! ```text
//! … chunk │ filler: length L ······································ │ ending      what the file is after a flush
//! … chunk │ filler: length L (rest of a chunk, head of a filler) ·· │ ending      1. within the filler's content
//! … chunk │ chunk │ filler: length less ··························· │ ending      2. nine bytes: head of the chunk, not of a filler
//! ```
//!
//! After each of the steps, and within the first one, the file is whole for every reader, from whichever end it begins.
//! The second step lies in one page, within which the kernel does not stop a killed process. The filler's content takes
//! no room on the disk before it is written.
//!
//! When a chunk does not fit, the file is extended first: the next ending at its place, then the filler's new length.
//! Between these two, readers stop at the former ending, and some complain of what is behind it. That is a few µs for
//! each [`EXTENT`].

/// Opcode of a filler: a record of the range for applications, which readers skip.
pub(crate) const FILLER: u8 = 0x80;

/// Length of a record's head, bytes: opcode and length of the rest.
pub(crate) const HEAD_LEN: usize = 9;

/// Length of an ending, bytes.
pub(crate) const ENDING_LEN: usize = 50;

/// By how much a file is extended at most, bytes. Smaller files are doubled. Endings are the last bytes of a page.
pub(crate) const EXTENT: u64 = 1 << 20;

/// The shortest file, bytes: room for the schemas of some topics.
const MIN_FILE_LEN: u64 = 64 << 10;

/// Pages have at least this many bytes.
const PAGE_LEN: u64 = 4096;

/// An ending without a summary: the data's end without a checksum, a footer of zeros, the mark.
#[rustfmt::skip]
pub(crate) const ENDING: [u8; ENDING_LEN] = [
    0x0f, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
    0x02, 20, 0, 0, 0, 0, 0, 0, 0,
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
    0x89, b'M', b'C', b'A', b'P', 0x30, b'\r', b'\n',
];

/// Where the ending of a file with this many bytes begins.
pub(crate) fn ending_at(file_len: u64) -> u64 {
    file_len - ENDING_LEN as u64
}

/// Bytes of a file in which `len` bytes of data, the head of a filler and an ending have room.
pub(crate) fn file_len_for(len: u64) -> u64 {
    let needed = len + (HEAD_LEN + ENDING_LEN) as u64;
    if needed <= EXTENT {
        needed.next_power_of_two().max(MIN_FILE_LEN)
    } else {
        needed.next_multiple_of(EXTENT)
    }
}

/// The head of a filler that lies at `at` and reaches to the ending of a file with `file_len` bytes.
pub(crate) fn filler_head(at: u64, file_len: u64) -> [u8; HEAD_LEN] {
    let len = ending_at(file_len) - at - HEAD_LEN as u64;
    let mut head = [FILLER; HEAD_LEN];
    head[1..].copy_from_slice(&len.to_le_bytes());
    head
}

/// Length of the content of a filler that has to stand at `position`, if any, so that the head of the next record does
/// not cross a page's border.
pub(crate) fn padding(position: u64) -> Option<usize> {
    let crosses = |begin: u64| begin % PAGE_LEN > PAGE_LEN - HEAD_LEN as u64;
    // Behind a filler without content, the next head lies in the next page.
    crosses(position).then_some(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ending_is_what_the_library_takes_for_one() {
        use mcap::records::{Footer, Record};
        let footer = &ENDING[13 + HEAD_LEN..ENDING_LEN - mcap::MAGIC.len()];
        let footer = mcap::parse_record(ENDING[13], footer).unwrap();
        assert!(matches!(footer, Record::Footer(footer) if footer == Footer::default()));
        let end = mcap::parse_record(ENDING[0], &ENDING[HEAD_LEN..13]).unwrap();
        assert!(matches!(end, Record::DataEnd(end) if end.data_section_crc == 0));
        assert!(ENDING.ends_with(mcap::MAGIC));
    }

    #[test]
    fn no_head_crosses_a_page() {
        for position in 0..3 * PAGE_LEN {
            let padded = padding(position).map_or(0, |content| HEAD_LEN + content) as u64;
            let (first, last) = (position + padded, position + padded + HEAD_LEN as u64 - 1);
            assert_eq!(first / PAGE_LEN, last / PAGE_LEN, "{position}");
        }
    }

    #[test]
    fn a_filler_reaches_to_the_ending() {
        let room = (HEAD_LEN + ENDING_LEN) as u64;
        for (len, expected) in [
            (0, MIN_FILE_LEN),
            (MIN_FILE_LEN, 2 * MIN_FILE_LEN),
            (EXTENT - room, EXTENT),
            (EXTENT - room + 1, 2 * EXTENT),
        ] {
            assert_eq!(file_len_for(len), expected);
            let head = filler_head(len, expected);
            let content = u64::from_le_bytes(*head.last_chunk().unwrap());
            let end = len + HEAD_LEN as u64 + content + ENDING_LEN as u64;
            assert_eq!((head[0], end), (FILLER, expected));
        }
    }
}
