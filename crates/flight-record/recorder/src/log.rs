//! [`LogTopic`]: lines of a log, as viewers show them: those of the processes, and those that are made of the bridge's
//! states and of its requests. [`RecorderTopic`]: a topic that the recorder makes itself.

use ipc_types::code::LinkState;
use ipc_types::payload::{ModuleState, SharedStruct, StatusJournal};
use ipc_types::{MonotonicNs, RobotId};
use module_kit::journal::{Entry, JournalReader, LogLine};
use operator::robot::changes;
use recording::{Anchor, Channel, ChannelId, Recorder};
use recording::{FLIGHT, topic};
use ros_messages::{Level, Log, OFFERED_QOS_PROFILES, Qos, UnixOffset, definition};

/// Makes lines of a log.
#[derive(Debug)]
pub struct LogTopic {
    offset: UnixOffset,
    output: RecorderTopic,
    last: Option<ModuleState>,
    status: JournalReader,
}

impl LogTopic {
    /// Of `robot`, with times that count from `anchor`.
    pub fn new(robot: RobotId, anchor: Anchor) -> LogTopic {
        LogTopic {
            offset: offset_of(anchor),
            output: RecorderTopic::new(topic(robot, "log"), Log::TYPE_NAME, Qos::STATE),
            last: None,
            status: JournalReader::new(),
        }
    }

    /// Adds a line that a process has logged.
    pub fn process(
        &mut self,
        recorder: &mut Recorder,
        times: (MonotonicNs, MonotonicNs),
        process: &str,
        line: &LogLine<'_>,
    ) {
        if line.lost > 0 {
            let text = format!("{} more lines of the log were lost", line.lost);
            self.write(recorder, times, (process, ""), Level::Warn, &text);
        }
        let source = (process, line.module);
        let level = level_of(line.level);
        self.write(recorder, times, source, level, line.text);
    }

    /// Adds the lines of a piece of status's journal, as it lies in shared memory.
    pub fn status(&mut self, recorder: &mut Recorder, piece: &[u8], now: MonotonicNs) {
        let Some(piece) = StatusJournal::from_bytes(piece) else {
            return;
        };
        let mut reader = std::mem::take(&mut self.status);
        reader.take(&piece);
        // After bytes that are no record, reading goes on at the next snapshot; the pieces are recorded as they are.
        while let Ok(Some(record)) = reader.next::<status::Input, status::Output>() {
            if let Entry::Line(line) = &record.entry {
                self.process(recorder, (now, record.at), "status", line);
            }
        }
        self.status = reader;
    }

    /// Adds a line about what happened at `at`.
    pub fn add(
        &mut self,
        recorder: &mut Recorder,
        times: (MonotonicNs, MonotonicNs),
        level: Level,
        text: &str,
    ) {
        self.write(recorder, times, (FLIGHT, ""), level, text);
    }

    fn write(
        &mut self,
        recorder: &mut Recorder,
        (now, at): (MonotonicNs, MonotonicNs),
        (process, module): (&str, &str),
        level: Level,
        text: &str,
    ) {
        let line = Log {
            unix_ns: self.offset.unix_ns(at),
            level,
            process,
            text,
            module,
        };
        self.output.add(recorder, now, at, &line.write());
    }

    /// Adds what has changed with a state of the bridge.
    pub fn state(&mut self, recorder: &mut Recorder, state: &ModuleState, now: MonotonicNs) {
        for (level, text) in lines(self.last.as_ref(), state) {
            self.add(
                recorder,
                (now, MonotonicNs(state.published_ns)),
                level,
                &text,
            );
        }
        self.last = Some(*state);
    }
}

/// The level of ROS 2 that a level of our processes is.
fn level_of(level: tracing::Level) -> Level {
    match level {
        tracing::Level::ERROR => Level::Error,
        tracing::Level::WARN => Level::Warn,
        tracing::Level::INFO => Level::Info,
        _ => Level::Debug,
    }
}

/// What a state says that the last one did not.
fn lines(last: Option<&ModuleState>, state: &ModuleState) -> Vec<(Level, String)> {
    let mut lines: Vec<(Level, String)> = Vec::new();
    if last.is_none_or(|last| last.link.state() != state.link.state())
        && let Some(link) = state.link.state()
        && link != LinkState::Up
    {
        lines.push((Level::Warn, format!("link to the DSP {link}")));
    }
    let of = |state: &ModuleState| (state.status, state.functionality);
    if last.map(of) != Some(of(state))
        && let Some((status, functionality)) = state.status().zip(state.functionality())
    {
        lines.push((Level::Info, format!("module {status}, {functionality}")));
    }
    let Some(last) = last else { return lines };
    let errors = &state.dsp_errors;
    if last.epoch_ns == state.epoch_ns && last.dsp_errors.total < errors.total {
        lines.push((Level::Error, format!("DSP error {}", errors.last_code)));
    }
    let changes = changes::of_states(last, state).into_iter();
    lines.extend(changes.map(|(weight, text)| (weight.into(), text)));
    lines
}

/// What turns monotonic times into those of `anchor`.
pub fn offset_of(anchor: Anchor) -> UnixOffset {
    let offset_ns = i128::from(anchor.unix_ns) - i128::from(anchor.monotonic.0);
    // Neither clock comes near the ends of the range within three centuries.
    UnixOffset(i64::try_from(offset_ns).unwrap_or_default())
}

/// A topic that the recorder makes itself.
#[derive(Debug)]
pub struct RecorderTopic {
    channel: Channel,
    id: Option<ChannelId>,
    sequence: u32,
}

impl RecorderTopic {
    /// The topic whose messages have the type `type_name` of the crate `ros-messages`. It is in the file once it has a
    /// message.
    pub fn new(topic: String, type_name: &str, qos: Qos) -> RecorderTopic {
        let text = definition(type_name).unwrap_or_default();
        RecorderTopic::with_text(topic, type_name, text, qos)
    }

    /// A topic whose messages have the type that `schema_text` defines.
    pub fn with_text(
        topic: String,
        type_name: &str,
        schema_text: String,
        qos: Qos,
    ) -> RecorderTopic {
        let metadata = [
            ("made_by", "recorder".to_owned()),
            (OFFERED_QOS_PROFILES, qos.offered_profiles()),
        ];
        RecorderTopic {
            channel: Channel {
                topic,
                schema_name: type_name.to_owned(),
                schema_text,
                metadata: metadata.map(|(key, value)| (key.to_owned(), value)).into(),
            },
            id: None,
            sequence: 0,
        }
    }

    /// Records the next message, which says what was at `at`.
    pub fn add(&mut self, recorder: &mut Recorder, now: MonotonicNs, at: MonotonicNs, cdr: &[u8]) {
        if self.id.is_none() {
            self.id = recorder.channel(self.channel.clone());
        }
        if let Some(id) = self.id {
            self.sequence = self.sequence.wrapping_add(1);
            recorder.add(now, id, at, self.sequence, cdr);
        }
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::code::{Functionality, ModuleStatus};

    use super::*;

    #[test]
    fn each_change_is_a_line_once() {
        let mut state = ModuleState {
            epoch_ns: 1,
            status: ModuleStatus::Running.code(),
            functionality: Functionality::AtRest.code(),
            ..ModuleState::default()
        };
        state.link.state = LinkState::Gone.code();
        let texts = |last: Option<&ModuleState>, state: &ModuleState| -> Vec<String> {
            let lines = lines(last, state).into_iter();
            lines.map(|(_, text)| text).collect()
        };
        let first = texts(None, &state);
        assert_eq!(first.len(), 2, "{first:?}");
        assert!(first[0].starts_with("link to the DSP"), "{first:?}");
        assert_eq!(texts(Some(&state), &state), Vec::<String>::new());
        let before = state;
        state.link.state = LinkState::Up.code();
        state.dsp_errors.total = 1;
        state.dsp_errors.last_code = 7;
        let next = texts(Some(&before), &state);
        assert_eq!(next, ["DSP error 7", "link to the DSP up"]);
    }
}
