//! The link to the DSP: bytes in both directions, commands, start-up, liveness, time coherence, and what the DSP's path
//! buffer may hold, in one value.
//!
//! It is given port events, bytes and the time, and answers with [`LinkEvent`]s through [`Link::poll_event`]. It never
//! decides anything about a flight and never touches a port.
//!
//! | state | enters | leaves |
//! |---|---|---|
//! | gone | the port closed | the port opened → connecting |
//! | connecting | port opened, DSP rebooted, probe failed | start-up acknowledged → up (event `Ready`) |
//! | up | start-up acknowledged, message while silent | no message for a time → silent; reboot → connecting |
//! | silent | no valid message for the configured time | any message → up; probe failed → connecting (`Lost`) |
//!
//! Only a DSP that was started up has a session, and only a session knows what the path buffer holds: in the other
//! states nothing can be known. In silence the DSP is probed by reading its status mask, which disturbs nothing. A mask
//! that is not ours, or a DSP that answers probes but sends nothing else, has rebooted.

pub mod cadence;
pub mod coherence;
pub mod commands;
pub mod event;
mod invariants;
pub mod last_minute;
pub mod line;
mod liveness;
pub mod outgoing;
mod receive;
pub mod session;

use std::collections::VecDeque;

use dsp_protocol::{Command, Decoder, Downlink, Sequence, Uplink, Waypoint};
use ipc_types::MonotonicNs;
use ipc_types::code::{DspPathState, LinkState};
use ipc_types::payload::{LinkHealth, RefusedCounters};
use module_kit::journal::raw;
use serde::{Deserialize, Serialize};

use crate::config::{BridgeConfig, ParametersConfig, parameters};
use crate::timers::{TimerTable, timers};
use cadence::{Cadence, Grants};
use coherence::Coherence;
use commands::{ALWAYS, CommandQueue, QueueFull, Sending, Timeout};
pub use event::{FlightCommand, LinkEvent, Purpose, StatusSample};
use line::Line;
use outgoing::OutgoingBytes;
use session::{DspPath, DspSession, StartUp};

/// Events that one message or deadline can cause at most: an odd status, a reboot, two samples, the end of the start-up
/// and of its last parameter.
const EVENTS: usize = 6;

timers! {
    /// What the link waits for.
    enum LinkTimer {
        /// The acknowledgement of the outstanding command.
        Command,
        /// A valid message.
        Silence,
        /// A status in our mask.
        Status,
        /// The next sign of life for the DSP.
        KeepAlive,
        /// The end of the time in which late acknowledgements make an empty path buffer uncertain.
        EmptyPath,
    }
}

/// Where the link is. A state owns what is known in it.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum State {
    /// There is no port.
    Gone,
    /// The port is open; the start-up is under way.
    Connecting(StartUp),
    /// The DSP takes commands.
    Up(DspSession),
    /// No message for a time; the DSP is being probed.
    Silent(DspSession),
}

/// A command of the flight was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotQueued {
    /// Too many commands wait.
    #[error(transparent)]
    Full(#[from] QueueFull),
    /// The DSP has not been started up.
    #[error("the DSP has not been started up")]
    NotStartedUp,
}

/// The state of the link to the DSP: bytes and the time in, bytes and [`LinkEvent`]s out.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Link {
    #[serde(skip)]
    config: BridgeConfig,
    /// Written at each start-up: those of the configuration, and those set at run time.
    #[serde(with = "parameters::as_commands")]
    parameters: ParametersConfig,
    decoder: Decoder<Downlink>,
    line: Line,
    /// When bytes were read last, or the port was opened.
    read: MonotonicNs,
    coherence: Coherence<StatusSample>,
    commands: CommandQueue<Purpose>,
    outgoing: OutgoingBytes,
    /// Number of the last waypoint that was sent.
    waypoint_number: Sequence,
    /// Number of the last message that was received.
    last_received: Option<Sequence>,
    messages: Cadence,
    statuses: Cadence,
    grants: Grants,
    #[serde(with = "raw")]
    health: LinkHealth,
    #[serde(with = "raw")]
    rejected: RefusedCounters,
    state: State,
    timers: TimerTable<LinkTimer>,
    failed_start_ups: u32,
    /// The DSP did not acknowledge that it empties its path buffer, and has not since.
    cannot_empty_path: bool,
    /// Something changed that the published state shows at once.
    is_changed: bool,
    discard_unsent: bool,
    /// Empty between two inputs.
    #[serde(skip)]
    events: VecDeque<LinkEvent>,
}

impl Link {
    /// A link without a port.
    pub fn new(config: &BridgeConfig) -> Self {
        Link {
            config: config.clone(),
            parameters: config.parameters.clone(),
            decoder: Decoder::with_profile(config.link.profile),
            line: Line::default(),
            read: MonotonicNs(0),
            coherence: Coherence::new(config.status.coherence),
            commands: CommandQueue::new(config.link.ack_timeout()),
            outgoing: OutgoingBytes::default(),
            waypoint_number: Sequence::FIRST,
            last_received: None,
            messages: Cadence::default(),
            statuses: Cadence::default(),
            grants: Grants::default(),
            health: LinkHealth::default(),
            rejected: RefusedCounters::default(),
            state: State::Gone,
            timers: TimerTable::new(),
            failed_start_ups: 0,
            cannot_empty_path: false,
            is_changed: true,
            discard_unsent: false,
            events: VecDeque::with_capacity(EVENTS),
        }
    }

    /// After a snapshot: takes over what the configuration says.
    pub(crate) fn configure(&mut self, config: &BridgeConfig) {
        self.config = config.clone();
        self.coherence.configure(config.status.coherence);
        self.commands.configure(config.link.ack_timeout());
    }

    /// The bytes that wait for the port.
    pub fn unsent(&self) -> &[u8] {
        self.outgoing.as_bytes()
    }

    /// The port was opened: nothing is known of the DSP.
    pub fn opened(&mut self, now: MonotonicNs, line: Line) {
        (self.line, self.read) = (line, now);
        increment(&mut self.health.port_openings);
        self.decoder = Decoder::with_profile(self.config.link.profile);
        self.last_received = None;
        self.coherence.reset();
        self.failed_start_ups = 0;
        self.begin_start_up(now);
    }

    /// The port is gone.
    pub fn closed(&mut self, now: MonotonicNs) {
        self.abandon();
        if !matches!(self.state, State::Gone) {
            self.enter(State::Gone, now);
            self.events.push_back(LinkEvent::Lost);
        }
    }

    /// Handles the next deadline that has passed; false when none has. Events must be polled in between.
    pub fn expire(&mut self, now: MonotonicNs) -> bool {
        let Some(timer) = self.timers.expired(now) else {
            return false;
        };
        match timer {
            LinkTimer::Command => {
                if let Some(timeout) = self.commands.time_out(now) {
                    self.command_timed_out(now, timeout);
                }
            }
            LinkTimer::Silence => self.silence(now),
            LinkTimer::Status => self.status_overdue(now),
            LinkTimer::KeepAlive => self.keep_alive(now),
            LinkTimer::EmptyPath => self.empty_path(),
        }
        self.arm_command_timer();
        true
    }

    /// When [`Link::expire`] has something to do.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.timers.next()
    }

    /// Queues a command for the flight.
    ///
    /// # Errors
    /// [`NotQueued`]; nothing has changed.
    pub fn command(&mut self, command: Command, purpose: FlightCommand) -> Result<(), NotQueued> {
        self.command_until(command, purpose, ALWAYS)
    }

    /// Queues a command for the flight, of which no attempt goes out after `until`.
    ///
    /// # Errors
    /// [`NotQueued`]; nothing has changed.
    pub fn command_until(
        &mut self,
        command: Command,
        purpose: FlightCommand,
        until: MonotonicNs,
    ) -> Result<(), NotQueued> {
        match self.state {
            State::Up(_) | State::Silent(_) => {
                let purpose = Purpose::Flight(purpose);
                Ok(self.commands.push_until(command, purpose, until)?)
            }
            State::Gone | State::Connecting(_) => Err(NotQueued::NotStartedUp),
        }
    }

    /// Whether such a command of the flight waits or is outstanding.
    pub fn has(&self, command: FlightCommand) -> bool {
        self.commands
            .has(|purpose| *purpose == Purpose::Flight(command))
    }

    /// Takes back a command of the flight that has not been sent; false when it was sent.
    pub fn withdraw(&mut self, command: FlightCommand) -> bool {
        self.commands
            .withdraw(|purpose| *purpose == Purpose::Flight(command))
    }

    /// Forgets the commands of the movement that have not been acknowledged. Parameter requests go on.
    pub fn forget_movement(&mut self) {
        self.commands.forget(|purpose| {
            matches!(purpose, Purpose::Flight(command) if *command != FlightCommand::Parameter)
        });
        self.arm_command_timer();
    }

    /// Forgets the command of the parameter request.
    pub fn forget_parameter(&mut self) {
        self.commands
            .forget(|purpose| *purpose == Purpose::Flight(FlightCommand::Parameter));
        self.arm_command_timer();
    }

    /// Sends a waypoint; false when there is no room or the path buffer is not known, and then it must be offered again
    /// at the next grant. One that is sent `again` keeps its number, so that the DSP recognises a copy.
    pub fn waypoint(&mut self, now: MonotonicNs, waypoint: &Waypoint, again: bool) -> bool {
        let State::Up(session) = &mut self.state else {
            return false;
        };
        if session.path == DspPath::Unknown {
            return false;
        }
        let number = if again {
            self.waypoint_number
        } else {
            self.waypoint_number.next()
        };
        let frame = Uplink::Waypoint(*waypoint).encode_in(self.config.link.profile, number);
        if !self.outgoing.push(&frame) {
            increment(&mut self.rejected.transmit_overflows);
            return false;
        }
        let is_first = session.path == DspPath::Empty;
        if is_first {
            // An empty buffer cannot be dropped; from here on the DSP counts the silence of the PC.
            session.last_delivered = now;
        }
        session.path.add_waypoint();
        self.waypoint_number = number;
        increment(&mut self.health.waypoints_sent);
        if is_first {
            self.is_changed = true;
            self.schedule_keep_alive(now);
        }
        true
    }

    /// The bytes to write to the port. None when a waypoint among them would come too late: the next input ends the
    /// path.
    pub fn transmit(&mut self, now: MonotonicNs) -> &[u8] {
        if self.may_have_dropped_path(now) {
            return &[];
        }
        if let Some(sending) = self.commands.poll(now) {
            self.send(&sending);
            self.arm_command_timer();
        }
        self.outgoing.as_bytes()
    }

    /// The first `count` bytes of [`Link::transmit`] have been written.
    pub fn transmitted(&mut self, count: usize) {
        self.outgoing.consume(count);
    }

    /// Whether the kernel should drop what it has not sent yet; asking resets it.
    pub fn take_discard_unsent(&mut self) -> bool {
        std::mem::take(&mut self.discard_unsent)
    }

    /// Whether the published state changed since the last time; asking resets it.
    pub fn take_changed(&mut self) -> bool {
        std::mem::take(&mut self.is_changed)
    }

    /// State of the link.
    pub fn state(&self) -> LinkState {
        match self.state {
            State::Gone => LinkState::Gone,
            State::Connecting(_) => LinkState::Connecting,
            State::Up(_) => LinkState::Up,
            State::Silent(_) => LinkState::Silent,
        }
    }

    /// Whether the DSP takes commands.
    pub fn is_up(&self) -> bool {
        matches!(self.state, State::Up(_))
    }

    /// Whether something is wrong with the link now: it is lost, or the DSP does not acknowledge what it must.
    pub fn is_in_trouble(&self) -> bool {
        match self.state {
            State::Gone | State::Silent(_) => true,
            State::Connecting(_) => self.failed_start_ups > 0,
            State::Up(_) => self.cannot_empty_path,
        }
    }

    /// What the DSP's path buffer may hold.
    pub fn path(&self) -> DspPath {
        match self.state {
            State::Up(session) | State::Silent(session) => session.path,
            State::Gone | State::Connecting(_) => DspPath::Unknown,
        }
    }

    /// How long the last status counts as recent.
    pub fn status_fresh_for(&self) -> std::time::Duration {
        self.statuses.fresh_for(self.config.link.silent_after())
    }

    /// Figures of the link.
    pub fn health(&self) -> LinkHealth {
        let supported = matches!(self.state, State::Up(session) | State::Silent(session) if session.has_pc_timeout);
        let path: DspPathState = self.path().published();
        LinkHealth {
            state: self.state().code(),
            dsp_path: path.code(),
            pc_timeout_supported: u32::from(supported),
            ..self.health
        }
    }

    /// What was discarded.
    pub fn rejected(&self) -> &RefusedCounters {
        &self.rejected
    }

    /// The parameters that are written at each start-up.
    pub fn parameters(&self) -> &ParametersConfig {
        &self.parameters
    }

    /// The parameters that are written at each start-up, to add one.
    pub fn parameters_mut(&mut self) -> &mut ParametersConfig {
        &mut self.parameters
    }

    /// Delivery of a path's waypoints is verified, or is not.
    pub fn note_verified(&mut self, verified: bool) {
        self.health.delivery_verified = u32::from(verified);
    }

    /// A waypoint is going to be sent again.
    pub fn count_repeated_waypoint(&mut self) {
        increment(&mut self.health.waypoints_repeated);
    }

    /// A sample was published.
    pub fn count_published(&mut self, received: MonotonicNs) {
        self.health.last_telemetry_ns = received.0;
        increment(&mut self.health.telemetry_published);
    }

    fn command_timed_out(&mut self, now: MonotonicNs, timeout: Timeout<Purpose>) {
        let purpose = match timeout {
            Timeout::SendAgain(sending) => {
                increment(&mut self.health.commands_repeated);
                return self.send(&sending);
            }
            Timeout::Failed(purpose) => purpose,
        };
        increment(&mut self.health.commands_failed);
        self.is_changed = true;
        match purpose {
            Purpose::StartUp(_) => self.start_up_failed(),
            // Something else may have arrived meanwhile; then the link is not lost.
            Purpose::Probe if self.is_up() => {}
            Purpose::Probe => {
                self.events.push_back(LinkEvent::Lost);
                self.begin_start_up(now);
            }
            Purpose::StatusProbe { .. } => self.mask_not_read(),
            // They are sent again when the next status is overdue; a DSP that answers nothing else falls silent.
            Purpose::ReactivateStatus | Purpose::RewriteMask => {}
            // The next one follows; how long the DSP has been without one is looked at then.
            Purpose::KeepAlive => {}
            Purpose::EmptyPath => self.path_not_emptied(),
            Purpose::Flight(command) => {
                self.discard_waiting_bytes();
                self.events.push_back(LinkEvent::Undelivered(command));
            }
        }
    }

    fn send(&mut self, sending: &Sending) {
        let message = Uplink::Command(sending.command);
        let frame = message.encode_in(self.config.link.profile, sending.number);
        if !self.outgoing.push(&frame) {
            increment(&mut self.rejected.transmit_overflows);
        }
    }

    /// The queue of commands knows when its outstanding command is overdue.
    fn arm_command_timer(&mut self) {
        match self.commands.deadline() {
            Some(deadline) => self.timers.arm(LinkTimer::Command, deadline),
            None => self.timers.stop(LinkTimer::Command),
        }
    }

    fn enter(&mut self, state: State, now: MonotonicNs) {
        self.state = state;
        self.health.state_since_ns = now.0;
        self.is_changed = true;
    }
}

/// Counters stop at their greatest value.
fn increment(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}
