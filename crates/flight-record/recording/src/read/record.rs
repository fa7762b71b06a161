//! Records of an MCAP file. No length is trusted.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use mcap::records::op;

use crate::ending::HEAD_LEN;

/// Longest name of a schema, bytes. Names in ROS 2 have less than 256; each topic of a report repeats it.
const MAX_SCHEMA_NAME_LEN: usize = 256;

/// A record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct McapRecord<'a> {
    pub(super) opcode: u8,
    pub(super) content: &'a [u8],
}

impl<'a> McapRecord<'a> {
    /// The record at the beginning of `bytes`; `None` if it does not lie there as a whole.
    pub(super) fn first(bytes: &'a [u8]) -> Option<McapRecord<'a>> {
        let (opcode, len) = head(bytes)?;
        Some(McapRecord {
            opcode,
            content: bytes.get(HEAD_LEN..)?.get(..usize::try_from(len).ok()?)?,
        })
    }

    /// Length with the head, bytes.
    pub(super) fn len(&self) -> usize {
        HEAD_LEN + self.content.len()
    }
}

/// Whether there can be a record with this opcode: one of the format, or of an application.
pub(super) fn is_known(opcode: u8) -> bool {
    (op::HEADER..=op::DATA_END).contains(&opcode) || opcode >= 0x80
}

/// Opcode and length of the content of the record that begins with `head`.
pub(super) fn head(head: &[u8]) -> Option<(u8, u64)> {
    let (opcode, rest) = head.split_first()?;
    Some((*opcode, u64::from_le_bytes(*rest.first_chunk()?)))
}

/// The fields of a record, one after the other.
#[derive(Clone, Copy)]
pub(super) struct Fields<'a>(pub(super) &'a [u8]);

impl<'a> Fields<'a> {
    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (array, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*array)
    }

    pub(super) fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    pub(super) fn bytes(&mut self, len: u64) -> Option<&'a [u8]> {
        let (bytes, rest) = self.0.split_at_checked(usize::try_from(len).ok()?)?;
        self.0 = rest;
        Some(bytes)
    }

    /// Bytes behind their length, which has 32 bits.
    pub(super) fn block(&mut self) -> Option<&'a [u8]> {
        let len = self.u32()?;
        self.bytes(u64::from(len))
    }

    pub(super) fn text(&mut self) -> Option<&'a str> {
        std::str::from_utf8(self.block()?).ok()
    }

    pub(super) fn map(&mut self) -> Option<BTreeMap<String, String>> {
        let mut entries = Fields(self.block()?);
        let mut map = BTreeMap::new();
        while !entries.0.is_empty() {
            let (key, value) = (entries.text()?, entries.text()?);
            map.insert(key.to_owned(), value.to_owned());
        }
        Some(map)
    }
}

/// A schema.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct SchemaFacts {
    pub(super) name: String,
    pub(super) encoding: String,
    pub(super) data: Vec<u8>,
}

/// Id and schema.
pub(super) fn schema(content: &[u8]) -> Option<(u16, SchemaFacts)> {
    let mut fields = Fields(content);
    let id = fields.u16()?;
    let schema = SchemaFacts {
        name: fields.text()?.to_owned(),
        encoding: fields.text()?.to_owned(),
        data: fields.block()?.to_vec(),
    };
    (schema.name.len() <= MAX_SCHEMA_NAME_LEN).then_some((id, schema))
}

/// A channel and its schema.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct ChannelFacts {
    /// 0 of a channel without a schema.
    pub(super) schema_id: u16,
    pub(super) schema: Arc<SchemaFacts>,
    pub(super) topic: String,
    pub(super) encoding: String,
    /// Texts by key.
    pub(super) metadata: BTreeMap<String, String>,
}

/// Id and channel, whose schema is among these; `None` if it cannot be.
pub(super) fn channel(
    content: &[u8],
    schemas: &HashMap<u16, Arc<SchemaFacts>>,
) -> Option<(u16, ChannelFacts)> {
    let mut fields = Fields(content);
    let (id, schema_id) = (fields.u16()?, fields.u16()?);
    let schema = match schema_id {
        0 => Arc::default(),
        id => Arc::clone(schemas.get(&id)?),
    };
    let facts = ChannelFacts {
        schema_id,
        schema,
        topic: fields.text()?.to_owned(),
        encoding: fields.text()?.to_owned(),
        metadata: fields.map()?,
    };
    Some((id, facts))
}

/// A message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MessageRecord<'a> {
    pub(super) channel_id: u16,
    pub(super) sequence: u32,
    pub(super) log_time_ns: u64,
    pub(super) publish_time_ns: u64,
    pub(super) data: &'a [u8],
}

pub(super) fn message(content: &[u8]) -> Option<MessageRecord<'_>> {
    let mut fields = Fields(content);
    Some(MessageRecord {
        channel_id: fields.u16()?,
        sequence: fields.u32()?,
        log_time_ns: fields.u64()?,
        publish_time_ns: fields.u64()?,
        data: fields.0,
    })
}

/// Fields of a chunk before its records, bytes, without the name of a compression.
const CHUNK_HEAD_LEN: u64 = 8 + 8 + 8 + 4 + 4 + 8;

/// Longest name of a compression, bytes.
const MAX_NAME_LEN: u64 = 32;

/// Bytes from the beginning of a chunk that have all before its records.
pub(super) const MAX_CHUNK_HEAD_LEN: u64 = CHUNK_HEAD_LEN + MAX_NAME_LEN;

/// Most bytes that a compressed chunk may expand to, 64 MiB. Writers begin a chunk anew after 1 to 16 MiB. A chunk that
/// says more is not read, so that a small file does not fill the memory.
pub(super) const MAX_EXPANDED_BYTES: u64 = 64 << 20;

/// What stands before the records of a chunk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ChunkHead {
    pub(super) uncompressed_len: u64,
    /// 0 when there is no checksum.
    pub(super) crc: u32,
    pub(super) compression: String,
    /// Where the records begin, from the content's beginning, and their length; bytes.
    pub(super) records_at: u64,
    pub(super) records_len: u64,
}

impl ChunkHead {
    /// Whether these are the records that were written, as far as there is a checksum.
    pub(super) fn fits(&self, records: &[u8]) -> bool {
        self.crc == 0 || crc32fast::hash(records) == self.crc
    }
}

/// The head of a chunk whose content begins with `content` and has `len` bytes; `None` if the lengths do not fit
/// together.
pub(super) fn chunk(content: &[u8], len: u64) -> Option<ChunkHead> {
    let mut fields = Fields(content);
    // Earliest and latest time, which the messages say themselves.
    fields.bytes(16)?;
    let (uncompressed_len, crc) = (fields.u64()?, fields.u32()?);
    let compression = fields.text()?.to_owned();
    let records_len = fields.u64()?;
    let records_at = CHUNK_HEAD_LEN + compression.len() as u64;
    let fits = records_at.checked_add(records_len)? <= len
        && (!compression.is_empty() || records_len == uncompressed_len);
    fits.then_some(ChunkHead {
        uncompressed_len,
        crc,
        compression,
        records_at,
        records_len,
    })
}

/// A record of metadata: name, and texts by key.
pub(super) fn metadata(content: &[u8]) -> Option<(String, BTreeMap<String, String>)> {
    let mut fields = Fields(content);
    Some((fields.text()?.to_owned(), fields.map()?))
}

/// A file within the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct AttachmentRecord<'a> {
    pub(super) log_time_ns: u64,
    pub(super) create_time_ns: u64,
    pub(super) name: &'a str,
    pub(super) media_type: &'a str,
    pub(super) data: &'a [u8],
}

/// A file within the file, if its checksum fits.
pub(super) fn attachment(content: &[u8]) -> Option<AttachmentRecord<'_>> {
    let mut fields = Fields(content);
    let (log_time_ns, create_time_ns) = (fields.u64()?, fields.u64()?);
    let (name, media_type) = (fields.text()?, fields.text()?);
    let len = fields.u64()?;
    let data = fields.bytes(len)?;
    let summed = &content[..content.len() - fields.0.len()];
    let crc = fields.u32()?;
    let is_sound = crc == 0 || crc32fast::hash(summed) == crc;
    is_sound.then_some(AttachmentRecord {
        log_time_ns,
        create_time_ns,
        name,
        media_type,
        data,
    })
}

/// Length of footer and mark, bytes.
pub(super) const FOOTER_LEN: usize = HEAD_LEN + 20 + mcap::MAGIC.len();

/// Where the summary begins, by the footer and mark that `bytes` are: 0 without a summary. `None` if they are something
/// else.
pub(super) fn summary_start(bytes: &[u8]) -> Option<u64> {
    let footer = McapRecord::first(bytes)?;
    let is_footer = footer.opcode == op::FOOTER && footer.content.len() == 20;
    let has_mark = bytes.get(footer.len()..)? == mcap::MAGIC;
    if is_footer && has_mark {
        Fields(footer.content).u64()
    } else {
        None
    }
}
