//! [`RecorderShell`]: the recorder between the ports of the robot's topics and the thread of the disk, in the loop of
//! every process.
//!
//! * `topics`: the ports; `disk`: the one thread that writes; `facts`: what the files say of the flight; `report`: what
//!   is printed.

pub(crate) mod disk;
pub(crate) mod facts;
pub(crate) mod report;
pub(crate) mod topics;

use std::os::fd::AsFd;
use std::time::Duration;

use ipc_types::{MonotonicNs, SchedulingRole, WaitError, Wake};
use module_kit::process::{Process, Sources};
use operator::render::words::count;
use recording::{Anchor, FileAction, Recorder, Totals};
use runtime::exit::{ExitCode, Failure};
use runtime::helper::HelperGone;
use status::log::store::{FileStore, Store};

use self::disk::{ActionResult, Disk, DiskGone, Note};
use self::facts::FactsOfRobot;
use self::report::Reporter;
use self::topics::{RecordedTopics, Wakes};
use crate::gather::Gather;
use crate::sinks::Sinks;

/// How long the end of the process waits for the disk. Most of what a disk does takes less; what takes longer may hang
/// for ever, and a process that cannot be ended is worse than an unknown number of messages.
const END_TIMEOUT: Duration = Duration::from_secs(2);

/// Why a recording cannot go on.
#[derive(Debug, thiserror::Error)]
pub(crate) enum RecordError {
    /// The operating system cannot wait any more.
    #[error(transparent)]
    Wait(#[from] WaitError),
    /// See [`DiskGone`].
    #[error(transparent)]
    Disk(#[from] DiskGone),
    /// The thread that looks at the robot's processes is gone.
    #[error(transparent)]
    Looks(#[from] HelperGone),
}

/// What the clocks show now.
pub(crate) fn anchor() -> Anchor {
    let clock = FileStore.clock();
    Anchor {
        monotonic: clock.monotonic,
        unix_ns: clock.unix_ns,
    }
}

/// A recording that goes on.
pub(crate) struct RecorderShell {
    topics: RecordedTopics,
    facts: FactsOfRobot,
    recorder: Recorder,
    sinks: Sinks,
    disk: Disk,
    reporter: Reporter,
    gather: Gather,
    /// When the recording is to end by itself.
    last: Option<MonotonicNs>,
    /// Until when the disk may take to end; `None` before the end was asked for.
    end: Option<MonotonicNs>,
    /// Whether the action that is outstanding is one that writes.
    is_writing: bool,
}

impl RecorderShell {
    pub fn new(
        topics: RecordedTopics,
        facts: FactsOfRobot,
        recorder: Recorder,
        sinks: Sinks,
        disk: Disk,
        reporter: Reporter,
        last: Option<MonotonicNs>,
    ) -> RecorderShell {
        RecorderShell {
            last,
            topics,
            facts,
            recorder,
            sinks,
            disk,
            reporter,
            gather: Gather::default(),
            end: None,
            is_writing: false,
        }
    }

    /// Says what became of the recording.
    ///
    /// # Errors
    ///
    /// Code 8 when the disk did not take every message, 1 when it did not answer at the end.
    pub fn conclude(&self) -> Result<(), Failure> {
        let totals = self.recorder.totals();
        self.reporter.end(&totals, self.topics.counts());
        if !self.recorder.is_ended() {
            return Err(Failure::internal(
                "the disk did not answer at the end: the last file is perhaps cut off",
            )
            .with_next_step(
                "`ril log check FILE` says what the file has, `ril log recover FILE` makes it whole",
            ));
        }
        match not_taken(&totals) {
            None => Ok(()),
            Some(text) => Err(Failure::new(ExitCode::NotInOrder, text).with_next_step(
                "make room, or take a faster disk; `ril log check FILE` says what a file has",
            )),
        }
    }

    fn take_samples(&mut self, now: MonotonicNs) {
        // What comes after the end was asked for belongs to no file, and is not lost either.
        if !self.gather.is_due(now) || self.end.is_some() {
            return;
        }
        let wakes = match self.gather.flows(now) {
            true => Wakes::Unneeded,
            false => Wakes::Needed,
        };
        let (recorder, sinks) = (&mut self.recorder, &mut self.sinks);
        let most = self.topics.drain(recorder, sinks, now, wakes);
        let has_come = self.topics.take_news();
        if has_come {
            self.facts.look_again();
        }
        if self.sinks.take_news() || has_come {
            self.describe();
        }
        if most > 0 {
            // The recorder's lines alone are no reason for a file.
            self.sinks.own_lines(&mut self.recorder, now);
        }
        self.gather.looked(now, most);
    }

    fn describe(&mut self) {
        let (layouts, running) = (self.topics.layouts(), self.sinks.running());
        self.recorder
            .describe(self.facts.flight_info(layouts, running));
    }

    fn take_outcome(&mut self, now: MonotonicNs) -> Result<(), RecordError> {
        let Some(ActionResult { result, notes }) = self.disk.outcome()? else {
            return Ok(());
        };
        let has_begun = notes.iter().any(|note| matches!(note, Note::Opened(_)));
        self.reporter.notes(notes);
        match &result {
            Err(error) => self.reporter.trouble(error),
            // That a file could be closed says nothing about the next one.
            Ok(()) if self.is_writing => self.reporter.works(),
            Ok(()) => {}
        }
        self.recorder.done(now, result);
        // What was before the first file has a snapshot already.
        if has_begun && self.recorder.totals().files > 1 {
            self.topics.ask_for_snapshots();
            self.sinks.begin_file();
        }
        Ok(())
    }

    /// Hands the next action to the disk, once the last one is done.
    fn act(&mut self) -> Result<(), RecordError> {
        if !self.disk.is_busy()
            && let Some(action) = self.recorder.next()
        {
            self.is_writing = matches!(action, FileAction::Write { .. });
            self.disk.perform(action)?;
        }
        Ok(())
    }
}

impl Process for RecorderShell {
    type Error = RecordError;
    type Key = ();

    const ROLE: SchedulingRole = SchedulingRole::Background;

    fn sources<'a>(&'a mut self, sources: &mut Sources<'a>) {
        sources.descriptor((), self.disk.as_fd());
        sources.descriptor((), self.facts.as_fd());
        if self.end.is_none() && self.gather.deadline().is_none() {
            sources.descriptor((), self.topics.ports().descriptor());
        }
    }

    fn drain(&mut self, _wake: Wake) -> Result<(), RecordError> {
        let now = MonotonicNs::now();
        if self.end.is_none() {
            self.take_samples(now);
        }
        if self.facts.take_found()? {
            self.describe();
        }
        self.take_outcome(now)?;
        if self.sinks.is_flight_over(&mut self.recorder, now) {
            self.recorder.split(now, anchor());
        }
        if self.recorder.deadline().is_some_and(|due| due <= now) {
            self.recorder.wake(now, anchor());
        }
        self.reporter.dropped(self.recorder.totals().dropped, now);
        self.act()
    }

    fn deadline(&self) -> Option<MonotonicNs> {
        // While the disk is busy, its answer comes first.
        let recorder = match self.disk.is_busy() {
            true => None,
            false => self.recorder.deadline(),
        };
        let gather = self.gather.deadline();
        // While samples flow, topics are drained with the next look for samples.
        let topics = self.topics.deadline().max(gather);
        [
            gather.filter(|_| self.end.is_none()),
            topics.filter(|_| self.end.is_none()),
            recorder,
            self.sinks.deadline(),
            self.reporter.deadline(),
            self.last.filter(|_| self.end.is_none()),
            self.end,
        ]
        .into_iter()
        .flatten()
        .min()
    }

    fn is_done(&self, now: MonotonicNs) -> bool {
        self.last.is_some_and(|last| last <= now)
    }

    /// Records what came until the end was asked for, and waits for the disk.
    fn may_end(&mut self, now: MonotonicNs) -> bool {
        let Some(end) = self.end else {
            self.gather = Gather::default();
            self.take_samples(now);
            self.topics.finish(&mut self.recorder, &mut self.sinks, now);
            self.sinks.end(&mut self.recorder, now);
            self.recorder.end(now);
            self.end = Some(now + END_TIMEOUT);
            return false;
        };
        self.recorder.is_ended() || now >= end
    }
}

/// What the disk did not take; `None` if it took everything, whatever else was in the way.
fn not_taken(totals: &Totals) -> Option<String> {
    // Of a file that failed, it is not known whether the disk has what was written and not yet forced onto it.
    let unsynced = totals.written - totals.synced;
    let missing = totals.added - totals.written;
    let (dropped, lost) = (count(missing, "message"), count(unsynced, "message"));
    (missing > 0 || unsynced > 0).then(|| {
        format!("the disk did not take everything: {dropped} dropped, {lost} perhaps lost")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_fails_only_by_messages_that_the_disk_did_not_take() {
        for ((added, written, synced), expected) in [
            ((0, 0, 0), None),
            ((90, 90, 90), None),
            (
                (90, 88, 88),
                Some("2 messages dropped, 0 messages perhaps lost"),
            ),
            (
                (90, 90, 89),
                Some("0 messages dropped, 1 message perhaps lost"),
            ),
        ] {
            let totals = Totals {
                added,
                written,
                synced,
                files: 7,
                ..Totals::default()
            };
            let text = not_taken(&totals);
            let said = text.as_deref().and_then(|text| text.split_once(": "));
            assert_eq!(said.map(|(_, what)| what), expected);
        }
    }
}
