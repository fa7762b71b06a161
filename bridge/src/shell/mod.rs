//! The thin shell around the core: it moves bytes, samples, requests and deadlines, and decides nothing.
//!
//! One thread, one wait. A wake drains what it is about: the line alone, or the line to its end, the three request
//! services and the core's deadlines. The bound of each wait drains everything: the safety net for a wake-up that the
//! shared-memory library can lose.
//!
//! What may take long is done by a thread: `port` opens and closes the port, `reload` reads the geofence again,
//! `senders` looks who sends.
//!
//! This file has the loop; [`serial`] the port itself; `publish` the core's outputs on shared memory, and what it
//! holds; `controller` whose end matters; `pace` how long the line is left alone; `audit` what the log has.

mod audit;
mod controller;
mod pace;
mod port;
mod publish;
mod reload;
mod senders;
pub mod serial;

use std::num::NonZeroU64;
use std::os::fd::AsFd;
use std::time::Duration;

use ipc_types::code::{ControlCommand, LinkState};
use ipc_types::configuration::{ConfigurationText, OfBridge};
use ipc_types::payload::BridgeJournal;
use ipc_types::{Ipc, MonotonicNs, OpenError, WaitError, Wake};
use module_kit::configuration::ConfigurationPort;
use module_kit::journal::JournalPort;
use module_kit::process::{self, Process, Sources};
use runtime::helper::HelperGone;
use runtime::notify::Notifier;
use runtime::realtime::{self, latency::ProcessorLatency};
use runtime::signal::Termination;
use rustix::thread::set_current_timer_slack;

use crate::config::BridgeConfig;
use crate::core::Input;
use crate::journal::Journaled;
use crate::link::commands::ATTEMPTS;
use controller::Watched;
use pace::Pace;
pub use port::PortError;
use port::PortSlot;
use publish::{BridgeServices, OutlinePort};
use reload::FenceReader;
pub use reload::{FenceOfFile, ReadFence};
use senders::Senders;
use serial::{Backlog, SHORT_READ};

/// Bytes of one read. At 115200 baud a third of a second; at most 32 full status frames.
const READ_LEN: usize = 4096;

/// Bytes that are taken from the line before requests and deadlines have their turn: 5.7 s at 115200 baud. A terminal
/// keeps fewer for a bridge that stands still.
const DRAIN_LEN: usize = 16 * READ_LEN;

/// What wakes the bridge, besides signals and deadlines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Waker {
    /// A service.
    #[default]
    Service,
    /// The serial port.
    Line,
    /// The end of the process with which control ends, or of the path's sender.
    Process,
    /// A thread, which has done what may take long.
    Thread,
}

/// After this many headers of the other profile without a valid message we report a profile mismatch.
const OTHER_PROFILE_HEADERS: u32 = 3;

/// How long the bridge goes on after it was asked to end, so that the DSP acknowledges that its path buffer is empty:
/// as long as the attempts for that take, and those of a command that is on its way.
fn wind_down_time(config: &BridgeConfig) -> Duration {
    2 * ATTEMPTS * config.link.ack_timeout()
}

/// How late the kernel may end a sleep of the loop, so that it can end others with it.
const TIMER_SLACK_NS: u64 = 1_000;

/// A shorter suspension is none: two clocks are read one after the other, and the process may have to wait between.
const SHORTEST_SUSPENSION: Duration = Duration::from_millis(100);

/// Why the bridge process cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum ShellError {
    /// The services cannot be opened; another bridge of this robot may run.
    #[error(transparent)]
    Services(#[from] OpenError),
    /// Waiting failed.
    #[error(transparent)]
    Wait(#[from] WaitError),
    /// See [`PortError`].
    #[error(transparent)]
    Port(#[from] PortError),
    /// The system grants no thread for what may take long.
    #[error("the bridge has no thread for its port, its geofence, or who sends")]
    NoThread(#[source] std::io::Error),
    /// Another thread has failed.
    #[error(transparent)]
    ThreadGone(#[from] HelperGone),
}

/// Runs the bridge until `termination` asks it to end. A port that is missing, or goes, is opened again for ever.
///
/// # Errors
/// See [`ShellError`].
pub fn run(
    config: &BridgeConfig,
    configuration: ConfigurationText,
    read_fence: impl Fn() -> ReadFence + Send + 'static,
    ipc: &Ipc,
    termination: &Termination,
    supervisor: &Notifier,
) -> Result<(), ShellError> {
    let members = ipc.members();
    let mut shell = Shell {
        bridge: Journaled::new(config, JournalPort::<BridgeJournal>::writer()),
        services: BridgeServices::open(ipc)?,
        outline: OutlinePort::open(ipc)?,
        configuration: ConfigurationPort::open(ipc, configuration)?,
        journal: JournalPort::open(ipc)?,
        ipc: ipc.clone(),
        watched: Default::default(),
        suspended: MonotonicNs::suspended(),
        port: PortSlot::start(&config.serial).map_err(ShellError::NoThread)?,
        pace: Pace::new(&config.serial),
        fence: FenceReader::start(read_fence).map_err(ShellError::NoThread)?,
        senders: Senders::start(move |process| members.shares_clock_with(process))
            .map_err(ShellError::NoThread)?,
        latency: ProcessorLatency::start(config.realtime.low_latency_processor),
        inbox: Vec::new(),
        buffer: vec![0; DRAIN_LEN],
        other_profile: false,
        wind_down_time: wind_down_time(config),
        end: None,
    };
    if shell.port.begin()? {
        shell.port_opened(MonotonicNs::now());
    }
    // Else the kernel ends each sleep up to 50 µs late, that for the rest of a message too.
    let _ = set_current_timer_slack(NonZeroU64::new(TIMER_SLACK_NS));
    realtime::begin(&config.realtime);
    tracing::info!(port = %config.serial.port.display(), "ready");
    process::run(&mut shell, termination, supervisor)?;
    shell.end();
    Ok(())
}

struct Shell {
    bridge: Journaled,
    services: BridgeServices,
    outline: OutlinePort,
    configuration: ConfigurationPort<OfBridge>,
    journal: JournalPort<BridgeJournal>,
    ipc: Ipc,
    /// The process with whose end control ends, and that of the path's sender.
    watched: [Watched; 2],
    /// How long the machine was suspended since its boot, as the bridge knows it.
    suspended: Duration,
    port: PortSlot,
    pace: Pace,
    fence: FenceReader,
    senders: Senders,
    latency: ProcessorLatency,
    inbox: Vec<Input<'static>>,
    buffer: Vec<u8>,
    /// It was logged that the ends speak different profiles.
    other_profile: bool,
    wind_down_time: Duration,
    /// When the bridge ends at the latest, once it was asked to.
    end: Option<MonotonicNs>,
}

impl Process for Shell {
    type Error = ShellError;
    type Key = Waker;

    fn sources<'a>(&'a mut self, sources: &mut Sources<'a, Waker>) {
        for service in self.services.sources() {
            sources.port(service);
        }
        sources.port(self.outline.source());
        sources.port(self.configuration.source());
        sources.port(self.journal.source());
        sources.descriptor(Waker::Thread, self.port.thread());
        sources.descriptor(Waker::Thread, self.fence.thread());
        sources.descriptor(Waker::Thread, self.senders.thread());
        if let Some(line) = self.port.get()
            && self.pace.due().is_none()
        {
            sources.descriptor(Waker::Line, line.as_fd());
        }
        for process in self.watched.iter().filter_map(Watched::descriptor) {
            sources.descriptor(Waker::Process, process);
        }
    }

    /// Services every source that may have woken the bridge, always in this order: requests are taken, the line is read
    /// and applied, then the requests, deadlines, and what goes out. So after a stall a request is judged by what the
    /// DSP has said meanwhile, and an acknowledgement that is there is found before its deadline is. A wake that was
    /// for the serial link alone leaves the services out: the next wait looks at all of them again before it sleeps.
    fn drain(&mut self, wake: Wake<Waker>) -> Result<(), ShellError> {
        self.journal.follow(self.bridge.writer());
        let is_done = wake.has(Waker::Thread);
        let now = MonotonicNs::now();
        while let Some(request) = self.senders.next(now, is_done)? {
            self.inbox.push(request);
        }
        let is_of_line = wake.is_only(Waker::Line)
            || wake == Wake::TimedOut && self.pace.due().is_some_and(|due| due <= now);
        let serves = !is_of_line;
        if serves {
            self.services.drain(&mut self.senders, &mut self.inbox);
        }
        self.resume();
        self.read(serves || !self.inbox.is_empty());
        self.serve();
        if wake.has(Waker::Process) {
            let ended = self.watched.each_ref().map(Watched::ended);
            self.processes_ended(ended);
        }
        let now = MonotonicNs::now();
        self.look_at_lease(now);
        self.bridge.apply(now, Input::Advance, &mut self.services);
        self.services.end_batch();
        while let Some((reload, read)) = self.fence.next(now, is_done)? {
            self.bridge.apply(now, reload, &mut self.services);
            // The core may have refused it.
            if let Some(read) = read.filter(|read| read.fence == *self.bridge.fence()) {
                self.configuration.replace(read.configuration);
            }
        }
        if self.port.step(now, is_done)? {
            self.port_opened(now);
        }
        self.write();
        self.watch();
        self.services.wake_senders();
        self.services.write_log();
        let now = MonotonicNs::now();
        self.outline.publish(&self.bridge.outline(), now);
        self.configuration.publish(now);
        self.journal.publish(self.bridge.writer(), now);
        self.log_other_profile();
        self.latency.follow(self.services.is_flying());
        Ok(())
    }

    /// For what causes no wake-up: a sender that has room again for its final report. Requests may be there too, after
    /// the line.
    fn round(&mut self, _now: MonotonicNs) {
        self.services.drain(&mut self.senders, &mut self.inbox);
        if !self.inbox.is_empty() {
            self.resume();
            self.read(true);
            self.serve();
            self.write();
            self.services.wake_senders();
            self.services.write_log();
        }
    }

    fn deadline(&self) -> Option<MonotonicNs> {
        let journal = self.journal.deadline(self.bridge.journal());
        [
            self.end,
            self.port.next_try(),
            self.pace.due(),
            self.fence.deadline(),
            self.senders.deadline(),
            self.outline.deadline(),
            self.configuration.deadline(),
            journal,
        ]
        .into_iter()
        .flatten()
        .chain([self.bridge.deadline()])
        .min()
    }

    /// Some time after it was asked to be, when the DSP holds nothing, or cannot be made to hold nothing.
    fn may_end(&mut self, now: MonotonicNs) -> bool {
        let end = *self.end.get_or_insert_with(|| {
            self.bridge.apply(now, Input::WindDown, &mut self.services);
            now + self.wind_down_time
        });
        self.bridge.has_wound_down() || now >= end
    }
}

impl Shell {
    /// Applies the requests that were taken before the line was read. So wherever the bridge stood still, the DSP's
    /// last words before a request was taken are applied before it.
    fn serve(&mut self) {
        let now = MonotonicNs::now();
        for mut input in self.inbox.drain(..) {
            if let Input::Control {
                key,
                sender,
                request,
            } = input
                && request.command() == Some(ControlCommand::ReloadFence)
            {
                match self.fence.ask(key, sender, request, now) {
                    Some(refusal) => input = refusal,
                    None => continue,
                }
            }
            self.bridge.apply(now, input, &mut self.services);
        }
    }

    fn processes_ended(&mut self, processes: [Option<u32>; 2]) {
        let now = MonotonicNs::now();
        for process in processes.into_iter().flatten() {
            let ended = Input::ProcessEnded(process);
            self.bridge.apply(now, ended, &mut self.services);
        }
    }

    /// Watches the processes that matter from now on. A path of which the sender has ended already ends at once, and
    /// what that makes goes out.
    fn watch(&mut self) {
        let processes = [self.bridge.controller(), self.bridge.path_sender()];
        let [controller, sender] = &mut self.watched;
        let ended = [controller.follow(processes[0]), sender.follow(processes[1])];
        if ended.iter().any(Option::is_some) {
            self.processes_ended(ended);
            self.write();
        }
    }

    /// What the machine's suspension was, which the monotonic clock does not show, is an input before all others.
    fn resume(&mut self) {
        let suspended = MonotonicNs::suspended();
        let slept = suspended.saturating_sub(self.suspended);
        if slept < SHORTEST_SUSPENSION {
            return;
        }
        self.suspended = suspended;
        self.services.write_log();
        tracing::warn!(seconds = slept.as_secs_f64(), "the machine was suspended");
        let input = Input::Suspended(slept.as_nanos() as u64);
        let now = MonotonicNs::now();
        self.bridge.apply(now, input, &mut self.services);
    }

    /// Before the end of a lease is handled: its sender may have renewed it, and a renewal wakes no process.
    fn look_at_lease(&mut self, now: MonotonicNs) {
        if let Some((path_id, until)) = self.bridge.lease()
            && until <= now
            && let Some(at) = self.ipc.lease_renewed(path_id)
        {
            let renewed = Input::LeaseRenewed(at);
            self.bridge.apply(now, renewed, &mut self.services);
        }
    }

    /// Takes what the line has as one input. All of it, up to [`DRAIN_LEN`], when a request or a deadline may wait;
    /// else one read, and what is left is there at the next wake, which comes at once: so consumers have their turn on
    /// a line that never pauses. They keep more samples than one read can bring. For a backlog it takes some 100 ms at
    /// most.
    fn read(&mut self, serves: bool) {
        let Some(port) = self.port.get() else {
            return;
        };
        let (mut len, mut backlog) = (0, Backlog::default());
        let (gone, is_empty) = loop {
            match port.read(&mut self.buffer[len..][..READ_LEN]) {
                Ok(count) => {
                    len += count;
                    let waits = || serves || self.bridge.deadline() <= MonotonicNs::now();
                    let full = len + READ_LEN > DRAIN_LEN;
                    if full || !waits() || backlog.is_over(port, count, len) {
                        break (None, count < SHORT_READ);
                    }
                }
                Err(gone) => break (Some(gone), false),
            }
        };
        let now = MonotonicNs::now();
        if len > 0 {
            let bytes = Input::Received(&self.buffer[..len]);
            self.bridge.apply(now, bytes, &mut self.services);
            self.services.end_batch();
        }
        self.pace.read(now, len, self.bridge.missing(), is_empty);
        if let Some(gone) = gone {
            self.close_port(&gone);
        }
    }

    /// What the device does not take now is offered again at the next wake: the core bounds it and gives it up in time.
    fn write(&mut self) {
        self.resume();
        let now = MonotonicNs::now();
        let Some(port) = self.port.get() else {
            return;
        };
        if self.bridge.take_discard_unsent(now) {
            port.discard_unsent();
        }
        let bytes = self.bridge.transmit(now);
        if bytes.is_empty() {
            return;
        }
        match port.write(bytes) {
            Ok(count) => {
                let taken = Input::Transmitted(count);
                self.bridge.apply(now, taken, &mut self.services);
            }
            Err(gone) => self.close_port(&gone),
        }
    }

    fn port_opened(&mut self, now: MonotonicNs) {
        self.pace.forget();
        let line = self.port.line();
        self.bridge
            .apply(now, Input::PortOpened(line), &mut self.services);
    }

    fn close_port(&mut self, gone: &serial::Gone) {
        self.services.write_log();
        self.port.close(gone);
        self.pace.forget();
        let now = MonotonicNs::now();
        self.bridge
            .apply(now, Input::PortClosed, &mut self.services);
    }

    /// One damaged byte may look like a header of the other profile; several, and no valid message, are a profile
    /// mismatch.
    fn log_other_profile(&mut self) {
        let state = self.bridge.state();
        let is_other = state.refused.other_profile >= OTHER_PROFILE_HEADERS
            && state.link.messages_received == 0
            && self.bridge.link() == LinkState::Connecting;
        if is_other && !self.other_profile {
            tracing::error!(
                "the DSP speaks the other profile: give `link.profile` here and the DSP's setting one value"
            );
        }
        self.other_profile |= is_other;
    }

    /// Every sender gets its final report before the services go; the port is given back as it was.
    fn end(mut self) {
        let now = MonotonicNs::now();
        for request in self.senders.give_up() {
            self.bridge.apply(now, request, &mut self.services);
        }
        for reload in self.fence.give_up() {
            self.bridge.apply(now, reload, &mut self.services);
        }
        self.bridge.apply(now, Input::Close, &mut self.services);
        self.services.wake_senders();
        self.services.finish_log();
        let link = self.bridge.state().link;
        tracing::info!(
            telemetry = link.telemetry_published,
            messages = link.messages_received,
            waypoints = link.waypoints_sent,
            "ended"
        );
        self.journal.finish(self.bridge.writer(), now);
        self.port.finish();
    }
}
