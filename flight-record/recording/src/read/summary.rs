//! [`summary_of`]: what a file says of itself.

use std::collections::{BTreeMap, HashMap};
use std::io::{Read, Seek, SeekFrom};

use mcap::records::op;

use crate::settings::Attachment;

use super::check::check;
use super::message::ReadError;
use super::record::{self, AttachmentRecord, FOOTER_LEN, Fields, Record, summary_start};
use super::store::room_for;
use super::walk::{Item, Walk};

/// What a file says of itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
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
pub fn summary_of(file: &mut (impl Read + Seek)) -> Result<Summary, ReadError> {
    let len = file.seek(SeekFrom::End(0))?;
    if section(file, 0, mcap::MAGIC.len() as u64)? != mcap::MAGIC {
        return Err(ReadError::NotMcap);
    }
    let footer_at = len.saturating_sub(FOOTER_LEN as u64);
    let footer = section(file, footer_at, FOOTER_LEN as u64)?;
    match summary_start(&footer) {
        Some(start) if start > 0 && start <= footer_at => Section {
            file,
            // No part of the file is needed twice.
            budget: len,
            summary: Summary {
                is_complete: true,
                ..Summary::default()
            },
            schemas: HashMap::new(),
            topics: HashMap::new(),
        }
        .read(start, footer_at),
        _ => Ok(unfinished(&section(file, 0, len)?)),
    }
}

/// The bytes from `at` on, at most `len`.
fn section(file: &mut (impl Read + Seek), at: u64, len: u64) -> Result<Vec<u8>, ReadError> {
    let mut bytes = room_for(len)?;
    file.seek(SeekFrom::Start(at))?;
    file.by_ref().take(len).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The summary section of a finished file.
struct Section<'f, F> {
    file: &'f mut F,
    /// Bytes that may still be read.
    budget: u64,
    summary: Summary,
    /// Names by id.
    schemas: HashMap<u16, String>,
    /// By id of the channel.
    topics: HashMap<u16, String>,
}

impl<F: Read + Seek> Section<'_, F> {
    fn read(mut self, start: u64, end: u64) -> Result<Summary, ReadError> {
        let bytes = self.take(start, end - start)?;
        let mut rest = bytes.as_slice();
        while !rest.is_empty() {
            let at = end - rest.len() as u64;
            let damaged = ReadError::Damaged {
                at,
                reason: "the summary cannot be",
            };
            let record = Record::first(rest).ok_or_else(|| damaged.clone())?;
            self.record(record)?.ok_or(damaged)?;
            rest = &rest[record.len()..];
        }
        Ok(self.summary)
    }

    /// A record of the summary; `None` if it cannot be.
    fn record(&mut self, record: Record<'_>) -> Result<Option<()>, ReadError> {
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
        self.schemas.insert(id, schema.name.to_owned());
        Some(())
    }

    fn channel(&mut self, content: &[u8]) -> Option<()> {
        let (id, channel) = record::channel(content)?;
        let schema = self.schemas.get(&channel.schema_id).cloned();
        let topic = channel.topic.to_owned();
        self.topics.insert(id, topic.clone());
        let entry = self.summary.topics.entry(topic).or_default();
        entry.0 = schema.unwrap_or_default();
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
        let record = Record::first(&bytes).filter(|record| record.opcode == opcode);
        Ok(record.map(|record| record.content.to_vec()))
    }

    fn take(&mut self, at: u64, len: u64) -> Result<Vec<u8>, ReadError> {
        let reason = "the summary names more than the file has";
        let damaged = ReadError::Damaged { at, reason };
        self.budget = self.budget.checked_sub(len).ok_or(damaged)?;
        section(self.file, at, len)
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
fn unfinished(bytes: &[u8]) -> Summary {
    let checked = check(bytes);
    let files = Walk::new(bytes).filter_map(|item| match item {
        Item::Attachment(file) => Some(owned(file)),
        _ => None,
    });
    let topics = checked.topics.into_iter();
    Summary {
        is_complete: false,
        metadata: checked.metadata,
        attachments: files.collect(),
        topics: topics
            .map(|(topic, facts)| (topic, (facts.schema_name, facts.messages)))
            .collect(),
        first_ns: checked.first_ns,
        last_ns: checked.last_ns,
    }
}
