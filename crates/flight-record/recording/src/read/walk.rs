//! [`Messages`]: one pass through a file, from its beginning to its end, over damaged places. One chunk is in memory at
//! a time.

use std::collections::{BTreeMap, HashMap};
use std::io;
use std::sync::Arc;

use mcap::records::op;

use super::expand;
use super::message::{ReadError, RecordedMessage};
use super::record::{
    self, ChannelFacts, ChunkHead, FOOTER_LEN, MAX_CHUNK_HEAD_LEN, MAX_EXPANDED_BYTES, McapRecord,
    SchemaFacts, summary_start,
};
use super::store::{CachedSource, RecordSource, room_for};
use crate::ending::HEAD_LEN;

/// How often the bytes of a file are summed up at most, while chunks are searched, beside one compressed chunk. A
/// damaged file needs one; a file that was made to look like chunks everywhere could take hours.
const MAX_SUMS: u64 = 4;

/// How many bytes are summed up at most while chunks are searched in a file of this length.
fn budget(len: u64) -> u64 {
    len.saturating_mul(MAX_SUMS)
        .saturating_add(MAX_EXPANDED_BYTES)
}

/// What follows the end of the data.
enum AfterData {
    /// A summary and the footer, with which the file ends.
    Footer,
    /// A footer behind which another file begins, and where.
    Another(u64),
    Unknown,
}

/// Length of the mark with which a file begins and ends, bytes.
const MAGIC: u64 = mcap::MAGIC.len() as u64;

/// Length of the head of a record, bytes.
const HEAD: u64 = HEAD_LEN as u64;

/// Length of footer and mark, bytes.
const FOOTER: u64 = FOOTER_LEN as u64;

/// All messages in the order of the file, events of the recording included. Damage is one error; what follows is the
/// next whole chunk. That a file was not finished is no error here.
pub fn messages<'a>(source: impl Into<RecordSource<'a>>) -> Messages<'a> {
    Messages(Walk::new(source.into()))
}

/// See [`messages`].
pub struct Messages<'a>(Walk<'a>);

impl Messages<'_> {
    /// Bytes behind the last record that was read. Known when all was read.
    pub fn bytes_behind(&self) -> u64 {
        self.0.bytes_behind()
    }
}

impl Messages<'_> {
    /// Where the next message lies.
    pub fn mark(&self) -> FileMark {
        self.0.mark()
    }

    /// Goes on at a place of this file where it was before. The messages from there on are the same.
    pub fn go_to(&mut self, mark: FileMark) {
        self.0.go_to(mark);
    }
}

impl Messages<'static> {
    /// Goes on with what a recorder has written to the file since. Call it when all was read.
    ///
    /// # Errors
    /// The system does not say how long the file is.
    pub fn refresh(&mut self) -> io::Result<()> {
        self.0.refresh()
    }
}

impl Iterator for Messages<'_> {
    type Item = Result<RecordedMessage, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.0.find_map(|item| match item {
            WalkItem::Message(message, _) => Some(Ok(message)),
            WalkItem::Error(error) => Some(Err(error)),
            WalkItem::Chunk | WalkItem::Metadata(..) | WalkItem::Attachment(_) => None,
        })
    }
}

/// A place between two messages of a file: in the file, and in the records of a chunk that lies there. It keeps none of
/// them in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileMark {
    position: u64,
    in_chunk: Option<usize>,
    sound: u64,
}

/// What a file has at a place.
#[derive(Debug)]
pub(super) enum WalkItem {
    /// A message, and the number of its channel.
    Message(RecordedMessage, usize),
    /// A chunk begins that is whole.
    Chunk,
    Metadata(String, BTreeMap<String, String>),
    /// The content of a sound record.
    Attachment(Vec<u8>),
    Error(ReadError),
}

/// The chunk that is being read.
struct Chunk {
    records: Arc<Vec<u8>>,
    /// Where its next record lies in it.
    next: usize,
    /// Where it lies in the file.
    at: u64,
}

/// One pass through a file.
pub(super) struct Walk<'a> {
    window: CachedSource<'a>,
    /// Where the next record of the file lies.
    position: u64,
    chunk: Option<Chunk>,
    /// Where in the next chunk to go on, after [`Walk::go_to`].
    skip: Option<usize>,
    schemas: HashMap<u16, Arc<SchemaFacts>>,
    /// The present meaning of a channel's id.
    numbers: HashMap<u16, usize>,
    channels: Vec<Arc<ChannelFacts>>,
    /// Up to here the file is what was written: behind the last record with a checksum that fits. Whatever cannot be
    /// read, the search begins here, because a length on the way may be damaged.
    sound: u64,
    /// Bytes that a search may still sum up.
    budget: u64,
    /// Behind the last record that was read.
    end: u64,
    has_begun: bool,
    is_done: bool,
    is_finished: bool,
}

impl<'a> Walk<'a> {
    pub(super) fn new(source: RecordSource<'a>) -> Walk<'a> {
        Walk {
            budget: budget(source.len()),
            window: CachedSource::new(source),
            position: mcap::MAGIC.len() as u64,
            chunk: None,
            skip: None,
            schemas: HashMap::new(),
            numbers: HashMap::new(),
            channels: Vec::new(),
            sound: 0,
            end: 0,
            has_begun: false,
            is_done: false,
            is_finished: false,
        }
    }

    fn mark(&self) -> FileMark {
        let sound = self.sound;
        match &self.chunk {
            Some(chunk) => FileMark {
                position: chunk.at,
                in_chunk: Some(chunk.next),
                sound,
            },
            None => FileMark {
                position: self.position,
                in_chunk: self.skip,
                sound,
            },
        }
    }

    fn go_to(&mut self, mark: FileMark) {
        self.position = mark.position;
        self.skip = mark.in_chunk;
        self.sound = mark.sound;
        self.chunk = None;
        // What was searched before is searched again.
        self.budget = budget(self.window.len());
        self.is_done = false;
    }

    /// Whether the file was finished. Known when all was read.
    pub(super) fn is_finished(&self) -> bool {
        self.is_finished
    }

    /// Bytes behind the last record that was read. Known when all was read.
    pub(super) fn bytes_behind(&self) -> u64 {
        // Another program may have made the file shorter meanwhile.
        self.window.len().saturating_sub(self.end)
    }

    fn begin(&mut self) -> io::Result<Option<WalkItem>> {
        self.has_begun = true;
        let magic = mcap::MAGIC;
        let has_magic = self.window.peek(0, magic.len() as u64)? == Some(magic);
        self.describe_by_summary()?;
        if has_magic {
            self.end = self.position;
            self.sound = self.position;
            return Ok(None);
        }
        let Some(found) = self.chunk_from(0)? else {
            self.is_done = true;
            return Ok(Some(WalkItem::Error(ReadError::NotMcap)));
        };
        // When nothing but the mark is damaged, what lies before the first chunk can be read.
        let header = self.head()?.is_some_and(|(opcode, _)| opcode == op::HEADER);
        if !header {
            self.position = found;
        }
        let reason = "it does not begin with the format's mark";
        Ok(Some(WalkItem::Error(ReadError::damaged(0, reason))))
    }

    /// A chunk that is damaged may have described channels of later ones; the summary describes all of them, before
    /// anything else.
    fn describe_by_summary(&mut self) -> io::Result<()> {
        let Some((mut at, end)) = summary_place(&mut self.window)? else {
            return Ok(());
        };
        while let Some(head) = self.window.peek(at, HEAD)? {
            let Some((op::SCHEMA | op::CHANNEL, len)) = record::head(head) else {
                break;
            };
            if len > end.saturating_sub(at + HEAD) {
                break;
            }
            let bytes = self.window.take(at, HEAD + len)?;
            if let Some(record) = McapRecord::first(&bytes) {
                self.describe(record);
            }
            at += HEAD + len;
        }
        Ok(())
    }

    /// Takes note of a schema or a channel; `None` if it is neither, or cannot be.
    fn describe(&mut self, record: McapRecord<'_>) -> Option<()> {
        match record.opcode {
            op::SCHEMA => {
                let (id, schema) = record::schema(record.content)?;
                self.schemas.insert(id, Arc::new(schema));
            }
            op::CHANNEL => {
                let (id, facts) = record::channel(record.content, &self.schemas)?;
                let known = self.numbers.get(&id);
                if known.is_none_or(|number| *self.channels[*number] != facts) {
                    self.numbers.insert(id, self.channels.len());
                    self.channels.push(Arc::new(facts));
                }
            }
            _ => return None,
        }
        Some(())
    }

    /// The message whose record's content lies there in `records`.
    fn message(&self, records: &Arc<Vec<u8>>, from: usize, len: usize) -> Option<WalkItem> {
        let record = record::message(records.get(from..from + len)?)?;
        let number = *self.numbers.get(&record.channel_id)?;
        let message = RecordedMessage {
            channel: Arc::clone(self.channels.get(number)?),
            log_time_ns: record.log_time_ns,
            publish_time_ns: record.publish_time_ns,
            sequence: record.sequence,
            records: Arc::clone(records),
            place: from + len - record.data.len()..from + len,
        };
        Some(WalkItem::Message(message, number))
    }

    /// The next item of the present chunk.
    fn next_in_chunk(&mut self) -> Option<WalkItem> {
        loop {
            let chunk = self.chunk.as_mut()?;
            let (records, next, at) = (Arc::clone(&chunk.records), chunk.next, chunk.at);
            if next == records.len() {
                self.chunk = None;
                return None;
            }
            let damaged = |reason| WalkItem::Error(ReadError::damaged(at, reason));
            let Some(record) = McapRecord::first(&records[next..]) else {
                self.chunk = None;
                return Some(damaged("a record of a chunk cannot be"));
            };
            chunk.next += record.len();
            match record.opcode {
                op::MESSAGE => {
                    let item = self.message(&records, next + HEAD_LEN, record.content.len());
                    return Some(item.unwrap_or_else(|| damaged(UNKNOWN_CHANNEL)));
                }
                op::SCHEMA | op::CHANNEL if self.describe(record).is_none() => {
                    return Some(damaged("a record of a chunk cannot be"));
                }
                _ => {}
            }
        }
    }

    /// Opcode and length of the next record; `None` if there is none as a whole.
    fn head(&mut self) -> io::Result<Option<(u8, u64)>> {
        let room = self.window.len().saturating_sub(self.position + HEAD);
        let head = self.window.peek(self.position, HEAD)?;
        Ok(head
            .and_then(record::head)
            .filter(|(opcode, len)| record::is_known(*opcode) && *len <= room))
    }

    /// The next item outside of chunks; `None` if the record says nothing.
    fn next_record(&mut self) -> io::Result<Option<WalkItem>> {
        let at = self.position;
        let Some((opcode, len)) = self.head()? else {
            return self.lost(at, "there is no record here");
        };
        let content_at = at + HEAD;
        self.position = content_at + len;
        self.end = self.position;
        if opcode == op::CHUNK {
            return self.begin_chunk(at, len).map(Some);
        }
        let is_read = matches!(
            opcode,
            op::MESSAGE | op::SCHEMA | op::CHANNEL | op::METADATA | op::ATTACHMENT
        );
        if !is_read {
            return match opcode {
                op::DATA_END => self.end_of_data(at),
                _ => Ok(None),
            };
        }
        let content = self.window.take(content_at, len)?;
        let damaged = |reason| Some(WalkItem::Error(ReadError::damaged(at, reason)));
        Ok(match opcode {
            op::MESSAGE => {
                let item = self.message(&Arc::new(content), 0, len as usize);
                item.or_else(|| damaged(UNKNOWN_CHANNEL))
            }
            op::METADATA => match record::metadata(&content) {
                Some((name, entries)) => Some(WalkItem::Metadata(name, entries)),
                None => damaged("a record of metadata cannot be"),
            },
            op::ATTACHMENT if record::attachment(&content).is_some() => {
                self.sound = self.position;
                Some(WalkItem::Attachment(content))
            }
            op::ATTACHMENT => damaged("a file within the file is not what was written"),
            opcode => {
                let content = &content;
                match self.describe(McapRecord { opcode, content }) {
                    Some(()) => None,
                    None => damaged("a schema or a channel cannot be"),
                }
            }
        })
    }

    /// The head of the chunk whose record begins at `at`, with `len` bytes of content.
    fn chunk_head(&mut self, at: u64, len: u64) -> io::Result<Option<ChunkHead>> {
        let beginning = self.window.peek(at + HEAD, len.min(MAX_CHUNK_HEAD_LEN))?;
        Ok(beginning.and_then(|beginning| record::chunk(beginning, len)))
    }

    fn begin_chunk(&mut self, at: u64, len: u64) -> io::Result<WalkItem> {
        let Some(head) = self.chunk_head(at, len)? else {
            return Ok(WalkItem::Error(ReadError::damaged(at, "a chunk cannot be")));
        };
        if let Some(refusal) = expand::refusal(&head) {
            return Ok(WalkItem::Error(refusal));
        }
        let bytes = self
            .window
            .take(at + HEAD + head.records_at, head.records_len)?;
        let Some(records) = expand::expanded(&head, bytes).filter(|records| head.fits(records))
        else {
            let reason = "a chunk is not what was written";
            return Ok(WalkItem::Error(ReadError::damaged(at, reason)));
        };
        self.sound = self.position;
        // A place between two records, as long as the file is the same.
        let next = self.skip.take().unwrap_or(0).min(records.len());
        self.chunk = Some(Chunk {
            records: Arc::new(records),
            next,
            at,
        });
        Ok(WalkItem::Chunk)
    }

    /// Behind the data comes the summary of a finished file. Behind an ending without one, a chunk may lie that was
    /// about to become part of the file.
    fn end_of_data(&mut self, at: u64) -> io::Result<Option<WalkItem>> {
        let footer = self.window.peek(self.position, FOOTER)?;
        if footer.and_then(summary_start) == Some(0) {
            self.position += FOOTER;
            self.end = self.position;
            if self.position < self.window.len() {
                return self.lost(self.position, "a write was not finished");
            }
        } else {
            match self.ending(at)? {
                AfterData::Footer => {
                    self.is_finished = true;
                    self.end = self.window.len();
                }
                // Its chunks need no checksum to be found.
                AfterData::Another(begin) => {
                    self.position = begin + MAGIC;
                    (self.sound, self.end) = (self.position, self.position);
                    let reason = "another recording begins here, behind the end of one";
                    return Ok(Some(WalkItem::Error(ReadError::damaged(begin, reason))));
                }
                AfterData::Unknown => {
                    return self.lost(self.position, "the file does not end here");
                }
            }
        }
        self.is_done = true;
        Ok(None)
    }

    /// What follows the end of the data, which lies at `at`: a summary, up to the footer of this file, or of one behind
    /// which another begins.
    fn ending(&mut self, at: u64) -> io::Result<AfterData> {
        let place = summary_place(&mut self.window)?.filter(|(start, _)| *start >= at);
        let mut next = self.position;
        while let Some((opcode, len)) = self.window.peek(next, HEAD)?.and_then(record::head) {
            if opcode == op::FOOTER {
                let footer = self.window.peek(next, FOOTER)?.and_then(summary_start);
                let behind = next + FOOTER;
                let is_last = behind == self.window.len();
                let mark = self.window.peek(behind, MAGIC)?;
                return Ok(match mark == Some(mcap::MAGIC) {
                    true => AfterData::Another(behind),
                    false if footer.is_some() && is_last => AfterData::Footer,
                    false => AfterData::Unknown,
                });
            }
            if !record::is_known(opcode) || len > self.window.len().saturating_sub(next) {
                break;
            }
            next += HEAD + len;
        }
        Ok(match place {
            Some(_) => AfterData::Footer,
            None => AfterData::Unknown,
        })
    }

    /// What is at `at` cannot be read: goes on with the next whole chunk.
    fn lost(&mut self, at: u64, reason: &'static str) -> io::Result<Option<WalkItem>> {
        let found = self.chunk_from(self.sound)?;
        let error = match found {
            Some(found) => {
                self.position = found;
                ReadError::damaged(at.min(found), reason)
            }
            None => {
                self.is_done = true;
                ReadError::Truncated { at }
            }
        };
        Ok(Some(WalkItem::Error(error)))
    }

    /// Where a chunk begins, at `from` or behind, whose checksum fits.
    fn chunk_from(&mut self, mut from: u64) -> io::Result<Option<u64>> {
        while let Some(at) = self.window.find(op::CHUNK, from)? {
            match self.is_chunk(at)? {
                Some(true) => return Ok(Some(at)),
                Some(false) => from = at + 1,
                None => break,
            }
        }
        Ok(None)
    }

    /// Whether a chunk lies there; `None` if the search has to end.
    fn is_chunk(&mut self, at: u64) -> io::Result<Option<bool>> {
        let head = self.window.peek(at, HEAD)?.and_then(record::head);
        let room = self.window.len().saturating_sub(at + HEAD);
        let Some((_, len)) = head.filter(|(_, len)| *len <= room) else {
            return Ok(Some(false));
        };
        let head = self.chunk_head(at, len)?;
        // Without a checksum, anything could look like a chunk.
        let Some(head) = head.filter(|head| head.crc != 0 && expand::refusal(head).is_none())
        else {
            return Ok(Some(false));
        };
        let cost = head.records_len.max(head.uncompressed_len);
        let Some(budget) = self.budget.checked_sub(cost) else {
            return Ok(None);
        };
        self.budget = budget;
        let source = self.window.source().clone();
        if room_for(head.records_len).is_err() {
            return Ok(Some(false));
        }
        // In a window of its own, so that the search goes on in what was read.
        let bytes =
            CachedSource::new(source).take(at + HEAD + head.records_at, head.records_len)?;
        let records = expand::expanded(&head, bytes);
        Ok(Some(records.is_some_and(|records| head.fits(&records))))
    }
}

impl Walk<'static> {
    fn refresh(&mut self) -> io::Result<()> {
        if self.is_finished {
            return Ok(());
        }
        if let RecordSource::File(file) = self.window.source() {
            let file = file.refreshed()?;
            self.budget = budget(file.len());
            self.window = CachedSource::new(RecordSource::File(file));
            // What was an ending may be a chunk now.
            self.position = self.sound.max(mcap::MAGIC.len() as u64);
            self.has_begun &= self.sound > 0;
            self.is_done = false;
        }
        Ok(())
    }
}

/// Of a message whose channel is not known.
const UNKNOWN_CHANNEL: &str = "a message is of a channel that the file does not describe";

/// Where the summary of a finished file begins and ends.
pub(super) fn summary_place(window: &mut CachedSource<'_>) -> io::Result<Option<(u64, u64)>> {
    let Some(end) = window.len().checked_sub(FOOTER) else {
        return Ok(None);
    };
    let start = window.peek(end, FOOTER)?.and_then(summary_start);
    Ok(start
        .filter(|start| (1..=end).contains(start))
        .map(|start| (start, end)))
}

impl Iterator for Walk<'_> {
    type Item = WalkItem;

    fn next(&mut self) -> Option<WalkItem> {
        loop {
            if let Some(item) = self.next_in_chunk() {
                return Some(item);
            }
            if self.is_done {
                return None;
            }
            let item = match self.has_begun {
                true => self.next_record(),
                false => self.begin(),
            };
            match item {
                Ok(Some(item)) => return Some(item),
                Ok(None) => {}
                Err(error) => {
                    self.is_done = true;
                    return Some(WalkItem::Error(error.into()));
                }
            }
        }
    }
}
