//! [`recover`]: a whole file out of a damaged one; [`extract`]: a part of a file as a file of its own.

use std::collections::{BTreeMap, HashMap};
use std::io::Write;

use mcap::records::{MessageHeader, Metadata};
use mcap::{McapError, Writer};

use super::message::{ReadError, RecordedMessage};
use super::record::{self, ChannelFacts};
use super::store::RecordSource;
use super::walk::{Walk, WalkItem};
use crate::encoder::write_options;
use crate::sink::Counted;

/// Name of the record of metadata that says what was wrong with the damaged file.
pub const RECOVERED_METADATA: &str = "ril.recovered";

/// What [`recover`] has done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recovered {
    /// Messages in the new file.
    pub messages: u64,
    /// What was wrong with the old one, as in [`RecordCheck::errors`](super::RecordCheck::errors).
    pub errors: Vec<ReadError>,
}

/// Writes a whole file with all that can be read of `source`, and a record of metadata, [`RECOVERED_METADATA`], that
/// says what was wrong. Chunks are larger than a recorder's; messages keep their order and times.
///
/// # Errors
/// `source` is no MCAP file, or `to` does not take the new one.
pub fn recover<'a>(
    source: impl Into<RecordSource<'a>>,
    to: &mut impl Write,
) -> Result<Recovered, ReadError> {
    copy(source.into(), to, |_| true, true)
}

/// As [`recover`], of those messages that `is_kept` wants: their times, and metadata and attachments of the file, stay
/// as they are.
///
/// # Errors
/// As [`recover`].
pub fn extract<'a>(
    source: impl Into<RecordSource<'a>>,
    to: &mut impl Write,
    is_kept: impl Fn(&RecordedMessage) -> bool,
) -> Result<Recovered, ReadError> {
    copy(source.into(), to, is_kept, false)
}

fn copy(
    source: RecordSource<'_>,
    to: &mut impl Write,
    is_kept: impl Fn(&RecordedMessage) -> bool,
    has_note: bool,
) -> Result<Recovered, ReadError> {
    let mut writer = write_options().create(Counted::new(to))?;
    let mut recovered = Recovered {
        messages: 0,
        errors: Vec::new(),
    };
    let mut ids = HashMap::new();
    let mut walk = Walk::new(source);
    for item in walk.by_ref() {
        match item {
            WalkItem::Message(message, _) if !is_kept(&message) => {}
            WalkItem::Message(message, number) => {
                let header = MessageHeader {
                    channel_id: id(&mut writer, &mut ids, number, &message.channel)?,
                    sequence: message.sequence,
                    log_time: message.log_time_ns,
                    publish_time: message.publish_time_ns,
                };
                writer.write_to_known_channel(&header, message.data())?;
                recovered.messages += 1;
            }
            WalkItem::Chunk => {}
            WalkItem::Metadata(name, metadata) => {
                writer.write_metadata(&Metadata { name, metadata })?;
            }
            WalkItem::Attachment(content) => {
                if let Some(file) = record::attachment(&content) {
                    writer.attach(&mcap::Attachment {
                        log_time: file.log_time_ns,
                        create_time: file.create_time_ns,
                        name: file.name.to_owned(),
                        media_type: file.media_type.to_owned(),
                        data: file.data.into(),
                    })?;
                }
            }
            WalkItem::Error(ReadError::NotMcap) => return Err(ReadError::NotMcap),
            WalkItem::Error(error) => error.list(&mut recovered.errors),
        }
    }
    if ReadError::leave_room_for_unfinished(&recovered.errors) && !walk.is_finished() {
        ReadError::Unfinished.list(&mut recovered.errors);
    }
    if has_note || !recovered.errors.is_empty() {
        writer.write_metadata(&note(&recovered))?;
    }
    writer.finish()?;
    writer.into_inner().into_inner().flush()?;
    Ok(recovered)
}

/// The id in the new file of a channel of the old one.
fn id<W: Write>(
    writer: &mut Writer<Counted<W>>,
    ids: &mut HashMap<usize, u16>,
    number: usize,
    facts: &ChannelFacts,
) -> Result<u16, McapError> {
    if let Some(id) = ids.get(&number) {
        return Ok(*id);
    }
    let schema = match facts.schema_id {
        0 => 0,
        _ => {
            let schema = &facts.schema;
            writer.add_schema(&schema.name, &schema.encoding, &schema.data)?
        }
    };
    let id = writer.add_channel(schema, &facts.topic, &facts.encoding, &facts.metadata)?;
    ids.insert(number, id);
    Ok(id)
}

fn note(recovered: &Recovered) -> Metadata {
    let mut metadata: BTreeMap<_, _> =
        [("messages".to_owned(), recovered.messages.to_string())].into();
    for (index, error) in recovered.errors.iter().enumerate() {
        metadata.insert(format!("error_{index:03}"), error.to_string());
    }
    Metadata {
        name: RECOVERED_METADATA.to_owned(),
        metadata,
    }
}

impl From<McapError> for ReadError {
    fn from(error: McapError) -> ReadError {
        match error {
            McapError::Io(error) => error.into(),
            error => ReadError::Io(error.to_string()),
        }
    }
}
