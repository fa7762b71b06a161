//! [`SetUp`] starts a process. [`run`] is its loop: one wait, deadlines, watchdog, end.
//!
//! Whatever wakes it, it services every source. That is also the safety net for a wake-up that the shared-memory
//! library can lose.

use std::fmt::Debug;
use std::os::fd::{AsFd, BorrowedFd};
use std::path::{Path, PathBuf};
use std::time::Duration;

use arrayvec::ArrayVec;
use ipc_types::waiter::{LONGEST_SLEEP, MAX_SOURCES};
use ipc_types::{
    Descriptor, Domain, Ipc, MonotonicNs, RobotId, SchedulingRole, Source, WaitError, Waiter, Wake,
    request_slice,
};
use runtime::args::CommonArgs;
use runtime::config::Fault;
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::notify::Notifier;
use runtime::signal::Termination;
use runtime::{config, logging};
use serde::de::DeserializeOwned;

/// How often a process has a [`round`](Process::round), and notifies its supervisor that it works: at the first wake
/// after that time, no process is woken for it.
pub const ROUND_PERIOD: Duration = Duration::from_millis(500);

/// What a process does with what wakes it.
pub trait Process {
    /// Why the process cannot go on.
    type Error: From<WaitError>;

    /// What the process calls its sources, its ports by the default; `()` when it never asks which of them has woken
    /// it.
    type Key: Copy + Default + PartialEq;

    /// Whether the process has publishers, subscribers and clients alone. It then sleeps on their doorbell, which wakes
    /// sooner than a descriptor does, and a signal ends the sleep by interrupting it, or [`LONGEST_SLEEP`] does.
    const IS_PORTS_ALONE: bool = false;

    /// Where the process stands in the flow of telemetry.
    const ROLE: SchedulingRole = SchedulingRole::Provider;

    /// Adds what the process waits for: every publisher, subscriber, server and client, and descriptors.
    fn sources<'a>(&'a mut self, sources: &mut Sources<'a, Self::Key>);

    /// Services every source that may have woken the process.
    ///
    /// # Errors
    /// The process cannot go on.
    fn drain(&mut self, wake: Wake<Self::Key>) -> Result<(), Self::Error>;

    /// What is due though nothing has woken the process for it.
    fn round(&mut self, _now: MonotonicNs) {}

    /// When the process must be woken at the latest.
    fn deadline(&self) -> Option<MonotonicNs> {
        None
    }

    /// Whether the process ends by itself, as if a signal had asked for it.
    fn is_done(&self, _now: MonotonicNs) -> bool {
        false
    }

    /// Whether the process may end, which was asked for: called at each wake from then on, until it may.
    fn may_end(&mut self, _now: MonotonicNs) -> bool {
        true
    }
}

/// What a process waits for.
pub struct Sources<'a, K = ()> {
    list: ArrayVec<SourceEntry<'a, K>, MAX_SOURCES>,
}

/// A source; the signals, which are not the process's own, have no key.
struct SourceEntry<'a, K> {
    key: Option<K>,
    source: AnySource<'a>,
}

enum AnySource<'a> {
    Port(&'a mut dyn Source),
    Descriptor(Descriptor<'a>),
}

impl<'a, K: Copy> Sources<'a, K> {
    /// Adds a port, whose key is the default one.
    ///
    /// # Panics
    /// When there are more than [`MAX_SOURCES`], which is a defect.
    pub fn port(&mut self, port: &'a mut dyn Source)
    where
        K: Default,
    {
        self.add(Some(K::default()), AnySource::Port(port));
    }

    /// Adds a file descriptor, which wakes the process when it can be read.
    ///
    /// # Panics
    /// When there are more than [`MAX_SOURCES`], which is a defect.
    pub fn descriptor(&mut self, key: K, descriptor: BorrowedFd<'a>) {
        let descriptor = Descriptor::new(descriptor);
        self.add(Some(key), AnySource::Descriptor(descriptor));
    }

    fn add(&mut self, key: Option<K>, source: AnySource<'a>) {
        self.list.push(SourceEntry { key, source });
    }

    fn wait(&mut self, waiter: &Waiter, timeout: Duration) -> Result<Wake<K>, WaitError> {
        let mut sources: ArrayVec<_, MAX_SOURCES> =
            self.list.iter_mut().map(SourceEntry::keyed).collect();
        let wake = waiter.wait(&mut sources, Some(timeout))?;
        Ok(wake.rename(|key| key))
    }
}

impl<K: Copy> SourceEntry<'_, K> {
    fn keyed(&mut self) -> (Option<K>, &mut dyn Source) {
        let source: &mut dyn Source = match &mut self.source {
            AnySource::Port(port) => *port,
            AnySource::Descriptor(descriptor) => descriptor,
        };
        (self.key, source)
    }
}

/// Runs the process until `termination` or the process itself wants the end and it may end.
///
/// # Errors
/// Those of [`Process::drain`], and when the operating system cannot wait any more.
pub fn run<P: Process>(
    process: &mut P,
    termination: &Termination,
    supervisor: &Notifier,
) -> Result<(), P::Error> {
    let waiter = Waiter::new();
    let period = supervisor
        .watchdog_period()
        .map_or(ROUND_PERIOD, |watchdog| watchdog.min(ROUND_PERIOD));
    let mut next_round = MonotonicNs::now() + period;
    request_slice(P::ROLE);
    supervisor.ready();
    // Nothing is known yet of what there is.
    let mut wake = Wake::TimedOut;
    loop {
        let now = MonotonicNs::now();
        if (termination.requested() || process.is_done(now)) && process.may_end(now) {
            break;
        }
        process.drain(wake)?;
        let now = MonotonicNs::now();
        if now >= next_round {
            supervisor.watchdog();
            next_round = now + period;
            process.round(now);
        }
        wake = sleep(process, &waiter, termination, supervisor, next_round)?;
    }
    supervisor.stopping();
    Ok(())
}

fn sleep<P: Process>(
    process: &mut P,
    waiter: &Waiter,
    termination: &Termination,
    supervisor: &Notifier,
    next_round: MonotonicNs,
) -> Result<Wake<P::Key>, WaitError> {
    let watchdog = supervisor.watchdog_period().map(|_| next_round);
    let deadline = [process.deadline(), watchdog]
        .into_iter()
        .flatten()
        .fold(MonotonicNs(u64::MAX), MonotonicNs::min);
    let timeout = deadline.since(MonotonicNs::now());
    let mut sources = Sources {
        list: ArrayVec::new(),
    };
    if !P::IS_PORTS_ALONE {
        let signals = Descriptor::new(termination.as_fd());
        sources.add(None, AnySource::Descriptor(signals));
    }
    process.sources(&mut sources);
    // A signal that comes just before a sleep on ports alone does not end it; then the longest sleep does.
    sources.wait(waiter, timeout.min(LONGEST_SLEEP))
}

/// What a process has before it opens its ports.
#[derive(Debug)]
pub struct SetUp<C> {
    /// The configuration.
    pub config: C,
    /// The file that it was read from; `None` if there was none.
    pub file: Option<PathBuf>,
    /// SIGINT and SIGTERM.
    pub termination: Termination,
    /// The supervisor, which is notified that the process is ready and works.
    pub supervisor: Notifier,
    /// Which shared memory.
    pub domain: Domain,
    /// Which robot.
    pub robot: RobotId,
}

impl<C: DeserializeOwned + Default + Debug> SetUp<C> {
    /// Begins logging, reads the configuration from the file that `args` name or else from `default_file`, which may be
    /// absent, and takes the signals. Nothing comes back when only the configuration was to be checked.
    ///
    /// # Errors
    /// Exit code 78 when the configuration or the environment is wrong, 1 when the signals have another owner.
    pub fn begin(args: &CommonArgs, default_file: &str) -> Result<Option<SetUp<C>>, Failure> {
        SetUp::begin_with(args, default_file, |_| Ok(()))
    }

    /// Begins a process whose command line replaces values of the configuration, or whose values must fit together:
    /// `check`
    /// does the one and looks at the other. What it refuses has file and line, at a start as well as when only the
    /// configuration is to be checked.
    ///
    /// # Errors
    /// Exit code 78 when the configuration or the environment is wrong, 1 when the signals have another owner.
    pub fn begin_with(
        args: &CommonArgs,
        default_file: &str,
        check: impl FnOnce(&mut C) -> Result<(), Fault>,
    ) -> Result<Option<SetUp<C>>, Failure> {
        logging::init(args.verbosity())?;
        let mut loaded =
            config::load::<C>(args.settings.config.as_deref(), Path::new(default_file))?;
        let file = match &loaded.file {
            Some(file) => file.display().to_string(),
            None => "built-in defaults".to_owned(),
        };
        check(&mut loaded.value).map_err(|fault| loaded.refuse(&fault))?;
        tracing::debug!(%file, config = ?loaded.value, "configuration");
        if args.settings.check_config {
            tracing::info!(%file, "the configuration is right");
            return Ok(None);
        }
        // Before anything that must be left in order.
        let termination = Termination::install().or_fail(ExitCode::Internal)?;
        Ok(Some(SetUp {
            config: loaded.value,
            file: loaded.file,
            termination,
            supervisor: Notifier::from_env(),
            domain: Domain::from_environment().or_fail(ExitCode::Configuration)?,
            robot: RobotId::from(args.robot()),
        }))
    }

    /// Joins the robot's shared memory as the process `name`.
    ///
    /// # Errors
    /// Exit code 1 when it cannot be used.
    pub fn join(&self, name: &str) -> Result<Ipc, Failure> {
        let what = || format!("{name} cannot join the shared memory");
        Ipc::join(&self.domain, self.robot, name).or_fail_with(ExitCode::Internal, what())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use std::io::{Read, Write};
    use std::os::unix::net::UnixStream;

    use runtime::signal::TerminationRequest;

    /// Requests its own end at the first deadline, and ends at the third wake after that.
    struct Example {
        request: TerminationRequest,
        due: Option<MonotonicNs>,
        asked: u32,
    }

    impl Process for Example {
        type Error = WaitError;
        type Key = ();

        fn sources<'a>(&'a mut self, _sources: &mut Sources<'a>) {}

        fn drain(&mut self, wake: Wake) -> Result<(), WaitError> {
            // What asks it to end wakes it.
            assert!(self.asked != 1 || wake.is_ready());
            if self.due.is_some_and(|due| MonotonicNs::now() >= due) {
                self.request.request();
                self.due = None;
            }
            Ok(())
        }

        fn deadline(&self) -> Option<MonotonicNs> {
            self.due
        }

        fn may_end(&mut self, _now: MonotonicNs) -> bool {
            self.asked += 1;
            self.asked == 3
        }
    }

    #[test]
    fn a_process_is_woken_for_its_deadline_and_ends_when_it_may() {
        let (termination, request) = Termination::by_hand().unwrap();
        let mut example = Example {
            request,
            due: Some(MonotonicNs::now() + Duration::from_millis(5)),
            asked: 0,
        };
        run(&mut example, &termination, &Notifier::from_env()).unwrap();
        // Only what woke it for the deadline has asked it to end.
        assert_eq!((example.due, example.asked), (None, 3));
    }

    #[test]
    fn a_port_wakes_by_the_default_key() {
        let (mut other, socket) = UnixStream::pair().unwrap();
        other.write_all(&[1]).unwrap();
        let mut port = Descriptor::new(socket.as_fd());
        let list = ArrayVec::new();
        let mut sources = Sources::<u8> { list };
        sources.port(&mut port);
        let watchdog = Duration::from_secs(60);
        assert!(sources.wait(&Waiter::new(), watchdog).unwrap().has(0));
    }

    /// Is woken each 20 ms and by a socket, and is done with its second round. It says nothing of when it may end.
    struct RoundCounter {
        socket: UnixStream,
        heard: u32,
        begun: MonotonicNs,
        rounds: Vec<Duration>,
        wakes: u32,
    }

    impl Process for RoundCounter {
        type Error = WaitError;
        type Key = u8;

        fn sources<'a>(&'a mut self, sources: &mut Sources<'a, u8>) {
            sources.descriptor(7, self.socket.as_fd());
        }

        fn drain(&mut self, wake: Wake<u8>) -> Result<(), WaitError> {
            self.wakes += 1;
            if wake.has(7) {
                self.socket.read_exact(&mut [0]).unwrap();
                self.heard += 1;
            }
            Ok(())
        }

        fn round(&mut self, now: MonotonicNs) {
            self.rounds.push(now.since(self.begun));
        }

        fn deadline(&self) -> Option<MonotonicNs> {
            Some(MonotonicNs::now() + Duration::from_millis(20))
        }

        fn is_done(&self, _now: MonotonicNs) -> bool {
            self.rounds.len() == 2
        }
    }

    #[test]
    fn a_process_has_a_round_in_each_period_and_may_end_by_itself() {
        let (termination, _request) = Termination::by_hand().unwrap();
        let (mut other, socket) = UnixStream::pair().unwrap();
        other.write_all(&[1]).unwrap();
        let mut process = RoundCounter {
            socket,
            heard: 0,
            begun: MonotonicNs::now(),
            rounds: Vec::new(),
            wakes: 0,
        };
        run(&mut process, &termination, &Notifier::from_env()).unwrap();
        let [first, second] = process.rounds[..] else {
            panic!("{:?}", process.rounds)
        };
        assert!(first >= ROUND_PERIOD && second >= first + ROUND_PERIOD);
        assert!(process.wakes >= 2, "no process is woken for a round");
        assert_eq!(process.heard, 1);
    }
}
