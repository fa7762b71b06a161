//! [`ReplayTopics`]: the recorded topics for Foxglove clients, with the bytes and times of the file.

use std::collections::BTreeMap;

use recording::read::RecordedMessage;
use view::{Channel, ChannelId, Server};

/// Topics that are offered at most, as many as a recorder writes.
const MAX_TOPICS: usize = recording::MAX_CHANNELS;

/// The topics of a file, by name. A topic whose layout changes is offered with the first one.
#[derive(Default)]
pub(super) struct FileChannels(BTreeMap<String, Channel>);

impl FileChannels {
    pub fn take(&mut self, message: &RecordedMessage) {
        if self.0.contains_key(message.topic()) || self.0.len() == MAX_TOPICS {
            return;
        }
        let channel = Channel {
            topic: message.topic().to_owned(),
            encoding: "cdr".to_owned(),
            schema_name: message.schema_name().to_owned(),
            schema_encoding: "ros2msg".to_owned(),
            schema: message.schema_text().into(),
        };
        self.0.insert(message.topic().to_owned(), channel);
    }
}

/// See the module's documentation.
#[derive(Default)]
pub(super) struct ReplayTopics(BTreeMap<String, ChannelId>);

impl ReplayTopics {
    pub fn offer(found: FileChannels, server: &mut Server) -> ReplayTopics {
        let offered = found.0.into_iter().filter_map(|(topic, channel)| {
            let id = server.channel(channel)?;
            Some((topic, id))
        });
        ReplayTopics(offered.collect())
    }

    /// Whether a client wants the message; its channel.
    pub fn wanted(&self, message: &RecordedMessage, server: &Server) -> Option<ChannelId> {
        let channel = self.0.get(message.topic()).copied()?;
        server.is_subscribed(channel).then_some(channel)
    }
}
