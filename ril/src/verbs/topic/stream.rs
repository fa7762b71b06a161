//! What all commands that watch a stream of samples share: where samples come from, and the loop that waits, drains and
//! knows when it is enough.
//!
//! Samples are bytes here, which their schema describes: what is done with them is the same whether this program was
//! built with their struct or not.

use std::fs::File;
use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::time::Duration;

use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use ipc_types::service::own;
use ipc_types::{Descriptor, DynamicSubscriber, Losses, MonotonicNs, Schema, Topic, dynamic};
use runtime::exit::{ExitCode, Failure, OrFail};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{FileType, fstat};

use super::options;
use super::watch_timeout::{Limits, Next, WatchTimeout};
use crate::session::{Session, absent};

/// A topic that a command watches.
pub(super) struct Watched {
    /// Last part of its name, such as `hero_telemetry`.
    pub key: String,
    /// What its samples hold.
    pub schema: Schema,
}

impl Watched {
    /// One of the robot's own, which may be there before its publisher.
    pub fn own(topic: options::Topic) -> Watched {
        match topic {
            options::Topic::Dsp => Watched::of::<DspTelemetry>(),
            options::Topic::Hero => Watched::of::<HeroTelemetry>(),
            options::Topic::State => Watched::of::<ModuleState>(),
        }
    }

    fn of<T: Topic>() -> Watched {
        Watched {
            key: T::KEY.to_owned(),
            schema: Schema::of::<T>(),
        }
    }

    /// The topic `key`, whatever it is.
    ///
    /// # Errors
    ///
    /// Code 3 when there is no such topic, 1 when its schema cannot be used.
    pub fn find(session: &Session, key: &str) -> Result<Watched, Failure> {
        match dynamic::schema_of(&session.ipc, key) {
            Ok(schema) => Ok(Watched {
                key: key.to_owned(),
                schema,
            }),
            Err(ipc_types::schema::LoadError::Missing(_)) => Err(missing(session, key)),
            Err(error) => Err(error).or_fail(ExitCode::Internal),
        }
    }

    /// Subscribes to it.
    ///
    /// # Errors
    ///
    /// Code 1 when it carries something else.
    pub fn open(&self, session: &Session) -> Result<DynamicSubscriber, Failure> {
        DynamicSubscriber::open(&session.ipc, &self.key, &self.schema).or_fail(ExitCode::Internal)
    }

    /// Whether a live process publishes it.
    fn is_provided(&self, session: &Session) -> Result<bool, Failure> {
        session.is_provided(&self.key)
    }

    /// The failure that nothing came in time.
    pub fn nothing_came(&self, session: &Session, timeout: Duration) -> Result<Failure, Failure> {
        session.nothing_came(&self.key, timeout)
    }
}

/// The failure that there is no topic `key`, with what there is.
pub(super) fn missing(session: &Session, key: &str) -> Failure {
    if own(key).is_some() {
        return absent(key, session.ipc.robot());
    }
    let robot = session.ipc.robot();
    let keys: Vec<String> = dynamic::topics(&session.ipc)
        .into_iter()
        .map(|topic| topic.key)
        .collect();
    let there = match keys.as_slice() {
        [] => "it has none now".to_owned(),
        keys => format!("it has {}", keys.join(", ")),
    };
    let text = format!("robot {robot} has no topic {key}; {there}");
    Failure::new(ExitCode::ServiceAbsent, text)
        .with_next_step("start the module that publishes it, and try again")
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

/// Hands samples on until it is enough, nothing comes any more, or a signal comes; the latter is enough, too.
///
/// # Errors
///
/// What `watcher` fails with; the quiet end when the reader of standard output has gone.
pub(super) fn watch(
    session: &Session,
    watched: &Watched,
    samples: &mut DynamicSubscriber,
    limits: Limits,
    watcher: &mut impl Watcher,
) -> Result<Next, Failure> {
    let mut timeout = WatchTimeout::new(limits, MonotonicNs::now());
    let pipe = OutputPipe::of_this_process();
    let mut reader = pipe.as_ref().map(|pipe| Descriptor::new(pipe.as_fd()));
    while !session.termination.requested() {
        let count = take(samples, timeout.wanted(), watcher)?;
        let now = MonotonicNs::now();
        timeout.came(count, now);
        watcher.woken(samples.losses(), now)?;
        match timeout.next(now) {
            Next::Wait(until) => {
                let until = watcher.wake_at().map_or(until, |at| until.min(at));
                let reader = reader.as_mut().map(|reader| reader as _);
                session.wait([samples as _].into_iter().chain(reader), Some(until))?;
                if pipe.as_ref().is_some_and(OutputPipe::is_closed) {
                    return Err(Failure::output(io::ErrorKind::BrokenPipe.into()));
                }
            }
            Next::Look => {
                timeout.provider(watched.is_provided(session)?, now);
            }
            end => return Ok(end),
        }
    }
    Ok(Next::Enough)
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
pub(super) struct OutputPipe(File);

impl OutputPipe {
    /// Standard output of this process, if that is a pipe.
    pub(super) fn of_this_process() -> Option<OutputPipe> {
        let output = io::stdout().as_fd().try_clone_to_owned().ok()?;
        OutputPipe::of(output.into())
    }

    fn of(output: File) -> Option<OutputPipe> {
        let mode = fstat(&output).ok()?.st_mode;
        (FileType::from_raw_mode(mode) == FileType::Fifo).then_some(OutputPipe(output))
    }

    /// Whether nothing that is written will be read.
    pub(super) fn is_closed(&self) -> bool {
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
}
