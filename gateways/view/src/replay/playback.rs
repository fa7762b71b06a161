//! [`Playback`]: the one playhead of a recording for all viewers, and what they get where it is. [`ReplayTopics`]: the
//! recorded topics for Foxglove clients, with the bytes and times of the file.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use ipc_types::MonotonicNs;
use recording::play::Playhead;
use recording::read::RecordedMessage;
use runtime::exit::Failure;

use super::recording::Recording;
use crate::messages;
use crate::page::{ReplayAction, ReplayInfo, ReplayRequest, ReplayStatus};
use crate::speaker::{Speaker, SpokenRobot};
use crate::{Channel, ChannelId, Server, ViewerId};

/// Time between two jumps: each sends the last minutes anew, and a hand that draws the scrubber asks for dozens in a
/// second.
const JUMP_PERIOD: Duration = Duration::from_millis(200);

/// How often pages get the position although nothing has changed.
const SAY_PERIOD: Duration = Duration::from_secs(1);

/// The one playhead of a recording for all viewers.
pub(crate) struct Playback {
    recording: Recording,
    head: Playhead,
    found: Option<FileChannels>,
    topics: ReplayTopics,
    /// Whether a viewer has come or wanted something so far: when the first page comes, it begins to play.
    has_begun: bool,
    /// Where to jump to.
    jump: Option<Duration>,
    jumped_at: MonotonicNs,
    /// Whether a client has come that wants the samples that hold here.
    is_wanted_anew: bool,
    /// Whether the position is to be sent at once.
    has_changed: bool,
    said_at: MonotonicNs,
}

impl Playback {
    /// Reads a recording.
    ///
    /// # Errors
    ///
    /// Code 2 when the file cannot be read or is no recording.
    pub fn open(path: &Path) -> Result<(Playback, ReplayInfo), Failure> {
        let mut found = FileChannels::default();
        let (recording, info) = Recording::open(path, |message| found.take(message))?;
        let playback = Playback {
            head: Playhead::new(recording.length()),
            recording,
            found: Some(found),
            topics: ReplayTopics::default(),
            has_begun: false,
            jump: None,
            jumped_at: MonotonicNs(0),
            is_wanted_anew: false,
            has_changed: true,
            said_at: MonotonicNs(0),
        };
        Ok((playback, info))
    }

    /// Says what there is to see.
    pub fn offer(&mut self, server: &mut Server) {
        server.set_robots(vec![self.recording.robot().get()]);
        if let Some(found) = self.found.take() {
            self.topics = ReplayTopics::offer(found, server);
        }
    }

    /// Does what a page wants.
    pub fn take(&mut self, request: &ReplayRequest, now: MonotonicNs) {
        match (request.action, request.position_s, request.speed) {
            (ReplayAction::Play, _, _) => {
                let was_ended = self.head.is_ended(now);
                self.head.play(now);
                if was_ended {
                    self.jump = Some(Duration::ZERO);
                }
            }
            (ReplayAction::Pause, _, _) => self.head.pause(now),
            (ReplayAction::Speed, _, Some(speed)) => self.head.set_speed(speed, now),
            (ReplayAction::Seek, Some(position_s), _) => {
                // What is no number or negative is the beginning.
                let position = Duration::try_from_secs_f64(position_s.max(0.0));
                let position = position.unwrap_or(self.recording.length());
                self.head.seek(position, now);
                self.jump = Some(self.head.position(now));
            }
            (ReplayAction::Speed | ReplayAction::Seek, _, _) => {}
        }
        (self.has_changed, self.has_begun) = (true, true);
    }

    /// A page has come: it gets the position, and the minutes before it.
    pub fn join(
        &mut self,
        viewer: ViewerId,
        server: &mut Server,
        speaker: &mut Speaker,
        now: MonotonicNs,
    ) {
        self.begin(now);
        if self.jump.is_some() {
            // All pages are about to get all anew.
            return;
        }
        self.go_on(server, now);
        self.say(server, now);
        let clock = self.recording.clock_at(self.head.position(now));
        let past = messages::past(&self.recording.played().robot, clock);
        server.past(viewer, &past);
        speaker.moved(std::iter::once(self.seen(true)));
    }

    /// A Foxglove client wants a topic that none has wanted before. Some clients have no control of the playback, and
    /// no page may be open.
    pub fn subscribed(&mut self, now: MonotonicNs) {
        self.is_wanted_anew = true;
        self.begin(now);
    }

    /// Begins to play for the first viewer.
    fn begin(&mut self, now: MonotonicNs) {
        if !std::mem::replace(&mut self.has_begun, true) {
            self.head.play(now);
            self.has_changed = true;
        }
    }

    /// Goes on to `now`, and says what is new.
    pub fn look(&mut self, server: &mut Server, speaker: &mut Speaker, now: MonotonicNs) {
        if self.jump.is_some() || self.is_wanted_anew {
            if now < self.jumped_at + JUMP_PERIOD {
                return;
            }
            if self.jump(server, now) {
                // Pages get all anew: the position first.
                speaker.moved(std::iter::once(self.seen(true)));
                return;
            }
        }
        let has_news = self.go_on(server, now);
        if self.has_changed || now >= self.said_at + SAY_PERIOD {
            self.say(server, now);
        }
        let clock = self.recording.clock_at(self.head.position(now));
        let seen = self.seen(has_news);
        speaker.speak(std::iter::once(seen), server, clock, now);
    }

    /// Goes elsewhere, and gives Foxglove clients the last samples before. Says whether pages are to get all anew.
    fn jump(&mut self, server: &mut Server, now: MonotonicNs) -> bool {
        self.jumped_at = now;
        self.is_wanted_anew = false;
        if self.jump.is_some() {
            // Before the samples, which clients drop that do not know yet.
            self.say(server, now);
        }
        let position = self.head.position(now);
        let mut last: BTreeMap<ChannelId, RecordedMessage> = BTreeMap::new();
        let topics = &self.topics;
        self.recording.jump_to(position, |message| {
            if let Some(channel) = topics.wanted(message, server) {
                last.insert(channel, message.clone());
            }
        });
        let mut last: Vec<_> = last.into_iter().collect();
        last.sort_by_key(|(_, message)| message.log_time_ns);
        self.say_time(server, position);
        for (channel, message) in last {
            server.sample(channel, message.log_time_ns, message.data());
        }
        let is_elsewhere = self.jump.take().is_some();
        if is_elsewhere {
            server.begin_anew();
        }
        is_elsewhere
    }

    /// Goes on to `now`; says whether something came on the way.
    fn go_on(&mut self, server: &mut Server, now: MonotonicNs) -> bool {
        let position = self.head.position(now);
        let topics = &self.topics;
        let clock = self.recording.clock_at(position);
        let (mut has_news, mut has_time) = (false, false);
        self.recording.go_to(position, |message| {
            has_news = true;
            if let Some(channel) = topics.wanted(message, server) {
                // The time of a batch stands before it.
                if !std::mem::replace(&mut has_time, true) {
                    server.time(clock.unix_ns(clock.now));
                }
                server.sample(channel, message.log_time_ns, message.data());
            }
        });
        has_news
    }

    fn say_time(&self, server: &mut Server, position: Duration) {
        let clock = self.recording.clock_at(position);
        server.time(clock.unix_ns(clock.now));
    }

    /// Says where it is.
    fn say(&mut self, server: &mut Server, now: MonotonicNs) {
        let replay = ReplayStatus {
            position_s: self.head.position(now).as_secs_f64(),
            playing: self.head.is_playing(now),
            speed: self.head.speed(),
        };
        server.replay(&replay);
        (self.has_changed, self.said_at) = (false, now);
    }

    fn seen(&self, has_news: bool) -> SpokenRobot<'_> {
        SpokenRobot {
            robot: &self.recording.played().robot,
            has_news,
        }
    }
}

/// Topics that are offered at most, as many as a recorder writes.
const MAX_TOPICS: usize = recording::MAX_CHANNELS;

/// The topics of a file, by name. A topic whose layout changes is offered with the first one.
#[derive(Default)]
pub(crate) struct FileChannels(BTreeMap<String, Channel>);

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

/// The recorded topics for Foxglove clients, with the bytes and times of the file.
#[derive(Default)]
pub(crate) struct ReplayTopics(BTreeMap<String, ChannelId>);

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
