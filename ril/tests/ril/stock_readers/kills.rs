//! The file of a recorder that is killed, at every moment that there is: the kernel copies what lies in one page
//! without interruption, so a killed process has written whole parts, and of the longest part any of its pages.

use std::time::Duration;

use ipc_types::MonotonicNs;
use recording::{FileAction, Part};
use ril_tests::readers::Reader;
use ril_tests::readers::expected::Read;

use super::made::Made;

/// What is older than this has to be in the file.
const LOST_AT_MOST: Duration = Duration::from_millis(500);

/// Within a page nothing is interrupted, bytes.
const PAGE: usize = 4096;

/// The file of a recorder that was killed.
pub struct Kill {
    pub bytes: Vec<u8>,
    /// The last moment at which that is what lies there.
    at: MonotonicNs,
    /// Whether bytes may lie behind an ending: when the file is being extended, and before a finished file is cut to
    /// its length.
    has_rest: bool,
    /// In words.
    what: String,
}

/// All moments, from when the file has its beginning on.
pub fn kills(made: &Made) -> Vec<Kill> {
    let mut kills = Vec::new();
    let mut file = Vec::new();
    for (number, step) in made.steps.iter().enumerate() {
        let next = made.steps.get(number + 1);
        let until = next.map_or(step.at, |next| next.at);
        // The end of a finished file is not yet where the bytes end.
        let is_cut_next =
            next.is_some_and(|next| matches!(next.action, FileAction::Truncate { .. }));
        let mut kill = |bytes: &[u8], at, has_rest, what: String| {
            kills.push(Kill {
                bytes: bytes.to_vec(),
                at,
                has_rest: has_rest || is_cut_next,
                what: format!("killed at action {number}, {what}"),
            });
        };
        match &step.action {
            FileAction::Write { parts } if file.is_empty() => {
                parts.iter().for_each(|part| part.write_to(&mut file));
            }
            FileAction::Write { parts } => {
                let len = file.len();
                for (index, part) in parts.iter().enumerate() {
                    for end in pages(part) {
                        let mut file = file.clone();
                        let bytes = part.bytes[..end].to_vec();
                        Part { at: part.at, bytes }.write_to(&mut file);
                        let has_rest = file.len() > len;
                        kill(
                            &file,
                            step.at,
                            has_rest,
                            format!("after {end} bytes of part {index}"),
                        );
                    }
                    part.write_to(&mut file);
                    if index + 1 < parts.len() {
                        kill(
                            &file,
                            step.at,
                            file.len() > len,
                            format!("after part {index}"),
                        );
                    }
                }
            }
            FileAction::Truncate { len } => file.truncate(usize::try_from(*len).unwrap()),
            FileAction::Open { .. } | FileAction::Sync | FileAction::Close { .. } => continue,
        }
        kill(&file, until, false, "after it".to_owned());
    }
    assert!(kills.len() > 20, "{} kills", kills.len());
    assert!(kills.iter().any(|kill| kill.has_rest));
    kills
}

/// What [`recover`](recording::read::recover) makes of some of them, and of all that a reader may not open.
pub fn recovered(kills: &[Kill]) -> Vec<Kill> {
    let some = kills.iter().enumerate();
    let some = some.filter(|(number, kill)| kill.has_rest || number % 20 == 0);
    some.map(|(_, kill)| {
        let mut bytes = Vec::new();
        recording::read::recover(&kill.bytes, &mut bytes).unwrap();
        Kill {
            bytes,
            at: kill.at,
            has_rest: false,
            what: format!("{}, recovered", kill.what),
        }
    })
    .collect()
}

/// Ends of pages within a part: lengths that a write can have when its process is killed.
fn pages(part: &Part) -> Vec<usize> {
    let at = usize::try_from(part.at).unwrap();
    let first = at.next_multiple_of(PAGE) - at;
    (first..part.bytes.len())
        .step_by(PAGE)
        .filter(|end| *end > 0)
        .collect()
}

impl Kill {
    /// The reader opens the file, finds nothing but what was recorded, and misses nothing that is older than half a
    /// second.
    #[track_caller]
    pub fn assert_read(&self, made: &Made, read: &Read, reader: &Reader) {
        let what = format!("{reader}, {}", self.what);
        if self.has_rest && reader.needs_nothing_behind_the_end() && read.error.is_some() {
            // What is recovered is read by all.
            return;
        }
        // A reader that goes on behind the end complains when it has given all messages.
        let may_complain = self.has_rest && reader.goes_on_behind_the_end();
        assert!(
            read.error.is_none() || may_complain,
            "{what}: {:?}",
            read.error
        );
        made.expected.assert_begins_with(read, &what);
        let mut due = std::collections::BTreeMap::<&str, usize>::new();
        let old = made
            .given
            .iter()
            .filter(|(_, given)| *given + LOST_AT_MOST <= self.at);
        for (topic, _) in old {
            *due.entry(topic).or_default() += 1;
        }
        for (topic, due) in due {
            let found = read.messages.get(topic).map_or(0, Vec::len);
            assert!(
                found >= due,
                "{what}: {found} messages of {topic}, of {due} that are older than half a second"
            );
        }
    }
}
