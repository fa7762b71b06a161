//! [`Recording`]: the recorded robot at any moment of its file. However it is led there, a moment looks the same.
//!
//! The file is read once from its beginning to its end, and the robot is kept at some moments on the way. To go to a
//! moment is to go on from the last of these before it. So memory is bounded, whatever the length of the file: one
//! chunk of it, and the kept robots.
//!
//! [`Course`]: the phases and events of all of the recording, for the scrubber.

use std::path::Path;
use std::time::Duration;

use ipc_types::{MonotonicNs, RobotId};
use operator::robot::changes::Weight;
use operator::robot::clock::Clocks;
use recording::play::{FlightError, FlightMark, FlightStream};
use recording::read::RecordedMessage;
use runtime::exit::Failure;

use super::played::PlayedRobot;
use crate::page::{Phase, ReplayEvent, ReplayInfo};

/// Robots that are kept at most, of some 200 kB. At the bound every other one goes, and the next ones are kept twice as
/// far apart: the way from one to the next is a 32nd of the recording at most.
const MAX_KEPT: usize = 64;

/// Time from one robot that is kept to the next, at first.
const FIRST_SPACING: Duration = Duration::from_secs(10);

/// Damaged places that are named as events.
const MAX_DAMAGE: usize = 20;

/// What was done last.
enum PlayStep<'a> {
    Took(&'a RecordedMessage),
    Looked,
    /// No message and no look is left before the wanted moment.
    Done,
}

/// A robot that is kept.
struct KeptRobot {
    at: MonotonicNs,
    played: PlayedRobot,
    mark: FlightMark,
}

/// The recorded robot at any moment of its file.
pub(crate) struct Recording {
    stream: FlightStream,
    /// Where the message in `pending` lies.
    mark: FlightMark,
    /// The message that comes next, with its moment; `None` at the end of the file.
    pending: Option<(MonotonicNs, RecordedMessage)>,
    /// The one that came last.
    taken: Option<RecordedMessage>,
    played: PlayedRobot,
    /// Until when all was taken.
    now: MonotonicNs,
    kept: Vec<KeptRobot>,
    begin: MonotonicNs,
    end: MonotonicNs,
    /// Why parts of the file cannot be read, and when; `None` once that is known. Each damaged place is met again at
    /// each pass.
    damage: Option<Vec<(MonotonicNs, String)>>,
}

impl Recording {
    /// Reads the file from its beginning to its end; gives what the scrubber needs, and lets `seen` see each message.
    ///
    /// # Errors
    ///
    /// Code 2 when the file cannot be read or is no recording.
    pub fn open(
        path: &Path,
        mut seen: impl FnMut(&RecordedMessage),
    ) -> Result<(Recording, ReplayInfo), Failure> {
        let stream = FlightStream::open(path).map_err(|error| unreadable(path, &error))?;
        let mut recording = Recording::new(stream);
        let course = recording.scan(&mut seen);
        let (phases, events) = course.finish();
        let name = path.file_name().unwrap_or(path.as_os_str());
        let info = ReplayInfo {
            file: name.to_string_lossy().into_owned(),
            duration_s: recording.length().as_secs_f64(),
            start_unix_ms: Some(recording.clock(recording.begin).unix_ms(recording.begin)),
            phases,
            events,
        };
        Ok((recording, info))
    }

    fn new(stream: FlightStream) -> Recording {
        let mut recording = Recording {
            mark: stream.mark(),
            played: PlayedRobot::new(stream.robot(), MonotonicNs(0)),
            stream,
            pending: None,
            taken: None,
            now: MonotonicNs(0),
            kept: Vec::new(),
            begin: MonotonicNs(0),
            end: MonotonicNs(0),
            damage: Some(Vec::new()),
        };
        recording.read();
        let first = recording.pending.as_ref().map(|(at, _)| *at);
        recording.begin = first.unwrap_or_default();
        recording.now = recording.begin;
        recording.end = recording.begin;
        recording.played = PlayedRobot::new(recording.robot(), recording.begin);
        recording
    }

    /// Goes through all of it, keeps robots on the way, and comes back to the beginning.
    fn scan(&mut self, seen: &mut impl FnMut(&RecordedMessage)) -> Course {
        let mut course = Course::new(self.begin);
        let mut spacing = FIRST_SPACING;
        let mut keep_at = self.begin;
        loop {
            self.keep(keep_at, &mut spacing);
            let Some((next, _)) = &self.pending else {
                break;
            };
            keep_at = (keep_at + spacing).max(*next);
            // The replay ends with the last message.
            while self.pending.is_some() {
                match self.step(keep_at) {
                    PlayStep::Took(message) => seen(message),
                    PlayStep::Looked => course.take(&self.played, self.now),
                    PlayStep::Done => break,
                }
            }
        }
        course.take(&self.played, self.end);
        for (at, text) in self.damage.take().unwrap_or_default() {
            course.event(at, Weight::Warning, &text);
        }
        self.go_to(Duration::ZERO, |_| {});
        course
    }

    fn keep(&mut self, at: MonotonicNs, spacing: &mut Duration) {
        if self.kept.len() == MAX_KEPT {
            let mut index = 0;
            self.kept.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            *spacing *= 2;
        }
        self.kept.push(KeptRobot {
            at,
            played: self.played.clone(),
            mark: self.mark,
        });
    }

    /// Reads the next message.
    fn read(&mut self) {
        self.pending = loop {
            self.mark = self.stream.mark();
            match self.stream.next() {
                None => break None,
                Some(Ok((at, message))) => break Some((MonotonicNs(at.0), message)),
                Some(Err(error)) => {
                    let damage = self.damage.as_mut();
                    if let Some(damage) = damage.filter(|damage| damage.len() < MAX_DAMAGE) {
                        damage.push((self.end, format!("recording: {error}")));
                    }
                }
            }
        };
    }

    /// Does what comes next until the moment `until`.
    fn step(&mut self, until: MonotonicNs) -> PlayStep<'_> {
        let look = self.played.deadline().filter(|look| *look <= until);
        let next = self.pending.as_ref().map(|(at, _)| *at);
        let next = next.filter(|at| *at <= until && look.is_none_or(|look| *at <= look));
        if let Some(at) = next
            && let Some((_, message)) = self.pending.take()
        {
            self.now = at;
            self.end = self.end.max(at);
            self.played.take(&message, at);
            self.read();
            return PlayStep::Took(self.taken.insert(message));
        }
        if let Some(look) = look {
            self.now = look;
            self.played.look(look);
            return PlayStep::Looked;
        }
        self.now = self.now.max(until);
        PlayStep::Done
    }

    /// Goes to a position, and lets `seen` see the messages on the way, which may begin anywhere before if it does not
    /// go on from here.
    pub fn go_to(&mut self, position: Duration, seen: impl FnMut(&RecordedMessage)) {
        let until = self.at(position);
        let kept = self.kept_before(until);
        if until < self.now || self.kept[kept].at > self.now {
            self.restore(kept);
        }
        self.run(until, seen);
    }

    /// Goes to a position; `seen` sees at least the messages of the time from one robot that is kept to the next, as
    /// far as there are some.
    pub fn jump_to(&mut self, position: Duration, seen: impl FnMut(&RecordedMessage)) {
        let until = self.at(position);
        self.restore(self.kept_before(until).saturating_sub(1));
        self.run(until, seen);
    }

    fn at(&self, position: Duration) -> MonotonicNs {
        (self.begin + position).min(self.end)
    }

    /// The first one is kept at the beginning.
    fn kept_before(&self, until: MonotonicNs) -> usize {
        let before = self.kept.partition_point(|kept| kept.at <= until);
        before.saturating_sub(1)
    }

    fn restore(&mut self, kept: usize) {
        let KeptRobot { at, played, mark } = &self.kept[kept];
        self.played = played.clone();
        self.now = *at;
        self.stream.go_to(*mark);
        self.read();
    }

    fn run(&mut self, until: MonotonicNs, mut seen: impl FnMut(&RecordedMessage)) {
        loop {
            match self.step(until) {
                PlayStep::Took(message) => seen(message),
                PlayStep::Looked => {}
                PlayStep::Done => break,
            }
        }
    }

    /// The robot as it is there.
    pub fn played(&self) -> &PlayedRobot {
        &self.played
    }

    /// The robot that was recorded.
    pub fn robot(&self) -> RobotId {
        self.stream.robot()
    }

    #[cfg(test)]
    pub fn kept(&self) -> usize {
        self.kept.len()
    }

    /// From the first message to the last.
    pub fn length(&self) -> Duration {
        self.end.since(self.begin)
    }

    /// The clocks of then at a position.
    pub fn clock_at(&self, position: Duration) -> Clocks {
        self.clock(self.begin + position)
    }

    fn clock(&self, now: MonotonicNs) -> Clocks {
        let anchor = self.stream.anchor();
        Clocks {
            now,
            zero_unix_ns: anchor.unix_ns.saturating_sub(anchor.monotonic.0),
        }
    }
}

fn unreadable(path: &Path, error: &FlightError) -> Failure {
    let text = format!("{} cannot be shown: {error}", path.display());
    Failure::usage(text).with_next_step(
        "name a recording that `ril record` has made; `ril log report` shows logs of other kinds",
    )
}

/// Most phases; a flight has some dozens. Further ones are left out.
const MAX_PHASES: usize = 500;

/// Most events, of 120 bytes in a message of 1 MiB. At the bound those that are only good to know go; further ones are
/// left out.
const MAX_EVENTS: usize = 2000;

/// The phases and events of the whole recording.
pub(crate) struct Course {
    begin: MonotonicNs,
    phases: Vec<Phase>,
    /// When the last of the phases began.
    phase_from: Option<MonotonicNs>,
    events: Vec<ReplayEvent>,
    /// Lines of the robot's journal that were taken.
    lines: u64,
}

impl Course {
    pub fn new(begin: MonotonicNs) -> Course {
        Course {
            begin,
            phases: Vec::new(),
            phase_from: None,
            events: Vec::new(),
            lines: 0,
        }
    }

    /// Takes what is new of the robot; to be called after each look.
    pub fn take(&mut self, played: &PlayedRobot, now: MonotonicNs) {
        let journal = &played.robot.journal;
        for line in journal.since(self.lines) {
            self.event(line.at, line.weight, &line.text);
        }
        self.lines = journal.added();
        let Some(phase) = played.robot.past.phases().last() else {
            return;
        };
        let to_s = self.position_s(phase.to.unwrap_or(now));
        if self.phase_from != Some(phase.from) {
            if self.phases.len() == MAX_PHASES {
                return;
            }
            self.phase_from = Some(phase.from);
            self.phases.push(Phase {
                from_s: self.position_s(phase.from),
                to_s,
                text: phase.text.to_owned(),
            });
        } else if let Some(last) = self.phases.last_mut() {
            last.to_s = to_s;
        }
    }

    /// Adds an event.
    pub fn event(&mut self, at: MonotonicNs, weight: Weight, text: &str) {
        if self.events.len() == MAX_EVENTS {
            self.events
                .retain(|event| event.severity >= Weight::Warning);
        }
        if self.events.len() < MAX_EVENTS {
            self.events.push(ReplayEvent {
                at_s: self.position_s(at),
                severity: weight,
                text: text.to_owned(),
            });
        }
    }

    fn position_s(&self, at: MonotonicNs) -> f64 {
        at.since(self.begin).as_secs_f64()
    }

    /// The phases and the events, in the order of time.
    pub fn finish(mut self) -> (Vec<Phase>, Vec<ReplayEvent>) {
        self.events
            .sort_by(|one, other| one.at_s.total_cmp(&other.at_s));
        (self.phases, self.events)
    }
}
