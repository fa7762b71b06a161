//! Files through the readers of the crate `mcap`.

use std::io::Cursor;

use mcap::io::MessageReader;
use mcap::sans_io::LinearReaderOptions;

/// Topic, sequence, log time and bytes of a message.
pub type Facts = (String, u32, u64, Vec<u8>);

/// Messages up to the first error, in the order of the file.
pub fn until_error(bytes: &[u8]) -> (Vec<Facts>, Option<mcap::McapError>) {
    let mut messages = Vec::new();
    // Without a limit it believes every length, and allocates that.
    let options = LinearReaderOptions::default().with_record_length_limit(bytes.len());
    for message in MessageReader::new_with_options(Cursor::new(bytes), options) {
        match message {
            Ok(message) => messages.push((
                message.channel.topic.clone(),
                message.sequence,
                message.log_time,
                message.data.to_vec(),
            )),
            Err(error) => return (messages, Some(error)),
        }
    }
    (messages, None)
}

/// All messages; every checksum is checked, and that the file ends as it should.
pub fn all(bytes: &[u8]) -> Vec<Facts> {
    let options = LinearReaderOptions::default()
        .with_prevalidate_chunk_crcs(true)
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true);
    let messages = MessageReader::new_with_options(Cursor::new(bytes), options);
    let facts = messages.map(|message| {
        let message = message.expect("a message that can be read");
        let topic = message.channel.topic.clone();
        (
            topic,
            message.sequence,
            message.log_time,
            message.data.to_vec(),
        )
    });
    facts.collect()
}

/// The messages in `bytes` through our reader, which must not find an error.
pub fn ours(bytes: &[u8]) -> Vec<Facts> {
    let messages = recording::read::messages(bytes).map(|message| {
        let message = message.expect("a message that can be read");
        let topic = message.topic().to_owned();
        (
            topic,
            message.sequence,
            message.log_time_ns,
            message.data().to_vec(),
        )
    });
    messages.collect()
}

/// Messages of topics, without the recording's own events.
pub fn of_topics(mut messages: Vec<Facts>) -> Vec<Facts> {
    messages.retain(|(topic, ..)| !topic.ends_with("/recording/events"));
    messages
}
