//! Bytes that no recorder wrote: nothing panics, and nothing grows beyond the file.

use std::fs::File;
use std::io::{Cursor, Write};
use std::path::Path;
use std::time::Duration;

use proptest::prelude::*;
use recording::Settings;
use recording::play::PlayableFlight;
use recording::read::{ReadError, RecordFile, check, messages, recover, summary_of};

use crate::session::Session;
use crate::stock;

fn file(ends: bool) -> Vec<u8> {
    let mut session = Session::new(Settings::default(), 2);
    for index in 0..60 {
        session.add(index % 2, index);
        session.settle();
        session.pass(Duration::from_millis(50));
    }
    if ends {
        session.end();
    }
    session.disk.files.remove(0)
}

/// Everything that reads; what they find does not matter.
fn read(bytes: &[u8]) {
    let count = messages(bytes).flatten().count();
    let _ = check(bytes);
    let _ = summary_of(bytes);
    let mut whole = Vec::new();
    if let Ok(recovered) = recover(bytes, &mut whole) {
        assert_eq!(recovered.messages as usize, count);
        assert_eq!(stock::all(&whole).len(), count);
    }
}

proptest! {
    #[test]
    fn changed_bytes_do_no_harm(
        ends: bool,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..20),
        cut in any::<prop::sample::Index>(),
    ) {
        let mut bytes = file(ends);
        for (index, byte) in changes {
            let at = index.index(bytes.len());
            bytes[at] = byte;
        }
        read(&bytes);
        bytes.truncate(cut.index(bytes.len()));
        read(&bytes);
    }

    #[test]
    fn lengths_that_cannot_be_do_no_harm(
        ends: bool,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u64>()), 1..6),
    ) {
        let mut bytes = file(ends);
        for (index, number) in changes {
            let at = index.index(bytes.len() - 8);
            bytes[at..at + 8].copy_from_slice(&number.to_le_bytes());
        }
        read(&bytes);
    }

    #[test]
    fn any_bytes_do_no_harm(mut bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
        read(&bytes);
        bytes.splice(0..0, mcap::MAGIC.iter().copied());
        read(&bytes);
    }
}

#[test]
fn a_damaged_chunk_costs_its_messages_and_no_others() {
    let bytes = file(true);
    let all = messages(&bytes).count();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    // The first one has no messages, but describes the channels, as the summary does.
    for index in summary.chunk_indexes {
        let mut damaged = bytes.clone();
        let chunk =
            &mut damaged[index.chunk_start_offset as usize..][..index.chunk_length as usize];
        let last = chunk.len() - 1;
        chunk[last] ^= 1;
        let check = check(&damaged);
        assert_eq!(check.errors.len(), 1, "{:?}", check.errors);
        let found = messages(&damaged).flatten().count();
        assert!(found < all || index.message_end_time == 0);
        // Without the chunk's length, the next chunk is searched.
        let begin = index.chunk_start_offset as usize;
        damaged[begin..begin + 9].fill(0);
        assert_eq!(messages(&damaged).flatten().count(), found);
    }
}

#[test]
fn a_file_behind_a_file_is_named_and_read() {
    let one = file(true);
    let count = messages(&one[..]).flatten().count();
    // The summary of the last one may seem to belong to the first, if it is as long or longer.
    let mut longer = Session::new(Settings::default(), 2);
    for index in 0..300 {
        longer.add(index % 2, index);
        longer.settle();
        longer.pass(Duration::from_millis(50));
    }
    longer.end();
    let longer = longer.disk.files.remove(0);
    for (first, second, all) in [
        (&one, &one, 2 * count),
        (&one, &longer, count + 300),
        (&longer, &one, count + 300),
    ] {
        let both = [&first[..], second].concat();
        assert!(!check(&both[..]).is_complete);
        assert_eq!(messages(&both[..]).flatten().count(), all);
        let mut whole = Vec::new();
        let recovered = recover(&both[..], &mut whole).unwrap();
        assert_eq!(
            (recovered.messages as usize, stock::all(&whole).len()),
            (all, all)
        );
        assert!(!recovered.errors.is_empty());
    }
    // Of a writer that sums up nothing.
    let bare = || {
        let mut bytes = Cursor::new(Vec::new());
        let options = mcap::WriteOptions::new()
            .calculate_chunk_crcs(false)
            .compression(None);
        let mut writer = options.create(&mut bytes).unwrap();
        let channel = writer.add_channel(0, "a", "", &Default::default()).unwrap();
        for sequence in 0..7 {
            let header = mcap::records::MessageHeader {
                channel_id: channel,
                sequence,
                log_time: 1,
                publish_time: 1,
            };
            writer.write_to_known_channel(&header, &[1, 2, 3]).unwrap();
        }
        writer.finish().unwrap();
        drop(writer);
        bytes.into_inner()
    };
    let both = [bare(), bare()].concat();
    assert_eq!(
        (
            check(&both[..]).errors.len(),
            messages(&both[..]).flatten().count()
        ),
        (1, 14)
    );
}

#[test]
fn what_is_no_mcap_file_is_named() {
    for bytes in [&b""[..], b"x", b"\x89MCAP1\r\n", b"PK\x03\x04"] {
        assert_eq!(check(bytes).errors, [ReadError::NotMcap]);
        assert_eq!(summary_of(bytes), Err(ReadError::NotMcap));
        assert_eq!(recover(bytes, &mut Vec::new()), Err(ReadError::NotMcap));
    }
}

/// A file that looks like a chunk everywhere would be summed up for hours without a bound.
#[test]
fn searching_ends() {
    let mut bytes = mcap::MAGIC.to_vec();
    let len = 1 << 20;
    while bytes.len() < len {
        let rest = (len - bytes.len() + 4096) as u64;
        bytes.push(6);
        bytes.extend((rest + 40).to_le_bytes());
        bytes.extend([0; 16]);
        bytes.extend(rest.to_le_bytes());
        bytes.extend(1_u32.to_le_bytes());
        bytes.extend(0_u32.to_le_bytes());
        bytes.extend(rest.to_le_bytes());
    }
    bytes.resize(3 * len, 0);
    assert_eq!(messages(&bytes).flatten().count(), 0);
}

/// A summary that names one large attachment again and again would fill the memory without a bound.
#[test]
fn a_summary_names_no_more_than_the_file_has() {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = mcap::Writer::new(&mut bytes).unwrap();
    for _ in 0..3 {
        let attachment = mcap::Attachment {
            log_time: 1,
            create_time: 1,
            name: "large".to_owned(),
            media_type: "text/plain".to_owned(),
            data: vec![7; 100_000].into(),
        };
        writer.attach(&attachment).unwrap();
    }
    let indexes = writer.finish().unwrap().attachment_indexes;
    drop(writer);
    let mut bytes = bytes.into_inner();
    assert_eq!(summary_of(&bytes).unwrap().attachments.len(), 3);
    // All indexes begin with the place and the length; each names the whole file now.
    let len = (bytes.len() as u64).to_le_bytes();
    for index in indexes {
        let [at, old_len] = [index.offset, index.length].map(u64::to_le_bytes);
        let place = bytes
            .windows(16)
            .position(|window| window == [at, old_len].concat());
        let place = place.expect("an index");
        bytes[place + 8..place + 16].copy_from_slice(&len);
    }
    let error = summary_of(&bytes).unwrap_err();
    assert!(
        error.to_string().contains("more than the file has"),
        "{error}"
    );
}

/// A device may have no end, and a pipe may never have a writer.
#[test]
fn what_is_no_regular_file_is_not_read() {
    for path in ["/dev/null", "/"] {
        let error = RecordFile::open(Path::new(path)).unwrap_err();
        assert!(error.to_string().contains("no regular file"), "{error}");
    }
}

/// The memory of no machine has room for such a file, which takes none on the disk.
#[test]
fn a_file_that_is_larger_than_the_memory_is_played_by_nobody_and_searched_in_no_time() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.mcap");
    let mut file = File::create_new(&path).unwrap();
    file.write_all(mcap::MAGIC).unwrap();
    file.set_len(1 << 43).unwrap();
    let refused = PlayableFlight::open(&path).unwrap_err().to_string();
    assert!(refused.contains("8796094 MB"), "{refused}");
    let file = RecordFile::open(&path).unwrap();
    assert_eq!(check(&file).errors, [ReadError::Truncated { at: 8 }]);
    // A summary that begins at the file's beginning.
    let footer = [&[2, 20][..], &[0; 7], &8_u64.to_le_bytes(), &[0; 12]].concat();
    let mut file = File::options().append(true).open(&path).unwrap();
    file.write_all(&[&footer, mcap::MAGIC].concat()).unwrap();
    let error = summary_of(&RecordFile::open(&path).unwrap()).unwrap_err();
    assert!(error.to_string().contains("cannot be"), "{error}");
}

#[test]
fn whatever_is_damaged_before_a_chunk_the_chunk_is_found() {
    for ends in [false, true] {
        let bytes = file(ends);
        let all = messages(&bytes).flatten().count();
        // The mark, the header, the length of a record on the way.
        for at in 0..40 {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x55;
            assert_eq!(messages(&damaged).flatten().count(), all, "{at}");
            assert!(!check(&damaged).is_complete || at >= 8, "{at}");
            let mut whole = Vec::new();
            let recovered = recover(&damaged, &mut whole).unwrap();
            assert_eq!(recovered.messages as usize, all);
            assert_eq!(stock::all(&whole).len(), all);
        }
        // Another program has emptied the file while it was written: what came before is a hole.
        let mut cut = bytes.clone();
        let half = bytes.len() / 2;
        cut[..half].fill(0);
        assert_eq!(
            messages(&cut).flatten().count() > 0,
            ends,
            "the summary describes the channels"
        );
    }
}

#[test]
fn a_length_that_leads_too_far_costs_nothing_but_itself() {
    let bytes = file(true);
    let all = messages(&bytes).flatten().count();
    let chunks = mcap::Summary::read(&bytes).unwrap().unwrap().chunk_indexes;
    // The index of messages behind a chunk is no chunk; its length now reaches over the next ones.
    let behind = chunks[1].chunk_start_offset + chunks[1].chunk_length;
    let at = behind as usize;
    let mut damaged = bytes.clone();
    assert_eq!(damaged[at], 7);
    damaged[at + 1..at + 9].copy_from_slice(&3000_u64.to_le_bytes());
    assert_eq!(messages(&damaged).flatten().count(), all);
}
