//! Records of an MCAP file, where they lie in its bytes. Nothing is copied, and no length is trusted.

use std::collections::BTreeMap;

use mcap::records::op;

use crate::ending::HEAD_LEN;

/// Longest name of a schema, bytes. Names in ROS 2 have less than 256; each topic of a report repeats it.
const MAX_SCHEMA_NAME_LEN: usize = 256;

/// A record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Record<'a> {
    pub(super) opcode: u8,
    pub(super) content: &'a [u8],
}

impl<'a> Record<'a> {
    /// The record at the beginning of `bytes`; `None` if it does not lie there as a whole.
    pub(super) fn first(bytes: &'a [u8]) -> Option<Record<'a>> {
        let (opcode, rest) = bytes.split_first()?;
        let (len, rest) = rest.split_first_chunk()?;
        let len = usize::try_from(u64::from_le_bytes(*len)).ok()?;
        Some(Record {
            opcode: *opcode,
            content: rest.get(..len)?,
        })
    }

    /// Length with the head, bytes.
    pub(super) fn len(&self) -> usize {
        HEAD_LEN + self.content.len()
    }

    /// Whether there can be a record with this opcode: one of the format, or of an application.
    pub(super) fn is_known(&self) -> bool {
        (op::HEADER..=op::DATA_END).contains(&self.opcode) || self.opcode >= 0x80
    }
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct SchemaRecord<'a> {
    pub(super) name: &'a str,
    pub(super) encoding: &'a str,
    pub(super) data: &'a [u8],
}

/// Id and schema.
pub(super) fn schema(content: &[u8]) -> Option<(u16, SchemaRecord<'_>)> {
    let mut fields = Fields(content);
    let id = fields.u16()?;
    let schema = SchemaRecord {
        name: fields.text()?,
        encoding: fields.text()?,
        data: fields.block()?,
    };
    (schema.name.len() <= MAX_SCHEMA_NAME_LEN).then_some((id, schema))
}

/// A channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ChannelRecord<'a> {
    pub(super) schema_id: u16,
    pub(super) topic: &'a str,
    pub(super) encoding: &'a str,
    /// As it lies in the file.
    pub(super) metadata: &'a [u8],
}

/// Id and channel.
pub(super) fn channel(content: &[u8]) -> Option<(u16, ChannelRecord<'_>)> {
    let mut fields = Fields(content);
    let id = fields.u16()?;
    let channel = ChannelRecord {
        schema_id: fields.u16()?,
        topic: fields.text()?,
        encoding: fields.text()?,
        metadata: fields.0,
    };
    fields.map()?;
    Some((id, channel))
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

/// A chunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ChunkRecord<'a> {
    pub(super) uncompressed_len: u64,
    /// 0 when there is no checksum.
    pub(super) crc: u32,
    pub(super) compression: &'a str,
    pub(super) records: &'a [u8],
}

impl ChunkRecord<'_> {
    /// Whether the records are those that were written.
    pub(super) fn is_sound(&self) -> bool {
        let has_length = self.uncompressed_len == self.records.len() as u64;
        has_length && (self.crc == 0 || crc32fast::hash(self.records) == self.crc)
    }
}

pub(super) fn chunk(content: &[u8]) -> Option<ChunkRecord<'_>> {
    let mut fields = Fields(content);
    // Earliest and latest time, which the messages say themselves.
    fields.bytes(16)?;
    let (uncompressed_len, crc) = (fields.u64()?, fields.u32()?);
    let compression = fields.text()?;
    let len = fields.u64()?;
    Some(ChunkRecord {
        uncompressed_len,
        crc,
        compression,
        records: fields.bytes(len)?,
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

/// Where the summary begins, by the footer and mark that `bytes` are: 0 without a summary. Nothing when they are something else.
pub(super) fn summary_start(bytes: &[u8]) -> Option<u64> {
    let footer = Record::first(bytes)?;
    let is_footer = footer.opcode == op::FOOTER && footer.content.len() == 20;
    let has_mark = bytes.get(footer.len()..)? == mcap::MAGIC;
    if is_footer && has_mark {
        Fields(footer.content).u64()
    } else {
        None
    }
}

/// The summary section, if the file was finished.
pub(super) fn summary(bytes: &[u8]) -> Option<&[u8]> {
    let footer_at = bytes.len().checked_sub(FOOTER_LEN)?;
    let start = summary_start(&bytes[footer_at..])?;
    let start = usize::try_from(start).ok().filter(|start| *start > 0)?;
    bytes.get(start..footer_at)
}
