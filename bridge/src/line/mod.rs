//! The line to the DSP: bytes in both directions, commands, start-up, liveness and time coherence in one value.
//!
//! It is told when the port opens and closes, is given bytes and the time, and answers with [`LineEvent`]s. It never
//! decides anything about a flight and never touches a port.
//!
//! | state | enters | leaves |
//! |---|---|---|
//! | gone | the port closed | the port opened → connecting |
//! | connecting | port opened, DSP rebooted, probe failed | start-up acknowledged → up (event `Ready`) |
//! | up | start-up acknowledged, message while silent | no message for a time → silent; reboot → connecting |
//! | silent | no valid message for the configured time | any message → up; probe failed → connecting (`Lost`) |
//!
//! In silence the DSP is probed by reading its status mask, which disturbs nothing. A mask that is not ours, or a DSP
//! that answers probes but sends nothing else, has rebooted. One that says other things but sends no status any more is
//! told to send it; one that sends status in another mask has rebooted too.

pub mod coherence;
pub mod delivery;
mod liveness;
pub mod outgoing;
pub mod startup;

use std::collections::VecDeque;

use dsp_protocol::{
    Command, Decoded, Decoder, Downlink, DspErrorCode, FlowControl, Received, Refusal, Sequence,
    Status, StatusMask, Uplink, Waypoint, plausibility,
};
use ipc_types::MonotonicNs;
use ipc_types::code::LinkState;
use ipc_types::payload::{LinkHealth, RefusedCounters};

use crate::config::BridgeConfig;
use coherence::Coherence;
use delivery::{Ack, AckData, Delivery, Overdue, QueueFull, Sending};
use outgoing::Outgoing;

/// Probes that are answered without anything else being heard before the DSP counts as rebooted.
const LONELY_PROBES: u32 = 2;

/// Events that one message or deadline can cause at most: a reboot, two samples, and the end of the start-up.
const EVENTS: usize = 4;

/// What a command is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Part of the start-up sequence.
    StartUp {
        /// Its last command.
        last: bool,
    },
    /// Is the DSP there, and does it still have our mask?
    Probe,
    /// The DSP is there and sends no status: does it still have our mask?
    StatusProbe,
    /// It has, and is told again to send status.
    WakeStatus,
    /// For the flight.
    Flight(FlightCommand),
}

/// What a command of the flight does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlightCommand {
    /// Writes the take-off altitude.
    TakeOffAltitude,
    /// Begins the take-off.
    TakeOff,
    /// Begins the landing.
    Land,
    /// Empties the DSP's path buffer.
    InvalidatePath,
    /// Empties the DSP's error queue; the last command of a stop.
    ClearErrors,
    /// Reads how many waypoints the DSP took.
    CountWaypoints,
    /// Reads whether the take-off or landing is under way: its port is 1 as long as that lasts.
    ConfirmMovement,
}

/// One status message, and when it came.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The message without its implausible groups.
    pub status: Status,
    /// When its last byte was read.
    pub received: MonotonicNs,
}

/// What happened on the line.
#[derive(Clone, Copy, Debug, PartialEq)]
// A sample is most of what comes, fifty times a second; a box would allocate for each.
#[allow(clippy::large_enum_variant)]
pub enum LineEvent {
    /// The start-up sequence is done: the DSP takes commands.
    Ready,
    /// The DSP has rebooted; the start-up sequence runs again.
    Rebooted,
    /// The DSP cannot be reached any more.
    Lost,
    /// A status sample in its place in time.
    Sample(Sample),
    /// One waypoint may be sent.
    Grant,
    /// A command of the flight arrived at the DSP.
    Delivered(FlightCommand),
    /// The DSP's count of the waypoints that it took was read.
    WaypointCount(u16),
    /// Whether the take-off or landing that was ordered is under way.
    MovementConfirmed(bool),
    /// A command of the flight was not acknowledged: an ack error.
    Undelivered(FlightCommand),
    /// The DSP reports an error; `starting` while start-up is not done, when errors are to be expected.
    DspError {
        /// The error.
        code: DspErrorCode,
        /// Start-up is not done.
        starting: bool,
    },
}

/// See the module's documentation.
#[derive(Clone, Debug)]
pub struct Line {
    config: BridgeConfig,
    decoder: Decoder<Downlink>,
    coherence: Coherence<Sample>,
    delivery: Delivery<Purpose>,
    outgoing: Outgoing,
    /// Number of the last waypoint that was sent.
    waypoint_number: Sequence,
    /// Number of the last message that was received.
    heard_number: Option<Sequence>,
    health: LinkHealth,
    refused: RefusedCounters,
    state: LinkState,
    silence_deadline: Option<MonotonicNs>,
    /// When the next status must have come; nothing unless the link is up.
    status_deadline: Option<MonotonicNs>,
    start_up_retry: Option<MonotonicNs>,
    failed_start_ups: u32,
    lonely_probes: u32,
    discard_unsent: bool,
    events: VecDeque<LineEvent>,
}

impl Line {
    /// A line without a port.
    pub fn new(config: &BridgeConfig) -> Self {
        Line {
            config: config.clone(),
            decoder: Decoder::with_profile(config.link.profile),
            coherence: Coherence::new(config.status.coherence),
            delivery: Delivery::new(config.link.ack_timeout()),
            outgoing: Outgoing::default(),
            waypoint_number: Sequence::FIRST,
            heard_number: None,
            health: LinkHealth::default(),
            refused: RefusedCounters::default(),
            state: LinkState::Gone,
            silence_deadline: None,
            status_deadline: None,
            start_up_retry: None,
            failed_start_ups: 0,
            lonely_probes: 0,
            discard_unsent: false,
            events: VecDeque::with_capacity(EVENTS),
        }
    }

    /// The port was opened: nothing is known of the DSP.
    pub fn opened(&mut self, now: MonotonicNs) {
        increment(&mut self.health.port_openings);
        self.decoder = Decoder::with_profile(self.config.link.profile);
        self.heard_number = None;
        self.coherence.reset();
        self.failed_start_ups = 0;
        self.begin_start_up(now);
    }

    /// The port is gone.
    pub fn closed(&mut self, now: MonotonicNs) {
        self.abandon();
        self.start_up_retry = None;
        if self.state != LinkState::Gone {
            self.enter(LinkState::Gone, now);
            self.events.push_back(LineEvent::Lost);
        }
    }

    /// Takes bytes from the front of `input` until something happens or all are used.
    pub fn receive(&mut self, now: MonotonicNs, input: &mut &[u8]) -> Option<LineEvent> {
        while self.events.is_empty() && !input.is_empty() {
            let (used, decoded) = self.decoder.receive(input);
            self.health.bytes_received += used as u64;
            *input = input.get(used..).unwrap_or_default();
            match decoded {
                Decoded::Incomplete => {}
                Decoded::Refused(refusal) => self.count_refusal(refusal),
                Decoded::Message(received) => self.received(now, &received),
            }
        }
        self.events.pop_front()
    }

    /// Handles the next deadline that has passed; call until it answers nothing.
    pub fn expire(&mut self, now: MonotonicNs) -> Option<LineEvent> {
        while self.events.is_empty() {
            if let Some(overdue) = self.delivery.overdue(now) {
                self.command_overdue(now, overdue);
            } else if passed(self.start_up_retry, now) {
                self.begin_start_up(now);
            } else if passed(self.silence_deadline, now) {
                self.silence(now);
            } else if passed(self.status_deadline, now) {
                self.status_overdue(now);
            } else {
                break;
            }
        }
        self.events.pop_front()
    }

    /// When [`Line::expire`] has something to do.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        [
            self.delivery.deadline(),
            self.start_up_retry,
            self.silence_deadline,
            self.status_deadline,
        ]
        .into_iter()
        .flatten()
        .min()
    }

    /// Queues a command for the flight.
    pub fn command(&mut self, command: Command, purpose: FlightCommand) -> Result<(), QueueFull> {
        self.delivery.push(command, Purpose::Flight(purpose))
    }

    /// Sends a waypoint; false when there is no room, and then it must be offered again at the next grant. One that is
    /// sent `again` keeps its number, so that the DSP can tell a copy.
    pub fn waypoint(&mut self, waypoint: &Waypoint, again: bool) -> bool {
        let number = if again {
            self.waypoint_number
        } else {
            self.waypoint_number.next()
        };
        let message = Uplink::Waypoint(*waypoint);
        let frame = message.encode_in(self.config.link.profile, number);
        let sent = self.outgoing.push(&frame);
        if sent {
            self.waypoint_number = number;
            increment(&mut self.health.waypoints_sent);
        } else {
            increment(&mut self.refused.transmit_overflows);
        }
        sent
    }

    /// Forgets all commands of the flight that have not been acknowledged.
    pub fn forget_flight(&mut self) {
        self.delivery
            .forget(|purpose| matches!(purpose, Purpose::Flight(_)));
    }

    /// The bytes to write to the port.
    pub fn transmit(&mut self, now: MonotonicNs) -> &[u8] {
        if let Some(sending) = self.delivery.poll(now) {
            self.send(&sending);
        }
        self.outgoing.as_bytes()
    }

    /// The first `count` bytes of [`Line::transmit`] have been written.
    pub fn transmitted(&mut self, count: usize) {
        self.outgoing.consume(count);
    }

    /// Whether the kernel should drop what it has not sent yet; asking resets it.
    pub fn take_discard_unsent(&mut self) -> bool {
        std::mem::take(&mut self.discard_unsent)
    }

    /// State of the link.
    pub fn state(&self) -> LinkState {
        self.state
    }

    /// Whether the DSP takes commands.
    pub fn is_up(&self) -> bool {
        self.state == LinkState::Up
    }

    /// Figures of the line.
    pub fn health(&self) -> &LinkHealth {
        &self.health
    }

    /// What was discarded.
    pub fn refused(&self) -> &RefusedCounters {
        &self.refused
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

    fn received(&mut self, now: MonotonicNs, received: &Received<Downlink>) {
        if let Some(number) = received.sequence
            && let Some(last) = self.heard_number.replace(number)
            && number != last
        {
            let missed = u32::from(number.missed_since(last));
            self.refused.missed_messages = self.refused.missed_messages.saturating_add(missed);
        }
        let ack = |command, data| Ack {
            command,
            data,
            acknowledges: received.acknowledges,
        };
        self.health.messages_received += 1;
        self.health.last_message_ns = now.0;
        self.heard_something(now);
        match received.message {
            Downlink::Ack { command } => {
                self.acknowledged(now, &ack(command, AckData::None));
            }
            Downlink::Ack16 { command, value } => {
                self.acknowledged(now, &ack(command, AckData::Bits16(value)));
            }
            Downlink::Ack32 { command, value } => {
                self.acknowledged(now, &ack(command, AckData::Bits32(value)));
            }
            Downlink::Status(status) => self.status(now, status),
            Downlink::FlowControl(FlowControl::Send) => self.heard(LineEvent::Grant),
            Downlink::FlowControl(FlowControl::Stop) => self.lonely_probes = 0,
            Downlink::Error(code) => {
                let starting = !self.is_up();
                self.heard(LineEvent::DspError { code, starting });
            }
        }
    }

    fn heard(&mut self, event: LineEvent) {
        self.lonely_probes = 0;
        self.events.push_back(event);
    }

    fn status(&mut self, now: MonotonicNs, mut status: Status) {
        self.lonely_probes = 0;
        self.heard_status(now, &status);
        let implausible = plausibility::implausible_groups(&status);
        if implausible != StatusMask::NONE {
            let groups = &mut self.refused.implausible_groups;
            *groups = groups.saturating_add(implausible.0.count_ones());
            self.refused.implausible_mask |= u32::from(implausible.0);
            status.withdraw(implausible);
        }
        let sample = Sample {
            status,
            received: now,
        };
        let Some(time_ms) = status.time_ms else {
            return self.untimed(sample);
        };
        let verdict = self.coherence.arrive(time_ms, sample);
        self.health.telemetry_incoherent = self
            .health
            .telemetry_incoherent
            .saturating_add(verdict.dropped);
        if verdict.rebooted {
            self.rebooted(now);
        }
        self.events
            .extend(verdict.send.into_iter().flatten().map(LineEvent::Sample));
    }

    fn acknowledged(&mut self, now: MonotonicNs, ack: &Ack) {
        let Some(purpose) = self.delivery.acknowledge(ack) else {
            increment(&mut self.health.acks_unmatched);
            return;
        };
        increment(&mut self.health.commands_acknowledged);
        match purpose {
            Purpose::StartUp { last: false } | Purpose::WakeStatus => {}
            Purpose::StartUp { last: true } => {
                self.failed_start_ups = 0;
                self.lonely_probes = 0;
                self.enter(LinkState::Up, now);
                self.heard_something(now);
                self.expect_status(now);
                self.events.push_back(LineEvent::Ready);
            }
            Purpose::Probe => {
                self.lonely_probes += 1;
                if !self.is_our_mask(ack.data) || self.lonely_probes >= LONELY_PROBES {
                    self.has_lost_its_mask(now);
                }
            }
            Purpose::StatusProbe if self.is_our_mask(ack.data) => self.wake_status(),
            Purpose::StatusProbe => self.has_lost_its_mask(now),
            Purpose::Flight(FlightCommand::CountWaypoints) => {
                if let AckData::Bits16(count) = ack.data {
                    self.events.push_back(LineEvent::WaypointCount(count));
                }
            }
            Purpose::Flight(FlightCommand::ConfirmMovement) => {
                let confirmed = ack.data != AckData::Bits16(0);
                self.events
                    .push_back(LineEvent::MovementConfirmed(confirmed));
            }
            Purpose::Flight(purpose) => self.events.push_back(LineEvent::Delivered(purpose)),
        }
    }

    fn command_overdue(&mut self, now: MonotonicNs, overdue: Overdue<Purpose>) {
        match overdue {
            Overdue::SendAgain(sending) => {
                increment(&mut self.health.commands_repeated);
                self.send(&sending);
                return;
            }
            Overdue::Failed(Purpose::StartUp { .. }) => {
                self.abandon();
                self.failed_start_ups = self.failed_start_ups.saturating_add(1);
                self.start_up_retry =
                    Some(now + self.config.link.start_up_retry(self.failed_start_ups));
            }
            Overdue::Failed(Purpose::Probe) => {
                // Something else may have been heard meanwhile; then the line is not lost.
                if self.state == LinkState::Silent {
                    self.events.push_back(LineEvent::Lost);
                    self.begin_start_up(now);
                }
            }
            // It is told again when the next status is overdue; a DSP that answers nothing else falls silent.
            Overdue::Failed(Purpose::StatusProbe | Purpose::WakeStatus) => {}
            Overdue::Failed(Purpose::Flight(purpose)) => {
                self.discard_waiting_bytes();
                self.events.push_back(LineEvent::Undelivered(purpose));
            }
        }
        increment(&mut self.health.commands_failed);
    }

    fn send(&mut self, sending: &Sending) {
        let message = Uplink::Command(sending.command);
        let frame = message.encode_in(self.config.link.profile, sending.number);
        if !self.outgoing.push(&frame) {
            increment(&mut self.refused.transmit_overflows);
        }
    }

    fn count_refusal(&mut self, refusal: Refusal) {
        let counter = match refusal {
            Refusal::Stray => &mut self.refused.stray,
            // The DSP sends no commands; its decoder never gives that one.
            Refusal::UnknownHeader | Refusal::UnknownCommand => &mut self.refused.unknown_header,
            Refusal::OtherProfile => &mut self.refused.other_profile,
            Refusal::Truncated => &mut self.refused.truncated,
            Refusal::Checksum => &mut self.refused.checksum,
            Refusal::Padding => &mut self.refused.padding,
            Refusal::Value => &mut self.refused.value,
        };
        increment(counter);
    }
}

/// Counters stop at their greatest value.
fn increment(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

fn passed(deadline: Option<MonotonicNs>, now: MonotonicNs) -> bool {
    deadline.is_some_and(|deadline| now >= deadline)
}
