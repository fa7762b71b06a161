//! [`messages`]: all messages of a file.

use super::error::ReadError;
use super::message::Message;
use super::walk::{Item, Walk};

/// All messages in the order of the file, events of the recording included. Damage is one error; what follows is the next whole
/// chunk. That a file was not finished is no error here.
pub fn messages(bytes: &[u8]) -> impl Iterator<Item = Result<Message<'_>, ReadError>> {
    Walk::new(bytes).filter_map(|item| match item {
        Item::Message(message, _) => Some(Ok(message)),
        Item::Error(error) => Some(Err(error)),
        Item::Chunk | Item::Metadata(..) | Item::Attachment(_) => None,
    })
}
