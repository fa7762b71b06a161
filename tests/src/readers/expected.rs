//! What was recorded, and what a reader found, in the words of `read.py`.

use std::collections::BTreeMap;

use ipc_types::Schema;
use ipc_types::schema::Value;

/// A message: times, number and fields; what a reader does not give is absent.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// When it was recorded, ns.
    pub log_time: Option<u64>,
    /// When it was published, ns.
    pub publish_time: Option<u64>,
    /// Number of the recording.
    pub sequence: Option<u32>,
    /// `name=value`.
    pub fields: Vec<String>,
}

/// What a reader found in a file: messages by topic, and what it complained of.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Read {
    /// By topic, in order.
    pub messages: BTreeMap<String, Vec<Line>>,
    /// By topic: reliability, durability and depth of each publisher, where the reader gives them.
    pub profiles: BTreeMap<String, Vec<[u64; 3]>>,
    /// `None` if the reader has no complaint.
    pub error: Option<String>,
}

/// What was recorded, by topic.
#[derive(Clone, Debug, Default)]
pub struct Expected(pub BTreeMap<String, Vec<Line>>);

impl Expected {
    /// The reader found all of it and nothing else.
    #[track_caller]
    pub fn assert_all_in(&self, read: &Read, reader: &str) {
        self.assert_begins_with(read, reader);
        for (topic, lines) in &self.0 {
            let found = read.messages.get(topic).map_or(0, Vec::len);
            assert_eq!(found, lines.len(), "{reader}: messages of {topic}");
        }
    }

    /// All that the reader found is what was recorded, from the first message of each topic on.
    #[track_caller]
    pub fn assert_begins_with(&self, read: &Read, reader: &str) {
        for (topic, found) in &read.messages {
            let Some(lines) = self.0.get(topic) else {
                panic!("{reader}: {topic} was not recorded");
            };
            assert!(found.len() <= lines.len(), "{reader}: too many of {topic}");
            let mut lines: Vec<_> = lines[..found.len()].iter().collect();
            if found.iter().all(|line| line.log_time.is_none()) {
                // The reader orders messages by the time in them.
                lines.sort_by_key(|line| line.publish_time);
            }
            for (number, (found, line)) in found.iter().zip(lines).enumerate() {
                line.assert_is(found, &format!("{reader}: message {number} of {topic}"));
            }
        }
    }
}

impl Line {
    /// The reader found this message, as far as it says.
    #[track_caller]
    pub fn assert_is(&self, found: &Line, what: &str) {
        for (expected, found) in self.fields.iter().zip(&found.fields) {
            assert_eq!(found, expected, "{what}");
        }
        assert_eq!(found.fields.len(), self.fields.len(), "{what}: fields");
        let times = [
            (self.log_time, found.log_time, "log time"),
            (self.publish_time, found.publish_time, "publish time"),
            (
                self.sequence.map(Into::into),
                found.sequence.map(Into::into),
                "sequence",
            ),
        ];
        for (expected, found, name) in times {
            assert!(
                found.is_none() || expected.is_none() || found == expected,
                "{what}: {name} {found:?}, not {expected:?}"
            );
        }
    }
}

/// The fields of a sample in shared memory.
pub fn fields_of(schema: &Schema, sample: &[u8]) -> Vec<String> {
    let mut fields = Vec::new();
    for leaf in schema.leaves() {
        for (index, value) in leaf.values(sample).enumerate() {
            let name = match leaf.len {
                Some(_) => format!("{}[{index}]", leaf.path),
                None => leaf.path.clone(),
            };
            fields.push(format!("{name}={}", number(value)));
        }
    }
    fields
}

/// A field with a number.
pub fn number(value: Value) -> String {
    match value {
        Value::Single(value) => float(value.into()),
        Value::Double(value) => float(value),
        Value::Unsigned(value) => value.to_string(),
        Value::Signed(value) => value.to_string(),
    }
}

/// The bits of a float, or `nan`.
fn float(value: f64) -> String {
    match value.is_nan() {
        true => "nan".to_owned(),
        false => format!("{:016x}", value.to_bits()),
    }
}

/// A text: its bytes in hexadecimal.
pub fn text(text: &str) -> String {
    text.bytes().map(|byte| format!("{byte:02x}")).collect()
}

/// The elements of a sequence of bytes.
pub fn bytes(name: &str, bytes: &[u8]) -> Vec<String> {
    if bytes.is_empty() {
        return vec![format!("{name}=[]")];
    }
    let elements = bytes.iter().enumerate();
    elements
        .map(|(index, byte)| format!("{name}[{index}]={byte}"))
        .collect()
}
