//! [`summary_of`]: what a file says of itself.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use mcap::records::op;

use super::check::check_with;
use super::message::ReadError;
use super::record::{self, AttachmentRecord, Fields, McapRecord, SchemaFacts};
use super::store::{CachedSource, RecordSource};
use super::walk::summary_place;
use crate::ending::HEAD_LEN;
use crate::settings::Attachment;

/// Length of the head of a record, bytes.
const HEAD: u64 = HEAD_LEN as u64;

/// What a file says of itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordSummary {
    /// Whether the file was finished; otherwise the chunks were read.
    pub is_complete: bool,
    /// Records of metadata: name, and texts by key.
    pub metadata: Vec<(String, BTreeMap<String, String>)>,
    /// Files within the file.
    pub attachments: Vec<Attachment>,
    /// By topic: name of the message type, messages.
    pub topics: BTreeMap<String, (String, u64)>,
    /// Unix time of the earliest message, ns.
    pub first_ns: Option<u64>,
    /// Unix time of the latest message, ns.
    pub last_ns: Option<u64>,
}

/// What the file says of itself. Of a finished file only the end is read, and the metadata, else all of it.
///
/// # Errors
/// It is no MCAP file, cannot be read, or its summary is damaged.
pub fn summary_of<'a>(source: impl Into<RecordSource<'a>>) -> Result<RecordSummary, ReadError> {
    let mut window = CachedSource::new(source.into());
    if window.peek(0, mcap::MAGIC.len() as u64)? != Some(mcap::MAGIC) {
        return Err(ReadError::NotMcap);
    }
    let Some((start, end)) = summary_place(&mut window)? else {
        return Ok(unfinished(window.source().clone()));
    };
    let section = Section {
        // No part of the file is needed twice.
        budget: window.len(),
        window,
        summary: RecordSummary {
            is_complete: true,
            ..RecordSummary::default()
        },
        schemas: HashMap::new(),
        topics: HashMap::new(),
    };
    section.read(start, end)
}

/// The summary section of a finished file.
struct Section<'a> {
    window: CachedSource<'a>,
    /// Bytes that may still be read.
    budget: u64,
    summary: RecordSummary,
    /// By id.
    schemas: HashMap<u16, Arc<SchemaFacts>>,
    /// By id of the channel.
    topics: HashMap<u16, String>,
}

impl Section<'_> {
    fn read(mut self, start: u64, end: u64) -> Result<RecordSummary, ReadError> {
        let mut at = start;
        while at < end {
            let damaged = ReadError::damaged(at, "the summary cannot be");
            let head = self.window.peek(at, HEAD)?.and_then(record::head);
            let head = head.filter(|(opcode, _)| record::is_known(*opcode));
            let (opcode, len) = head.ok_or_else(|| damaged.clone())?;
            let next = at.saturating_add(HEAD).saturating_add(len);
            if next > end {
                return Err(damaged);
            }
            // There is an index for each chunk.
            if !matches!(opcode, op::CHUNK_INDEX | op::MESSAGE_INDEX) {
                let content = self.take(at + HEAD, len)?;
                let content = &content;
                self.record(McapRecord { opcode, content })?
                    .ok_or(damaged)?;
            }
            at = next;
        }
        Ok(self.summary)
    }

    /// A record of the summary; `None` if it cannot be.
    fn record(&mut self, record: McapRecord<'_>) -> Result<Option<()>, ReadError> {
        Ok(match record.opcode {
            op::SCHEMA => self.schema(record.content),
            op::CHANNEL => self.channel(record.content),
            op::STATISTICS => self.statistics(record.content),
            op::METADATA_INDEX => {
                let Some(content) = self.indexed(record.content, op::METADATA)? else {
                    return Ok(None);
                };
                let metadata = record::metadata(&content);
                metadata.map(|metadata| self.summary.metadata.push(metadata))
            }
            op::ATTACHMENT_INDEX => {
                let Some(content) = self.indexed(record.content, op::ATTACHMENT)? else {
                    return Ok(None);
                };
                let attachment = record::attachment(&content).map(owned);
                attachment.map(|attachment| self.summary.attachments.push(attachment))
            }
            _ => Some(()),
        })
    }

    fn schema(&mut self, content: &[u8]) -> Option<()> {
        let (id, schema) = record::schema(content)?;
        self.schemas.insert(id, Arc::new(schema));
        Some(())
    }

    fn channel(&mut self, content: &[u8]) -> Option<()> {
        let (id, channel) = record::channel(content, &self.schemas)?;
        self.topics.insert(id, channel.topic.clone());
        let entry = self.summary.topics.entry(channel.topic).or_default();
        entry.0.clone_from(&channel.schema.name);
        Some(())
    }

    fn statistics(&mut self, content: &[u8]) -> Option<()> {
        let mut fields = Fields(content);
        let messages = fields.u64()?;
        // Counts of schemas, channels, attachments, metadata, chunks.
        fields.bytes(2 + 4 * 4)?;
        let (first_ns, last_ns) = (fields.u64()?, fields.u64()?);
        if messages > 0 {
            self.summary.first_ns = Some(first_ns);
            self.summary.last_ns = Some(last_ns);
        }
        let mut counts = Fields(fields.block()?);
        while !counts.0.is_empty() {
            let (id, count) = (counts.u16()?, counts.u64()?);
            let topic = self.topics.get(&id)?;
            let (_, sum) = self.summary.topics.get_mut(topic)?;
            *sum = sum.saturating_add(count);
        }
        Some(())
    }

    /// The record that an index points to: its content.
    fn indexed(&mut self, index: &[u8], opcode: u8) -> Result<Option<Vec<u8>>, ReadError> {
        let mut fields = Fields(index);
        let (Some(at), Some(len)) = (fields.u64(), fields.u64()) else {
            return Ok(None);
        };
        let bytes = self.take(at, len)?;
        let record = McapRecord::first(&bytes).filter(|record| record.opcode == opcode);
        Ok(record.map(|record| record.content.to_vec()))
    }

    fn take(&mut self, at: u64, len: u64) -> Result<Vec<u8>, ReadError> {
        let damaged = ReadError::damaged(at, "the summary names more than the file has");
        let budget = self.budget.checked_sub(len);
        self.budget = budget.ok_or_else(|| damaged.clone())?;
        let end = at.checked_add(len).filter(|end| *end <= self.window.len());
        end.ok_or(damaged)?;
        Ok(self.window.take(at, len)?)
    }
}

fn owned(file: AttachmentRecord<'_>) -> Attachment {
    Attachment {
        name: file.name.to_owned(),
        media_type: file.media_type.to_owned(),
        data: file.data.to_vec(),
    }
}

/// What the chunks say, of a file that has no summary.
fn unfinished(source: RecordSource<'_>) -> RecordSummary {
    let mut attachments = Vec::new();
    let checked = check_with(source, |file| attachments.push(owned(file)));
    let topics = checked.topics.into_iter();
    RecordSummary {
        is_complete: false,
        metadata: checked.metadata,
        attachments,
        topics: topics
            .map(|(topic, facts)| (topic, (facts.schema_name, facts.messages)))
            .collect(),
        first_ns: checked.first_ns,
        last_ns: checked.last_ns,
    }
}
