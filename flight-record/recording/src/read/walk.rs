//! [`Walk`]: one pass through a file, from its beginning to its end, over damaged places; [`Search`]: where the next whole chunk lies
//! behind one.

use std::collections::{BTreeMap, HashMap};

use mcap::records::op;

use super::message::{Message, ReadError};
use super::record::{
    self, AttachmentRecord, ChannelRecord, ChunkRecord, FOOTER_LEN, Fields, MessageRecord, Record,
    SchemaRecord, summary, summary_start,
};

/// How often the bytes of a file are summed up at most, while chunks are searched. A damaged file needs one; a file that was
/// made to look like chunks everywhere could take hours.
const MAX_SUMS: usize = 4;

/// All messages in the order of the file, events of the recording included. Damage is one error; what follows is the next whole
/// chunk. That a file was not finished is no error here.
pub fn messages(bytes: &[u8]) -> impl Iterator<Item = Result<Message<'_>, ReadError>> {
    Walk::new(bytes).filter_map(|item| match item {
        Item::Message(message, _) => Some(Ok(message)),
        Item::Error(error) => Some(Err(error)),
        Item::Chunk | Item::Metadata(..) | Item::Attachment(_) => None,
    })
}

/// What a file has at a place.
#[derive(Debug)]
pub(super) enum Item<'a> {
    /// A message, and the number of its channel in [`Walk::channel`].
    Message(Message<'a>, usize),
    /// A chunk begins that is whole.
    Chunk,
    Metadata(String, BTreeMap<String, String>),
    Attachment(AttachmentRecord<'a>),
    Error(ReadError),
}

/// A channel and its schema.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ChannelFacts<'a> {
    pub(super) channel: ChannelRecord<'a>,
    pub(super) schema: SchemaRecord<'a>,
}

impl ChannelFacts<'_> {
    /// Texts by key.
    pub(super) fn metadata(&self) -> BTreeMap<String, String> {
        Fields(self.channel.metadata).map().unwrap_or_default()
    }
}

/// One pass through a file.
pub(super) struct Walk<'a> {
    bytes: &'a [u8],
    /// Where the next record of the file lies.
    position: usize,
    /// What is left of the present chunk, and where it began.
    chunk: Option<(&'a [u8], usize)>,
    schemas: HashMap<u16, SchemaRecord<'a>>,
    /// The present meaning of a channel's id.
    numbers: HashMap<u16, usize>,
    channels: Vec<ChannelFacts<'a>>,
    search: Search<'a>,
    /// Behind the last record that was read.
    end: usize,
    is_done: bool,
    is_finished: bool,
}

impl<'a> Walk<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Walk<'a> {
        let mut walk = Walk {
            bytes,
            position: mcap::MAGIC.len(),
            chunk: None,
            schemas: HashMap::new(),
            numbers: HashMap::new(),
            channels: Vec::new(),
            search: Search::new(bytes),
            end: 0,
            is_done: false,
            is_finished: false,
        };
        // A chunk that is damaged may have described channels of later ones; the summary describes all of them.
        let mut rest = summary(bytes).unwrap_or_default();
        while let Some(record) = Record::first(rest) {
            walk.describe(record);
            rest = &rest[record.len()..];
        }
        walk
    }

    /// The channel with the number that came with a message.
    pub(super) fn channel(&self, number: usize) -> Option<&ChannelFacts<'a>> {
        self.channels.get(number)
    }

    /// Whether the file was finished. Known when all was read.
    pub(super) fn is_finished(&self) -> bool {
        self.is_finished
    }

    /// Bytes behind the last record that was read. Known when all was read.
    pub(super) fn bytes_behind(&self) -> usize {
        self.bytes.len() - self.end
    }

    /// Takes note of a schema or a channel; `None` if it is neither, or cannot be.
    fn describe(&mut self, record: Record<'a>) -> Option<()> {
        match record.opcode {
            op::SCHEMA => {
                let (id, schema) = record::schema(record.content)?;
                self.schemas.insert(id, schema);
            }
            op::CHANNEL => {
                let (id, channel) = record::channel(record.content)?;
                let schema = match channel.schema_id {
                    0 => SchemaRecord::default(),
                    schema_id => *self.schemas.get(&schema_id)?,
                };
                let facts = ChannelFacts { channel, schema };
                let known = self.numbers.get(&id);
                if known.is_none_or(|number| self.channels[*number] != facts) {
                    self.numbers.insert(id, self.channels.len());
                    self.channels.push(facts);
                }
            }
            _ => return None,
        }
        Some(())
    }

    fn message(&self, record: MessageRecord<'a>) -> Option<Item<'a>> {
        let number = *self.numbers.get(&record.channel_id)?;
        let ChannelFacts { channel, schema } = self.channels.get(number)?;
        let message = Message {
            topic: channel.topic,
            schema_name: schema.name,
            schema_text: std::str::from_utf8(schema.data).unwrap_or_default(),
            log_time_ns: record.log_time_ns,
            publish_time_ns: record.publish_time_ns,
            sequence: record.sequence,
            data: record.data,
        };
        Some(Item::Message(message, number))
    }

    /// The next item of the present chunk.
    fn next_in_chunk(&mut self) -> Option<Item<'a>> {
        loop {
            let (rest, began) = self.chunk?;
            if rest.is_empty() {
                self.chunk = None;
                return None;
            }
            let damaged = Item::Error(ReadError::damaged(began, "a record of a chunk cannot be"));
            let Some(record) = Record::first(rest) else {
                self.chunk = None;
                return Some(damaged);
            };
            self.chunk = Some((&rest[record.len()..], began));
            match record.opcode {
                op::MESSAGE => return Some(self.message_or_error(record, began)),
                op::SCHEMA | op::CHANNEL if self.describe(record).is_none() => {
                    return Some(damaged);
                }
                _ => {}
            }
        }
    }

    fn message_or_error(&self, record: Record<'a>, at: usize) -> Item<'a> {
        let message = record::message(record.content);
        let item = message.and_then(|message| self.message(message));
        let reason = "a message is of a channel that the file does not describe";
        item.unwrap_or_else(|| Item::Error(ReadError::damaged(at, reason)))
    }

    /// The next item outside of chunks; `None` if the record says nothing.
    fn next_record(&mut self) -> Option<Item<'a>> {
        let at = self.position;
        let record = Record::first(&self.bytes[at..]);
        let Some(record) = record.filter(Record::is_known) else {
            return self.lost(at, at + 1, "there is no record here");
        };
        self.position = at + record.len();
        self.end = self.position;
        match record.opcode {
            op::CHUNK => Some(self.begin_chunk(record, at)),
            op::MESSAGE => Some(self.message_or_error(record, at)),
            op::SCHEMA | op::CHANNEL => match self.describe(record) {
                Some(()) => None,
                None => self.damaged(at, "a schema or a channel cannot be"),
            },
            op::METADATA => match record::metadata(record.content) {
                Some((name, entries)) => Some(Item::Metadata(name, entries)),
                None => self.damaged(at, "a record of metadata cannot be"),
            },
            op::ATTACHMENT => match record::attachment(record.content) {
                Some(attachment) => Some(Item::Attachment(attachment)),
                None => self.damaged(at, "a file within the file is not what was written"),
            },
            op::DATA_END => self.end_of_data(),
            _ => None,
        }
    }

    fn damaged(&self, at: usize, reason: &'static str) -> Option<Item<'a>> {
        Some(Item::Error(ReadError::damaged(at, reason)))
    }

    fn begin_chunk(&mut self, record: Record<'a>, at: usize) -> Item<'a> {
        let Some(chunk) = record::chunk(record.content) else {
            return Item::Error(ReadError::damaged(at, "a chunk cannot be"));
        };
        let ChunkRecord {
            compression,
            records,
            ..
        } = chunk;
        if !compression.is_empty() {
            return Item::Error(ReadError::Compressed(compression.to_owned()));
        }
        if !chunk.is_sound() {
            let reason = "a chunk is not what was written";
            return Item::Error(ReadError::damaged(at, reason));
        }
        self.chunk = Some((records, at));
        Item::Chunk
    }

    /// Behind the data comes the summary of a finished file. Behind an ending without one, a chunk may lie that was about to
    /// become part of the file.
    fn end_of_data(&mut self) -> Option<Item<'a>> {
        let rest = &self.bytes[self.position..];
        let ending = rest.get(..FOOTER_LEN).and_then(summary_start);
        if ending == Some(0) {
            self.position += FOOTER_LEN;
            self.end = self.position;
            if self.position < self.bytes.len() {
                return self.lost(self.position, self.position, "a write was not finished");
            }
        } else if summary(self.bytes).is_some() {
            self.is_finished = true;
            self.end = self.bytes.len();
        } else {
            self.is_done = true;
            let at = self.position as u64;
            return Some(Item::Error(ReadError::Truncated { at }));
        }
        self.is_done = true;
        None
    }

    /// What is at `at` cannot be read: goes on with the next whole chunk, at `from` or behind.
    fn lost(&mut self, at: usize, from: usize, reason: &'static str) -> Option<Item<'a>> {
        match self.search.chunk_from(from) {
            Some(found) => {
                self.position = found;
                self.damaged(at, reason)
            }
            None => {
                self.is_done = true;
                let at = at as u64;
                Some(Item::Error(ReadError::Truncated { at }))
            }
        }
    }
}

impl<'a> Iterator for Walk<'a> {
    type Item = Item<'a>;

    fn next(&mut self) -> Option<Item<'a>> {
        if self.end == 0 && !self.is_done {
            if !self.bytes.starts_with(mcap::MAGIC) {
                self.is_done = true;
                return Some(Item::Error(ReadError::NotMcap));
            }
            self.end = self.position;
        }
        loop {
            if self.chunk.is_some() {
                if let Some(item) = self.next_in_chunk() {
                    return Some(item);
                }
                continue;
            }
            if self.is_done {
                return None;
            }
            if let Some(item) = self.next_record() {
                return Some(item);
            }
        }
    }
}

/// Searches chunks.
struct Search<'a> {
    bytes: &'a [u8],
    /// Bytes that may be summed up.
    budget: usize,
}

impl<'a> Search<'a> {
    fn new(bytes: &'a [u8]) -> Search<'a> {
        Search {
            bytes,
            budget: bytes.len().saturating_mul(MAX_SUMS),
        }
    }

    /// Where a chunk begins, at `from` or behind, whose checksum fits.
    fn chunk_from(&mut self, mut from: usize) -> Option<usize> {
        loop {
            let rest = self.bytes.get(from..)?;
            let found = from + rest.iter().position(|byte| *byte == op::CHUNK)?;
            if self.is_chunk(&self.bytes[found..])? {
                return Some(found);
            }
            from = found + 1;
        }
    }

    /// Whether a chunk lies at the beginning; `None` if the search has to end.
    fn is_chunk(&mut self, bytes: &'a [u8]) -> Option<bool> {
        let chunk = Record::first(bytes).and_then(|record| record::chunk(record.content));
        let Some(chunk) = chunk else {
            return Some(false);
        };
        // Without a checksum, anything could look like a chunk.
        if chunk.crc == 0 || chunk.uncompressed_len != chunk.records.len() as u64 {
            return Some(false);
        }
        self.budget = self.budget.checked_sub(chunk.records.len())?;
        Some(chunk.compression.is_empty() && chunk.is_sound())
    }
}
