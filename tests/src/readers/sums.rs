//! [`Sums`]: what a reader found in a file, in few bytes, to compare readers over very many files.

use std::collections::BTreeMap;
use std::fmt::Write;

use recording::read::{self, ReadError, RecordSource};
use sha2::{Digest, Sha256};

/// The messages of a topic.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sum {
    /// How many.
    pub messages: u64,
    /// SHA-256 of the log time (u64, little-endian) and the data of each message in order, in hexadecimal.
    pub sha256: String,
}

/// What a reader found in a file: sums by topic, and what it complained of.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sums {
    /// Topics that have messages.
    pub topics: BTreeMap<String, Sum>,
    /// Nothing when the reader has no complaint.
    pub error: Option<String>,
}

impl Sums {
    /// What this workspace's own reader finds. Like the others, it does not complain that the file was not finished.
    pub fn of<'a>(source: impl Into<RecordSource<'a>>) -> Sums {
        let mut digests = BTreeMap::<String, (u64, Sha256)>::new();
        let mut error = None;
        for message in read::messages(source) {
            match message {
                Ok(message) => {
                    let (messages, digest) = digests.entry(message.topic().to_owned()).or_default();
                    *messages += 1;
                    digest.update(message.log_time_ns.to_le_bytes());
                    digest.update(message.data());
                }
                // What was being written.
                Err(ReadError::Truncated { .. }) => break,
                Err(reason) => error = Some(reason.to_string()),
            }
        }
        let topics = digests.into_iter().map(|(topic, (messages, digest))| {
            let sha256 = hexadecimal(&digest.finalize());
            (topic, Sum { messages, sha256 })
        });
        let topics = topics.collect();
        Sums { topics, error }
    }

    /// What `read.py` and `read.mjs` print with `--sums`, file by file.
    pub fn parse(output: &str) -> Vec<Sums> {
        let mut files: Vec<Sums> = Vec::new();
        for line in output.lines() {
            let words: Vec<&str> = line.split('\t').collect();
            if let ["file", _] = words[..] {
                files.push(Sums::default());
                continue;
            }
            let file = files.last_mut().expect("a file first");
            match words[..] {
                ["sum", topic, messages, sha256] => {
                    let sum = Sum {
                        messages: messages.parse().expect("a number"),
                        sha256: sha256.to_owned(),
                    };
                    file.topics.insert(topic.to_owned(), sum);
                }
                ["error", text] => file.error = Some(text.to_owned()),
                _ => panic!("{line}"),
            }
        }
        files
    }

    /// Messages of all topics.
    pub fn messages(&self) -> u64 {
        self.topics.values().map(|sum| sum.messages).sum()
    }
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}
