//! [`Encoder`]: messages as the bytes of a file, flush by flush. The records are made by the crate `mcap`; where their
//! bytes go, and in which order, is [`ending`](crate::ending)'s.

use std::sync::mpsc::{Receiver, channel};

use ipc_types::MonotonicNs;
use mcap::records::{MessageHeader, Metadata};
use mcap::{McapResult, WriteOptions, Writer};

use crate::action::Part;
use crate::ending::{ENDING, FILLER, HEAD_LEN, ending_at, file_len_for, filler_head, padding};
use crate::queue::QueuedMessage;
use crate::settings::{Anchor, Channel, FlightInfo};
use crate::sink::{Counted, Flushes};

/// Name of the conventions by which topics and schemas are written.
const PROFILE: &str = "ros2";

/// How files of recordings are written: not compressed, so that a reader can point at messages where they lie.
pub(crate) fn write_options() -> WriteOptions {
    WriteOptions::new()
        .profile(PROFILE)
        .library(concat!("hero-ril/", env!("CARGO_PKG_VERSION")))
        .compression(None)
        .disable_seeking(true)
}

/// A file in the making.
pub(crate) struct Encoder {
    writer: Writer<Counted<Flushes>>,
    flushed: Receiver<Vec<u8>>,
    anchor: Anchor,
    /// What the file says of the flight.
    info: FlightInfo,
    /// Bytes that were made.
    len: u64,
    /// Bytes of the file, its filler and ending included.
    file_len: u64,
    /// Ids in the file and the latest time, by [`ChannelId`](crate::ChannelId).
    channels: Vec<(u16, u64)>,
    /// The latest time in the file.
    latest_ns: u64,
    chunks: u32,
}

impl Encoder {
    /// A file that has no messages yet, and what is to be written.
    ///
    /// The recording began at `begun`: what a topic had published before is logged at that time.
    pub(crate) fn begin(
        anchor: Anchor,
        begun: MonotonicNs,
        info: FlightInfo,
        channels: &[Channel],
    ) -> McapResult<(Encoder, Vec<Part>)> {
        let (flushes, flushed) = channel();
        let options = write_options().chunk_size(None);
        let mut encoder = Encoder {
            writer: options.create(Counted::new(Flushes::new(flushes)))?,
            flushed,
            anchor,
            info: FlightInfo::of_nothing(info.robot),
            len: 0,
            file_len: 0,
            channels: Vec::new(),
            latest_ns: anchor.unix_ns_of(begun),
            chunks: 0,
        };
        encoder.describe(&info, anchor.unix_ns)?;
        encoder.add_channels(channels)?;
        let mut bytes = encoder.flush()?;
        encoder.file_len = file_len_for(encoder.len);
        bytes.extend(filler_head(encoder.len, encoder.file_len));
        let ending = part(ending_at(encoder.file_len), &ENDING);
        Ok((encoder, vec![Part { at: 0, bytes }, ending]))
    }

    /// Bytes of records in the file when all that was given is written. Filler and ending are not counted.
    pub(crate) fn len(&self) -> u64 {
        self.len
    }

    /// Chunks in the file.
    pub(crate) fn chunks(&self) -> u32 {
        self.chunks
    }

    /// Puts messages into a chunk of their own. They are ordered by time, each topic's in its own order; where that
    /// would go back behind an earlier chunk, `log_time` stands still.
    pub(crate) fn chunk<'a>(
        &mut self,
        channels: &[Channel],
        entries: impl Iterator<Item = &'a QueuedMessage>,
    ) -> McapResult<Vec<Part>> {
        self.add_channels(channels)?;
        let mut ordered: Vec<_> = entries
            .map(|entry| (self.in_order_of_topic(entry), entry))
            .collect();
        ordered.sort_by_key(|(time_ns, _)| *time_ns);
        for (time_ns, entry) in ordered {
            self.latest_ns = self.latest_ns.max(time_ns);
            let (channel_id, _) = self.channels[usize::from(entry.channel.0)];
            let header = MessageHeader {
                channel_id,
                sequence: entry.sequence,
                log_time: self.latest_ns,
                publish_time: self.anchor.unix_ns_of(entry.at),
            };
            self.writer.write_to_known_channel(&header, &entry.data)?;
        }
        let before = self.len;
        let mut bytes = self.flush()?;
        let mut parts = self.extend(before);
        bytes.extend(filler_head(self.len, self.file_len));
        replace_filler(before, bytes, &mut parts);
        Ok(parts)
    }

    /// The rest of the file, which has `len` bytes then; what is behind these is to be cut off.
    pub(crate) fn finish(mut self) -> McapResult<(u64, Vec<Part>)> {
        let before = self.len;
        self.writer.finish()?;
        let rest = self.writer.into_inner().into_inner().into_buffer();
        let mut bytes: Vec<u8> = self.flushed.try_iter().flatten().collect();
        bytes.extend(rest);
        let len = before + bytes.len() as u64;
        let (_, mut parts) = extension(before, len, self.file_len);
        replace_filler(before, bytes, &mut parts);
        Ok((len, parts))
    }

    /// Extends the file if what was made does not fit. The filler lies at `filler_at`.
    fn extend(&mut self, filler_at: u64) -> Vec<Part> {
        let (file_len, parts) = extension(filler_at, self.len, self.file_len);
        self.file_len = file_len;
        parts
    }

    /// Writes what the file does not say of the flight yet.
    pub(crate) fn describe(&mut self, info: &FlightInfo, unix_ns: u64) -> McapResult<()> {
        let news = info.since(&self.info);
        for (name, metadata) in &news.metadata {
            self.writer.write_metadata(&Metadata {
                name: name.clone(),
                metadata: metadata.clone(),
            })?;
        }
        for attachment in &news.attachments {
            self.writer.attach(&mcap::Attachment {
                log_time: unix_ns,
                create_time: unix_ns,
                name: attachment.name.clone(),
                media_type: attachment.media_type.clone(),
                data: attachment.data.as_slice().into(),
            })?;
        }
        self.info.metadata.extend(news.metadata);
        self.info.attachments.extend(news.attachments);
        Ok(())
    }

    fn add_channels(&mut self, channels: &[Channel]) -> McapResult<()> {
        for channel in channels.iter().skip(self.channels.len()) {
            let Channel {
                topic,
                schema_name,
                schema_text,
                metadata,
            } = channel;
            let encoding = ipc_types::schema::ENCODING;
            let schema = schema_text.as_bytes();
            let schema = self.writer.add_schema(schema_name, encoding, schema)?;
            let id = self.writer.add_channel(schema, topic, "cdr", metadata)?;
            self.channels.push((id, 0));
        }
        Ok(())
    }

    /// The time by which a message lies in the file: its own, but not before earlier messages of its topic.
    fn in_order_of_topic(&mut self, entry: &QueuedMessage) -> u64 {
        let time_ns = self.anchor.unix_ns_of(entry.at);
        let (_, latest_ns) = &mut self.channels[usize::from(entry.channel.0)];
        *latest_ns = time_ns.max(*latest_ns);
        *latest_ns
    }

    /// Ends the chunk, and gives all bytes since the last time.
    fn flush(&mut self) -> McapResult<Vec<u8>> {
        self.writer.flush()?;
        let mut bytes: Vec<u8> = self.flushed.try_iter().flatten().collect();
        if let Some(len) = padding(self.len + bytes.len() as u64) {
            let content = vec![0; len];
            let options = Default::default();
            self.writer
                .write_private_record(FILLER, &content, options)?;
            self.writer.flush()?;
            bytes.extend(self.flushed.try_iter().flatten());
        }
        self.len += bytes.len() as u64;
        self.chunks += 1;
        Ok(bytes)
    }
}

fn part(at: u64, bytes: &[u8]) -> Part {
    Part {
        at,
        bytes: bytes.to_vec(),
    }
}

/// What makes room for `len` bytes in a file with `file_len` bytes, whose filler lies at `filler_at`: its length then,
/// and the parts.
fn extension(filler_at: u64, len: u64, file_len: u64) -> (u64, Vec<Part>) {
    let needed = file_len_for(len);
    if needed <= file_len {
        return (file_len, Vec::new());
    }
    let ending = part(ending_at(needed), &ENDING);
    (
        needed,
        vec![ending, part(filler_at, &filler_head(filler_at, needed))],
    )
}

/// Puts records at the place of the filler: first all but the head, within the filler, and then the head.
fn replace_filler(filler_at: u64, mut records: Vec<u8>, parts: &mut Vec<Part>) {
    let rest = records.split_off(HEAD_LEN.min(records.len()));
    let rest_at = filler_at + HEAD_LEN as u64;
    parts.push(Part {
        at: rest_at,
        bytes: rest,
    });
    parts.push(Part {
        at: filler_at,
        bytes: records,
    });
}

impl std::fmt::Debug for Encoder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Encoder { len, chunks, .. } = self;
        write!(f, "Encoder {{ len: {len}, chunks: {chunks} }}")
    }
}
