//! Files whose chunks are compressed, as other programs write them: what is known is read, what is not is named, and
//! nothing expands without end.

use std::io::{Cursor, Write};

use lz4_flex::frame::FrameEncoder;
use proptest::prelude::*;
use recording::read::{ReadError, check, messages, recover, summary_of};
use ruzstd::encoding::{CompressionLevel, compress_to_vec};

use crate::stock;

const MESSAGES: u32 = 40;

/// A file without compression, in chunks of some messages.
fn plain() -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let options = mcap::WriteOptions::new().chunk_size(Some(300));
    let mut writer = options.create(&mut bytes).unwrap();
    let schema = writer
        .add_schema("a/msg/A", "ros2msg", b"uint8[40] a\n")
        .unwrap();
    let channel = writer.add_channel(schema, "/a", "cdr", &[].into()).unwrap();
    for sequence in 1..=MESSAGES {
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence,
            log_time: u64::from(sequence),
            publish_time: u64::from(sequence),
        };
        writer
            .write_to_known_channel(&header, &[sequence as u8; 40])
            .unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    bytes.into_inner()
}

fn zstd(records: &[u8]) -> Vec<u8> {
    compress_to_vec(records, CompressionLevel::Fastest)
}

fn lz4(records: &[u8]) -> Vec<u8> {
    let mut encoder = FrameEncoder::new(Vec::new());
    encoder.write_all(records).unwrap();
    encoder.finish().unwrap()
}

/// The file with each chunk written anew: `compress` gives its records, `expanded` the length that its head names.
fn compressed(
    bytes: &[u8],
    name: &str,
    compress: impl Fn(&[u8]) -> Vec<u8>,
    expanded: impl Fn(usize) -> u64,
) -> Vec<u8> {
    let (mut new, mut at, mut is_summary) = (mcap::MAGIC.to_vec(), mcap::MAGIC.len(), false);
    let u64_at = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
    while at < bytes.len() - mcap::MAGIC.len() {
        let end = at + 9 + u64_at(at + 1) as usize;
        if bytes[at] == 6 {
            // Times, length and checksum; the length of an empty name; the length of the records.
            let records = &bytes[at + 9 + 40..end];
            let packed = compress(records);
            new.push(6);
            new.extend((40 + name.len() as u64 + packed.len() as u64).to_le_bytes());
            new.extend(&bytes[at + 9..at + 25]);
            new.extend(expanded(records.len()).to_le_bytes());
            new.extend(&bytes[at + 33..at + 37]);
            new.extend((name.len() as u32).to_le_bytes());
            new.extend(name.as_bytes());
            new.extend((packed.len() as u64).to_le_bytes());
            new.extend(packed);
        } else if bytes[at] == 2 {
            // A footer without a summary, whose places would be wrong.
            new.push(2);
            new.extend(20_u64.to_le_bytes());
            new.extend([0; 20]);
        } else if bytes[at] != 7 && !is_summary {
            new.extend(&bytes[at..end]);
        }
        is_summary |= bytes[at] == 0x0f;
        at = end;
    }
    new.extend(mcap::MAGIC);
    new
}

#[test]
fn what_is_compressed_is_read_checked_and_recovered_like_what_is_not() {
    let plain = plain();
    let expected = stock::ours(&plain);
    assert_eq!(expected.len(), MESSAGES as usize);
    let both_frames = |records: &[u8]| {
        let (first, second) = records.split_at(records.len() / 2);
        [zstd(first), zstd(second)].concat()
    };
    type Packer<'a> = &'a dyn Fn(&[u8]) -> Vec<u8>;
    let packers: [(_, Packer); 3] = [("zstd", &zstd), ("lz4", &lz4), ("zstd", &both_frames)];
    for (name, packer) in packers {
        let file = compressed(&plain, name, packer, |len| len as u64);
        assert_eq!(stock::ours(&file), expected, "{name}");
        let facts = check(&file);
        // Only its summary was left out.
        assert_eq!(facts.errors, [ReadError::Unfinished], "{name}");
        assert!(facts.whole_chunks > 3);
        let mut whole = Vec::new();
        assert_eq!(
            recover(&file, &mut whole).unwrap().messages,
            u64::from(MESSAGES)
        );
        assert_eq!(stock::all(&whole), expected, "{name}");
        assert!(check(&whole).is_complete);
        assert_eq!(
            summary_of(&file).unwrap().topics["/a"].1,
            u64::from(MESSAGES)
        );
    }
}

/// The length of a record is damaged, so that the next chunk has to be found by its checksum.
#[test]
fn behind_damage_a_compressed_chunk_is_found() {
    for (name, packer) in [("zstd", zstd as fn(&[u8]) -> Vec<u8>), ("lz4", lz4)] {
        let mut file = compressed(&plain(), name, packer, |len| len as u64);
        let all = messages(&file).flatten().count();
        // The first one describes the channel.
        let mut chunks = (0..file.len())
            .filter(|at| file[*at..].starts_with(b"\x06") && file[at + 4..at + 9] == [0; 5]);
        let chunk = chunks.nth(1).unwrap();
        file[chunk + 8] = 0x7f;
        let left = messages(&file).flatten().count();
        assert!((all / 2..all).contains(&left), "{name}: {left} of {all}");
    }
}

#[test]
fn an_unknown_compression_is_named_once_and_is_no_damage() {
    for name in ["brotli", "\u{1b}[31m"] {
        let file = compressed(&plain(), name, zstd, |len| len as u64);
        let errors = check(&file).errors;
        assert_eq!(
            errors,
            [
                ReadError::Compressed(name.to_owned()),
                ReadError::Unfinished
            ]
        );
        assert!(errors[0].is_unsupported());
        assert!(!errors[0].to_string().contains('\u{1b}'));
        assert_eq!(recover(&file, &mut Vec::new()).unwrap().messages, 0);
    }
}

/// 64 MiB and more of zeros, in some kilobytes.
#[test]
fn nothing_expands_to_more_than_is_said_and_supported() {
    let zeros = vec![0; 65 << 20];
    for (name, packer) in [("zstd", zstd as fn(&[u8]) -> Vec<u8>), ("lz4", lz4)] {
        let bomb = packer(&zeros);
        let honest = compressed(&plain(), name, |_| bomb.clone(), |_| zeros.len() as u64);
        let errors = check(&honest).errors;
        let bytes = zeros.len() as u64;
        assert_eq!(
            errors,
            [ReadError::TooLong { bytes }, ReadError::Unfinished]
        );
        for said in [0, 1000, u64::MAX] {
            let lying = compressed(&plain(), name, |_| bomb.clone(), |_| said);
            assert_eq!(messages(&lying).flatten().count(), 0);
        }
    }
}

proptest! {
    #[test]
    fn changed_bytes_of_compressed_chunks_do_no_harm(
        with_lz4: bool,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..20),
    ) {
        let (name, packer) = if with_lz4 { ("lz4", lz4 as fn(&[u8]) -> Vec<u8>) } else { ("zstd", zstd as _) };
        let mut bytes = compressed(&plain(), name, packer, |len| len as u64);
        for (index, byte) in changes {
            let at = index.index(bytes.len());
            bytes[at] = byte;
        }
        let count = messages(&bytes).flatten().count();
        let _ = check(&bytes);
        let mut whole = Vec::new();
        if let Ok(recovered) = recover(&bytes, &mut whole) {
            prop_assert_eq!(recovered.messages as usize, count);
        }
    }
}
