//! What all commands share that watch the samples of a topic: its name and schema, their options, the loop that waits
//! and drains, and `WatchTimeout`, which knows when it is enough.
//!
//! Samples are bytes here, which their schema describes: what is done with them is the same whether this program was
//! built with their struct or not.

use std::fs::File;
use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::time::Duration;

use clap::Args;
use ipc_types::schema::LoadError;
use ipc_types::service::{is_key, own};
use ipc_types::{Descriptor, DynamicSubscriber, Losses, MonotonicNs, Schema, dynamic};
use operator::options::duration;
use operator::robot::absence::{absent, nothing_came};
use operator::session::{Session, configuration};
use operator::topic_name::{SHORT_NAMES, key_of};
use runtime::args::CommonArgs;
use runtime::exit::{ExitCode, Failure, OrFail};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{FileType, fstat};

/// Reads the key or the short name of a topic.
pub(super) fn topic_key(text: &str) -> Result<String, String> {
    // The name that a recording has for the topic, with the robot in front.
    let in_recording = text
        .strip_prefix("/robot")
        .and_then(|rest| rest.split_once('/'));
    match (is_key(key_of(text)), in_recording) {
        (true, _) => Ok(key_of(text).to_owned()),
        (false, Some((robot, name))) => Err(format!(
            "here the topic is called `{name}`, and the robot --robot {robot}"
        )),
        (false, None) => Err("a topic is called such as battery_watch/cell_voltages".to_owned()),
    }
}

/// What every command takes that watches a stream.
#[derive(Args, Clone, Debug)]
pub struct StreamArgs {
    /// Topic, as `ril topic list` shows it, such as battery_watch/cell_voltages; or dsp, hero, state
    #[arg(value_name = "TOPIC", value_parser = topic_key)]
    pub topic: String,

    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// End after this time, such as 10s
    #[arg(long, value_name = "DURATION", value_parser = duration)]
    pub duration: Option<Duration>,

    /// How long to wait for the first sample, and for a publisher that is gone, such as 5s or 200ms [default: 2s, or
    /// ril.toml]
    #[arg(long, value_name = "DURATION", env = "RIL_TIMEOUT", value_parser = duration)]
    pub timeout: Option<Duration>,
}

/// What the samples of the topic `key` hold; one of the robot's own may be there before its publisher.
///
/// # Errors
///
/// Code 3 when there is no such topic, with those that there are; 1 when its schema cannot be used.
pub(super) fn schema_of(session: &Session, key: &str) -> Result<Schema, Failure> {
    let robot = session.ipc.robot();
    match dynamic::schema_of(&session.ipc, key) {
        Err(LoadError::Missing(_)) if own(key).is_some() => Err(absent(session, key)),
        Err(LoadError::Missing(_)) => {
            let topics = dynamic::topics(&session.ipc).into_iter();
            let keys: Vec<String> = topics.map(|topic| topic.key).collect();
            let there = match keys.is_empty() {
                true => "none now".to_owned(),
                false => keys.join(", "),
            };
            let text = format!("robot {robot} has no topic {key}; it has {there}");
            let own = SHORT_NAMES
                .iter()
                .flat_map(|(short, service, _)| [*short, service.key()]);
            let known = keys.iter().map(String::as_str).chain(own);
            let next_step = match runtime::config::nearest(key, known) {
                Some(near) => format!("did you mean `{near}`?"),
                None => "start the module that publishes it, and try again".to_owned(),
            };
            Err(Failure::new(ExitCode::ServiceAbsent, text).with_next_step(next_step))
        }
        result => result.or_fail(ExitCode::Internal),
    }
}

/// A topic that a command watches.
pub(super) struct Watched {
    pub session: Session,
    /// Last part of its name, such as `hero_telemetry`.
    pub key: String,
    /// What its samples hold.
    pub schema: Schema,
}

/// The samples of a topic, and how long they are watched.
pub(super) struct Stream {
    samples: DynamicSubscriber,
    limits: StreamLimits,
}

impl Stream {
    /// Subscribes to a topic, to end after `count` samples.
    ///
    /// # Errors
    ///
    /// Code 3 when there is no such topic, 1 when its schema cannot be used.
    pub fn open(args: &StreamArgs, count: Option<u64>) -> Result<(Watched, Stream), Failure> {
        let config = configuration(&args.common)?;
        let session = Session::join(&args.common)?;
        let schema = schema_of(&session, &args.topic)?;
        let samples = DynamicSubscriber::open(&session.ipc, &args.topic, &schema);
        let stream = Stream {
            samples: samples.or_fail(ExitCode::Internal)?,
            limits: StreamLimits {
                count,
                duration: args.duration,
                timeout: args.timeout.unwrap_or_else(|| config.observe.timeout()),
            },
        };
        let watched = Watched {
            session,
            key: args.topic.clone(),
            schema,
        };
        Ok((watched, stream))
    }

    /// Hands samples to `watcher` until it is enough, nothing comes any more, or a signal comes, which is enough, too;
    /// then `finish` is called with what was lost.
    ///
    /// # Errors
    ///
    /// What `watcher` and `finish` fail with; code 3 or 4 when nothing came in time; the quiet end when the reader of
    /// standard output has gone.
    pub fn watch<W: Watcher>(
        mut self,
        watched: &Watched,
        mut watcher: W,
        finish: impl FnOnce(W, Losses) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let end = self.follow(watched, &mut watcher)?;
        finish(watcher, self.samples.losses())?;
        match end {
            WatchStep::Nothing => {
                let timeout = self.limits.timeout;
                Err(nothing_came(&watched.session, &watched.key, timeout)?)
            }
            _ => Ok(()),
        }
    }

    fn follow(
        &mut self,
        watched: &Watched,
        watcher: &mut impl Watcher,
    ) -> Result<WatchStep, Failure> {
        let session = &watched.session;
        let mut timeout = WatchTimeout::new(self.limits, MonotonicNs::now());
        let pipe = OutputPipe::of_this_process();
        let mut reader = pipe.as_ref().map(|pipe| Descriptor::new(pipe.as_fd()));
        while !session.termination.requested() {
            let count = take(&mut self.samples, timeout.wanted(), watcher)?;
            let now = MonotonicNs::now();
            timeout.came(count, now);
            watcher.woken(self.samples.losses(), now)?;
            match timeout.next(now) {
                WatchStep::Wait(until) => {
                    let until = watcher.wake_at().map_or(until, |at| until.min(at));
                    let reader = reader.as_mut().map(|reader| reader as _);
                    let sources = [&mut self.samples as _].into_iter().chain(reader);
                    session.wait(sources, Some(until))?;
                    if pipe.as_ref().is_some_and(OutputPipe::is_closed) {
                        return Err(Failure::output(io::ErrorKind::BrokenPipe.into()));
                    }
                }
                WatchStep::Look => timeout.provider(session.is_provided(&watched.key)?, now),
                end => return Ok(end),
            }
        }
        Ok(WatchStep::Enough)
    }
}

/// What is done with the samples.
pub(super) trait Watcher {
    /// Takes a sample's bytes, and says whether it counts as one of those that were asked for.
    fn sample(&mut self, payload: &[u8]) -> Result<bool, Failure>;

    /// Called after every wake, when all samples that were there have been taken.
    fn woken(&mut self, losses: Losses, now: MonotonicNs) -> Result<(), Failure>;

    /// When to be woken even if nothing comes.
    fn wake_at(&self) -> Option<MonotonicNs> {
        None
    }
}

/// Hands on what is there, at most `wanted` samples that count, and says how many those were.
fn take(
    samples: &mut DynamicSubscriber,
    wanted: u64,
    watcher: &mut impl Watcher,
) -> Result<u64, Failure> {
    let mut count = 0;
    let mut result = Ok(());
    let received = samples.drain(|payload| {
        if count < wanted && result.is_ok() {
            match watcher.sample(payload) {
                Ok(counts) => count += u64::from(counts),
                Err(failure) => result = Err(failure),
            }
        }
    });
    if let Err(error) = received {
        tracing::warn!(%error, "samples could not be received");
    }
    result.map(|()| count)
}

/// A pipe's end for writing.
struct OutputPipe(File);

impl OutputPipe {
    /// Standard output of this process, if that is a pipe.
    fn of_this_process() -> Option<OutputPipe> {
        let output = io::stdout().as_fd().try_clone_to_owned().ok()?;
        OutputPipe::of(output.into())
    }

    fn of(output: File) -> Option<OutputPipe> {
        let mode = fstat(&output).ok()?.st_mode;
        (FileType::from_raw_mode(mode) == FileType::Fifo).then_some(OutputPipe(output))
    }

    /// Whether nothing that is written will be read.
    fn is_closed(&self) -> bool {
        let mut polled = [PollFd::new(&self.0, PollFlags::empty())];
        // Trouble of `poll` itself says nothing about the reader.
        let _ = poll(&mut polled, Some(&Timespec::default()));
        polled[0].revents().contains(PollFlags::ERR)
    }
}

impl AsFd for OutputPipe {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

/// While nothing comes, the publisher is looked for this many times in each timeout, so that it is missed for at least
/// three quarters of the timeout before the command gives up.
const LOOKS_PER_TIMEOUT: u32 = 4;

/// What the operator asked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct StreamLimits {
    /// End after so many samples.
    pub count: Option<u64>,
    /// End after so long.
    pub duration: Option<Duration>,
    /// How long to wait for the first sample, and for a publisher that is gone.
    pub timeout: Duration,
}

/// What to do next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum WatchStep {
    /// Wait for samples, at most until then.
    Wait(MonotonicNs),
    /// Say by [`WatchTimeout::provider`] whether the publisher lives.
    Look,
    /// All samples that were asked for have come, or the time is over.
    Enough,
    /// Nothing came in time, or the publisher has been gone too long.
    Nothing,
}

/// How long a command goes on watching. A pure value: it is given samples, the time and whether the publisher lives,
/// and says when to look again or how it ends.
#[derive(Debug)]
pub(super) struct WatchTimeout {
    limits: StreamLimits,
    began: MonotonicNs,
    samples: u64,
    /// When there last was a sign of the publisher: a sample, or that it lives.
    sign: MonotonicNs,
    next_look: MonotonicNs,
}

impl WatchTimeout {
    /// Begins to watch.
    pub fn new(limits: StreamLimits, now: MonotonicNs) -> WatchTimeout {
        WatchTimeout {
            limits,
            began: now,
            samples: 0,
            sign: now,
            next_look: now,
        }
    }

    /// How many more samples are wanted.
    pub fn wanted(&self) -> u64 {
        let count = self.limits.count.unwrap_or(u64::MAX);
        count.saturating_sub(self.samples)
    }

    /// So many samples came, of those that were wanted.
    pub fn came(&mut self, samples: u64, now: MonotonicNs) {
        if samples > 0 {
            self.samples += samples;
            self.sign = now;
            self.next_look = now + self.limits.timeout / LOOKS_PER_TIMEOUT;
        }
    }

    /// Whether the publisher lives. Before the first sample that is not enough: a publisher that never publishes
    /// anything is not waited for.
    pub fn provider(&mut self, lives: bool, now: MonotonicNs) {
        self.next_look = now + self.limits.timeout / LOOKS_PER_TIMEOUT;
        if lives && self.samples > 0 {
            self.sign = now;
        }
    }

    /// What to do at `now`.
    pub fn next(&self, now: MonotonicNs) -> WatchStep {
        let end = self.limits.duration.map(|duration| self.began + duration);
        let give_up = self.sign + self.limits.timeout;
        if self.wanted() == 0 || (self.samples > 0 && end.is_some_and(|end| now >= end)) {
            WatchStep::Enough
        } else if now >= give_up {
            WatchStep::Nothing
        } else if now >= self.next_look {
            WatchStep::Look
        } else {
            let end = end.filter(|_| self.samples > 0);
            let until = self.next_look.min(give_up);
            WatchStep::Wait(end.map_or(until, |end| until.min(end)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pipe_is_closed_when_its_last_reader_has_gone() {
        let (reader, writer) = io::pipe().unwrap();
        let other = reader.try_clone().unwrap();
        let output = OutputPipe::of(File::from(std::os::fd::OwnedFd::from(writer))).unwrap();
        drop(reader);
        assert!(!output.is_closed());
        drop(other);
        assert!(output.is_closed());
    }

    #[test]
    fn a_file_is_no_pipe() {
        assert!(OutputPipe::of(File::open("/dev/null").unwrap()).is_none());
    }

    const fn at(ms: u64) -> MonotonicNs {
        MonotonicNs(ms * 1_000_000)
    }

    const LIMITS: StreamLimits = StreamLimits {
        count: None,
        duration: None,
        timeout: Duration::from_millis(1000),
    };

    /// Watches from 0 ms; samples come at the given times, the publisher lives in the given interval. Returns when and
    /// how it ended; without an end after a minute, nothing.
    fn watch(
        limits: StreamLimits,
        samples: &[u64],
        lives: std::ops::Range<u64>,
    ) -> Option<(u64, WatchStep)> {
        let mut timeout = WatchTimeout::new(limits, at(0));
        let mut samples = samples.iter().copied().peekable();
        let mut now = 0;
        while now < 60_000 {
            while samples.next_if(|sample| *sample <= now).is_some() {
                timeout.came(1, at(now));
            }
            match timeout.next(at(now)) {
                WatchStep::Look => timeout.provider(lives.contains(&now), at(now)),
                WatchStep::Wait(until) => {
                    let until = until.0 / 1_000_000;
                    assert!(until > now, "a wait that is no wait");
                    now = samples.peek().map_or(until, |sample| until.min(*sample));
                }
                end => return Some((now, end)),
            }
        }
        None
    }

    #[test]
    fn the_first_sample_is_waited_for_once_the_timeout() {
        assert_eq!(
            watch(LIMITS, &[], 0..0),
            Some((1000, WatchStep::Nothing)),
            "no publisher"
        );
        assert_eq!(
            watch(LIMITS, &[], 0..9999),
            Some((1000, WatchStep::Nothing)),
            "silent from the start"
        );
    }

    #[test]
    fn a_publisher_that_lives_may_be_silent_for_ever() {
        assert_eq!(watch(LIMITS, &[900], 0..u64::MAX), None);
    }

    #[test]
    fn a_publisher_that_is_gone_is_waited_for() {
        assert_eq!(
            watch(LIMITS, &[100, 200], 0..200),
            Some((1200, WatchStep::Nothing))
        );
        let restarted_in_time = [100, 1050, 1100];
        assert_eq!(
            watch(LIMITS, &restarted_in_time, 0..110),
            Some((2100, WatchStep::Nothing))
        );
        // Seen alive at 4850, looked for every 250 ms.
        assert_eq!(
            watch(LIMITS, &[100], 0..5000),
            Some((5850, WatchStep::Nothing))
        );
    }

    #[test]
    fn a_count_is_met_exactly() {
        let limits = StreamLimits {
            count: Some(2),
            ..LIMITS
        };
        assert_eq!(
            watch(limits, &[10, 20, 30], 0..100),
            Some((20, WatchStep::Enough))
        );
        let mut timeout = WatchTimeout::new(limits, at(0));
        assert_eq!(timeout.wanted(), 2);
        timeout.came(1, at(1));
        assert_eq!(timeout.wanted(), 1);
        assert_eq!(WatchTimeout::new(LIMITS, at(0)).wanted(), u64::MAX);
    }

    #[test]
    fn a_duration_ends_well_only_with_a_sample() {
        let limits = StreamLimits {
            duration: Some(Duration::from_millis(300)),
            ..LIMITS
        };
        assert_eq!(
            watch(limits, &[10, 20], 0..u64::MAX),
            Some((300, WatchStep::Enough))
        );
        assert_eq!(
            watch(limits, &[], 0..u64::MAX),
            Some((1000, WatchStep::Nothing))
        );
        assert_eq!(
            watch(limits, &[500], 0..u64::MAX),
            Some((500, WatchStep::Enough))
        );
    }
}
