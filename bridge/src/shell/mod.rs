//! The thin shell around the core: it moves bytes, samples, requests and deadlines, and decides nothing.
//!
//! One thread, one wait. A wake drains what it is about: the line alone, or the line to its end, the three request services and the
//! core's deadlines. The bound of each wait drains everything: the safety net for a wake-up that the shared-memory library can lose.
//!
//! This file has the loop; [`serial`] the port; `publish` the core's outputs on shared memory, and what it holds; `controller` who
//! sends; `audit` what the log has.

mod audit;
mod controller;
mod publish;
pub mod serial;

use std::os::fd::AsFd;
use std::time::Duration;

use ipc_types::code::{ControlCommand, LinkState, Reason};
use ipc_types::payload::BridgeJournal;
use ipc_types::{Ipc, MonotonicNs, OpenError, WaitError, Wake};
use module_kit::journal::JournalPort;
use module_kit::process::{self, Process, Sources};
use runtime::notify::Notifier;
use runtime::signal::Termination;

use crate::config::{BridgeConfig, SerialConfig};
use crate::core::Input;
use crate::journal::Journaled;
use crate::link::commands::ATTEMPTS;
use crate::safety::fence::Fence;
use controller::Watched;
use publish::{BridgeServices, OutlinePort};
use serial::SerialPort;

/// Bytes of one read. At 115200 baud a third of a second; at most 32 full status frames.
const READ_LEN: usize = 4096;

/// A read that brings fewer bytes has emptied the line, unless there was a backlog: of that a terminal's queue holds 4095 bytes, and a
/// worker of the kernel, which may be late, brings the rest.
const SHORT_READ: usize = 2048;

/// Bytes that are taken from the line before requests and deadlines have their turn: 5.7 s at 115200 baud. A terminal keeps
/// fewer for a bridge that stands still.
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
}

/// After this many headers of the other profile without a valid message we report a profile mismatch.
const OTHER_PROFILE_HEADERS: u32 = 3;

/// How long the bridge goes on after it was asked to end, so that the DSP acknowledges that its path buffer is empty: as
/// long as the attempts for that take, and those of a command that is on its way.
fn wind_down_time(config: &BridgeConfig) -> Duration {
    2 * ATTEMPTS * config.link.ack_timeout()
}

/// A shorter suspension is none: two clocks are read one after the other, and the process may have to wait between.
const SHORTEST_SUSPENSION: Duration = Duration::from_millis(100);

/// How long a pseudo-terminal that has just appeared is left alone. A program that makes one for a login, such as sshd, takes
/// a few milliseconds until it is the login's controlling terminal. Before that, it looks as one of a simulator does.
const PTY_SETTLING: Duration = Duration::from_millis(50);

/// An attempt to open the port looks at all processes, unless there is no device: 2 ms for 90 processes and 100 ms for 1600
/// in a debug build. The pause after an attempt is at least this many times as long as the attempt. So attempts take 5 % of
/// the time at most.
const REST_AFTER_ATTEMPT: u32 = 20;

/// Why the bridge process cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum ShellError {
    /// The services cannot be opened; another bridge of this robot may run.
    #[error(transparent)]
    Services(#[from] OpenError),
    /// Waiting failed.
    #[error(transparent)]
    Wait(#[from] WaitError),
    /// The port is something that can never be one.
    #[error(transparent)]
    NotAPort(serial::OpenError),
}

/// Runs the bridge until `termination` asks it to end. A port that is missing, or goes, is opened again for ever.
///
/// # Errors
/// See [`ShellError`].
pub fn run(
    config: &BridgeConfig,
    read_fence: &dyn Fn() -> Result<Fence, String>,
    ipc: &Ipc,
    termination: &Termination,
    supervisor: &Notifier,
) -> Result<(), ShellError> {
    let mut shell = Shell {
        bridge: Journaled::new(config, JournalPort::<BridgeJournal>::writer()),
        services: BridgeServices::open(ipc)?,
        outline: OutlinePort::open(ipc)?,
        journal: JournalPort::open(ipc)?,
        ipc: ipc.clone(),
        watched: Default::default(),
        suspended: MonotonicNs::suspended(),
        port: PortSlot::new(&config.serial),
        inbox: Vec::new(),
        buffer: vec![0; DRAIN_LEN],
        read_fence,
        other_profile: false,
        wind_down_time: wind_down_time(config),
        end: None,
    };
    shell.open_port(MonotonicNs::now())?;
    tracing::info!(port = %config.serial.port.display(), "ready");
    process::run(&mut shell, termination, supervisor)?;
    shell.end();
    Ok(())
}

struct Shell<'a> {
    bridge: Journaled,
    services: BridgeServices,
    outline: OutlinePort,
    journal: JournalPort<BridgeJournal>,
    ipc: Ipc,
    /// The process with whose end control ends, and that of the path's sender.
    watched: [Watched; 2],
    /// How long the machine was suspended since its boot, as the bridge knows it.
    suspended: Duration,
    port: PortSlot,
    inbox: Vec<Input<'static>>,
    buffer: Vec<u8>,
    /// Reads the geofence of the configuration again.
    read_fence: &'a dyn Fn() -> Result<Fence, String>,
    /// It was logged that the ends speak different profiles.
    other_profile: bool,
    wind_down_time: Duration,
    /// When the bridge ends at the latest, once it was asked to.
    end: Option<MonotonicNs>,
}

impl Process for Shell<'_> {
    type Error = ShellError;
    type Key = Waker;

    fn sources<'a>(&'a mut self, sources: &mut Sources<'a, Waker>) {
        for service in self.services.sources() {
            sources.port(service);
        }
        sources.port(self.outline.source());
        sources.port(self.journal.source());
        if let Some(line) = &self.port.open {
            sources.descriptor(Waker::Line, line.as_fd());
        }
        for process in self.watched.iter().filter_map(Watched::descriptor) {
            sources.descriptor(Waker::Process, process);
        }
    }

    /// Services every source that may have woken the bridge, always in this order: requests are taken, the line is read and applied,
    /// then the requests, deadlines, and what goes out. So after a stall a request is judged by what the DSP has said meanwhile,
    /// and an acknowledgement that is there is found before its deadline is. A wake that was for the serial link alone leaves the
    /// services out: the next wait looks at all of them again before it sleeps.
    fn drain(&mut self, wake: Wake<Waker>) -> Result<(), ShellError> {
        self.journal.follow(self.bridge.writer());
        let serves = !wake.is_only(Waker::Line);
        if serves {
            self.services.drain(&mut self.inbox);
        }
        self.resume();
        self.read(serves);
        self.serve();
        if wake.has(Waker::Process) {
            let ended = self.watched.each_ref().map(Watched::ended);
            self.processes_ended(ended);
        }
        let now = MonotonicNs::now();
        self.look_at_lease(now);
        self.bridge.apply(now, Input::Advance, &mut self.services);
        self.services.end_batch();
        self.open_port(now)?;
        self.write();
        self.watch();
        self.services.wake_senders();
        let now = MonotonicNs::now();
        self.outline.publish(&self.bridge.outline(), now);
        self.journal.publish(self.bridge.writer(), now);
        self.log_other_profile();
        Ok(())
    }

    /// For what causes no wake-up: a sender that has room again for its final report. Requests may be there too, after the line.
    fn round(&mut self, _now: MonotonicNs) {
        self.services.drain(&mut self.inbox);
        if !self.inbox.is_empty() {
            self.resume();
            self.read(true);
            self.serve();
        }
    }

    fn deadline(&self) -> Option<MonotonicNs> {
        let journal = self.journal.deadline(self.bridge.journal());
        [
            self.end,
            self.port.next_try,
            self.outline.deadline(),
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

impl Shell<'_> {
    /// Applies the requests that were taken before the line was read. So wherever the bridge stood still, the DSP's last words before
    /// a request was taken are applied before it.
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
                let fence = (self.read_fence)().map_err(|error| {
                    tracing::error!("the geofence stays as it is: {error}");
                    Reason::InvalidFence
                });
                input = Input::NewFence {
                    key,
                    sender,
                    request,
                    fence,
                };
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

    /// Watches the processes that matter from now on. A path of which the sender has ended already ends at once, and what that makes
    /// goes out.
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
        tracing::warn!(seconds = slept.as_secs_f64(), "the machine was suspended");
        let input = Input::Suspended(slept.as_nanos() as u64);
        let now = MonotonicNs::now();
        self.bridge.apply(now, input, &mut self.services);
    }

    /// Before the end of a lease is handled: its sender may have renewed it, which wakes nobody.
    fn look_at_lease(&mut self, now: MonotonicNs) {
        if let Some((path_id, until)) = self.bridge.lease()
            && until <= now
            && let Some(at) = self.ipc.lease_renewed(path_id)
        {
            let renewed = Input::LeaseRenewed(at);
            self.bridge.apply(now, renewed, &mut self.services);
        }
    }

    /// Takes what the line has as one input. All of it, up to [`DRAIN_LEN`], when a request or a deadline may wait; else one read,
    /// and what is left is there at the next wake, which comes at once: so consumers have their turn on a line that never
    /// pauses. They keep more samples than one read can bring.
    fn read(&mut self, serves: bool) {
        let Some(port) = self.port.open.as_ref() else {
            return;
        };
        let mut len = 0;
        let gone = loop {
            match port.read(&mut self.buffer[len..][..READ_LEN]) {
                Ok(count) => {
                    len += count;
                    let waits = || serves || self.bridge.deadline() <= MonotonicNs::now();
                    let is_empty =
                        || count < SHORT_READ && !(len >= SHORT_READ && port.brings_more());
                    if !waits() || len + READ_LEN > DRAIN_LEN || is_empty() {
                        break None;
                    }
                }
                Err(gone) => break Some(gone),
            }
        };
        let now = MonotonicNs::now();
        if len > 0 {
            let bytes = Input::Received(&self.buffer[..len]);
            self.bridge.apply(now, bytes, &mut self.services);
            self.services.end_batch();
        }
        if let Some(gone) = gone {
            self.close_port(&gone);
        }
    }

    /// What the device does not take now is offered again at the next wake: the core bounds it and gives it up in time.
    fn write(&mut self) {
        self.resume();
        let now = MonotonicNs::now();
        let Some(port) = self.port.open.as_ref() else {
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

    fn open_port(&mut self, now: MonotonicNs) -> Result<(), ShellError> {
        if self.port.try_open(now)? {
            self.bridge
                .apply(now, Input::PortOpened, &mut self.services);
        }
        Ok(())
    }

    fn close_port(&mut self, gone: &serial::Gone) {
        tracing::warn!(port = %self.port.config.port.display(), "{gone}; opening it again");
        self.port.close();
        let now = MonotonicNs::now();
        self.bridge
            .apply(now, Input::PortClosed, &mut self.services);
    }

    /// One damaged byte may look like a header of the other profile; several, and no valid message, are a profile mismatch.
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
        self.bridge.apply(now, Input::Close, &mut self.services);
        self.services.wake_senders();
        let link = self.bridge.state().link;
        tracing::info!(
            telemetry = link.telemetry_published,
            messages = link.messages_received,
            waypoints = link.waypoints_sent,
            "ended"
        );
        self.journal.finish(self.bridge.writer(), now);
    }
}

/// The port, or when to try again.
struct PortSlot {
    config: SerialConfig,
    open: Option<SerialPort>,
    next_try: Option<MonotonicNs>,
    failures: u32,
    /// The last failure that was logged.
    reported: String,
    ever_open: bool,
    /// Whether there was no device at the last attempt.
    was_missing: bool,
}

impl PortSlot {
    fn new(config: &SerialConfig) -> Self {
        PortSlot {
            config: config.clone(),
            open: None,
            next_try: Some(MonotonicNs(0)),
            failures: 0,
            reported: String::new(),
            ever_open: false,
            was_missing: false,
        }
    }

    /// Opens the port if it is time to. A failure is logged when it differs from the one before; repetitions are counted.
    fn try_open(&mut self, now: MonotonicNs) -> Result<bool, ShellError> {
        if self.next_try.is_none_or(|next_try| now < next_try) {
            return Ok(false);
        }
        if self.was_missing && SerialPort::is_pty(&self.config) {
            self.was_missing = false;
            self.next_try = Some(now + PTY_SETTLING);
            return Ok(false);
        }
        match SerialPort::open(&self.config) {
            Ok(port) => {
                tracing::info!(port = %self.config.port.display(), tries = self.failures + 1, "port open");
                self.open = Some(port);
                self.next_try = None;
                self.failures = 0;
                self.reported.clear();
                self.ever_open = true;
                Ok(true)
            }
            Err(error @ serial::OpenError::NotATerminal(_)) if !self.ever_open => {
                Err(ShellError::NotAPort(error))
            }
            Err(error) => {
                self.failed(now, &error);
                Ok(false)
            }
        }
    }

    fn failed(&mut self, now: MonotonicNs, error: &serial::OpenError) {
        self.failures = self.failures.saturating_add(1);
        let text = error.to_string();
        if self.reported == text {
            tracing::debug!(tries = self.failures, "still not open");
        } else {
            tracing::error!("{text}; trying again");
            self.reported = text;
        }
        self.was_missing = matches!(error, serial::OpenError::Missing(_));
        let ended = MonotonicNs::now();
        let pause = self.config.reopen_pause(self.failures);
        self.next_try = Some(ended + pause.max(REST_AFTER_ATTEMPT * ended.since(now)));
    }

    fn close(&mut self) {
        self.open = None;
        self.next_try = Some(MonotonicNs(0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use std::os::unix::fs::symlink;

    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

    #[test]
    fn a_pseudo_terminal_that_appears_is_left_alone_until_a_login_would_have_taken_it() {
        let link = std::env::temp_dir().join(format!("ril-port-{}", std::process::id()));
        let mut port = PortSlot::new(&SerialConfig {
            port: link.clone(),
            ..SerialConfig::default()
        });
        let now = MonotonicNs::now();
        assert!(!port.try_open(now).unwrap(), "there is none");
        let now = port.next_try.unwrap();

        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC);
        let master = master.unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        let slave = ptsname(&master, Vec::new()).unwrap();
        symlink(slave.to_str().unwrap(), &link).unwrap();
        assert!(!port.try_open(now).unwrap(), "it has just appeared");
        assert_eq!(port.next_try, Some(now + PTY_SETTLING));
        assert!(port.try_open(now + PTY_SETTLING).unwrap());
        std::fs::remove_file(link).unwrap();
    }
}
