//! The DSP's side of the protocol (`docs/protocol.md` sections 5 … 8): a pure value that is given bytes and time, and is
//! drained of bytes.
//!
//! It was written from that page alone. Where the page leaves a choice:
//!
//! * *Stray* bytes and *truncated* messages are only counted: nobody can say what they were, and error 102 is kept for a
//!   checksum that is wrong.
//! * A waypoint outside the limits of section 9, or lower than 0.5 m above the home, is discarded with error 30.
//! * The first status and the first flow control come one period after they were switched on; a shorter period takes
//!   effect at once.
//! * Following off does all that *invalidate path* does.
//! * A reboot in flight lets a take-off or landing go on, because nothing here models a crash; otherwise the helicopter
//!   hovers on the spot.
//! * A copy of a command is acknowledged as the command was, a read with the value of the first time.
//! * While the pilot's switch stands on manual, flow control asks for no waypoint, waypoints are still taken, and an order
//!   to take off or to land is refused with error 30.
//! * An acknowledgement that finds its queue full is dropped with error 5.
//!
//! Time is simulated: a [`Duration`] since the start of the simulator. The DSP's own clock starts when it boots.

pub mod copies;
pub mod errors;
pub mod firmware;
mod movement;
pub mod output;
pub mod ports;
mod tamper;

use std::time::Duration;

use dsp_protocol::downlink::Geographic;
use dsp_protocol::{
    Command, Decoded, Decoder, Downlink, DspErrorCode, FlowControl, Group, Profile, Refusal,
    Sequence, Status, StatusMask, Uplink, Waypoint, port,
};

use crate::helicopter::pilot::PilotSwitch;
use crate::helicopter::{Helicopter, Refused};

use copies::Copies;
use errors::ErrorQueue;
use firmware::Firmware;
use movement::TakeOff;
use output::Output;
use ports::Ports;

/// Free places of the path buffer without which flow control says stop: the second is for a waypoint on its way.
const PLACES_TO_SEND: usize = 2;
/// "Write to sci_a with a full queue": the line to the PC hangs at the first serial interface.
const WRITE_QUEUE_FULL: DspErrorCode = DspErrorCode(5);

/// Least time between two errors that tell of the other profile (section 11).
const OTHER_PROFILE_PERIOD: Duration = Duration::from_secs(1);

/// What the DSP counted since it booted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Commands by code, copies among them.
    pub commands: [u64; 8],
    /// Waypoints that the path buffer took.
    pub waypoints: u64,
    /// Copies of the last command, acknowledged and not executed.
    pub command_copies: u64,
    /// Copies of the newest waypoint, discarded in silence.
    pub waypoint_copies: u64,
    /// Waypoints that were discarded with an error.
    pub waypoints_discarded: u64,
    /// How often the PC was silent for so long that the path buffer was emptied.
    pub pc_timeouts: u64,
    /// Flow control messages that asked for a waypoint.
    pub waypoint_requests: u64,
    /// Refusals of the decoder, in the order of [`Refusal::ALL`].
    pub refusals: [u64; Refusal::ALL.len()],
    /// Status messages that were queued.
    pub statuses: u64,
    /// Status messages that were left out because the line was too slow.
    pub statuses_left_out: u64,
}

/// The DSP.
#[derive(Clone, Debug)]
pub struct Dsp {
    firmware: Firmware,
    boot_errors: Vec<DspErrorCode>,
    booted_at: Duration,
    decoder: Decoder<Uplink>,
    ports: Ports,
    errors: ErrorQueue,
    output: Output,
    /// When the next status is due; nothing while transmission is off.
    status_due: Option<Duration>,
    /// When the next flow control is due; nothing while following is off.
    flow_control_due: Option<Duration>,
    /// When the PC has been silent for too long; nothing while port 10004 is 0, or when it has been already.
    pc_timeout_due: Option<Duration>,
    /// Whether following has been switched on since the boot.
    started_up: bool,
    take_off: TakeOff,
    copies: Copies,
    /// When the PC was told that it speaks the other profile.
    other_profile_told: Option<Duration>,
    /// How far a fault has moved the clock.
    clock_shift_ms: i64,
    counters: Counters,
}

impl Dsp {
    /// A DSP with `firmware` that speaks `profile`. It boots at `now`, and queues `boot_errors` while it does so, now and at
    /// every reboot.
    pub fn boot(
        now: Duration,
        profile: Profile,
        boot_errors: Vec<DspErrorCode>,
        firmware: Firmware,
    ) -> Dsp {
        let mut errors = ErrorQueue::default();
        boot_errors.iter().for_each(|error| errors.push(*error));
        Dsp {
            firmware,
            boot_errors,
            booted_at: now,
            decoder: Decoder::with_profile(profile),
            ports: Ports::default(),
            errors,
            output: Output::with_profile(profile),
            status_due: None,
            flow_control_due: None,
            pc_timeout_due: None,
            started_up: false,
            take_off: TakeOff::default(),
            copies: Copies::default(),
            other_profile_told: None,
            clock_shift_ms: 0,
            counters: Counters::default(),
        }
    }

    /// Boots again: everything that is not sent is lost, and the helicopter hovers (see [`Helicopter::reboot`]).
    pub fn reboot(&mut self, now: Duration, helicopter: &mut Helicopter) {
        helicopter.advance(now);
        let boot_errors = std::mem::take(&mut self.boot_errors);
        let firmware = Firmware {
            clock_start_ms: 0,
            ..self.firmware
        };
        *self = Dsp::boot(now, self.decoder.profile(), boot_errors, firmware);
        helicopter.reboot(self.ports.settings());
    }

    /// Takes bytes that the line delivers at `now`.
    pub fn receive(&mut self, now: Duration, mut bytes: &[u8], helicopter: &mut Helicopter) {
        self.advance(now, helicopter);
        helicopter.advance(now);
        while !bytes.is_empty() {
            let (taken, decoded) = self.decoder.receive(bytes);
            bytes = bytes.get(taken..).unwrap_or_default();
            match decoded {
                Decoded::Incomplete => {}
                Decoded::Refused(refusal) => self.refuse(now, refusal),
                Decoded::Message(received) => {
                    match received.message {
                        Uplink::Command(command) => {
                            self.serve(now, command, received.sequence, helicopter)
                        }
                        Uplink::Waypoint(waypoint) => {
                            self.take_waypoint(waypoint, received.sequence, helicopter)
                        }
                    }
                    // After it was served: it may have set the time-out.
                    self.pc_timeout_due = self.pc_timeout().map(|timeout| now + timeout);
                }
            }
        }
    }

    /// Does what is due up to `now`.
    pub fn advance(&mut self, now: Duration, helicopter: &mut Helicopter) {
        while let Some(due) = self.next_deadline().filter(|due| *due <= now) {
            helicopter.advance(due);
            if self.pc_timeout_due.take_if(|at| *at == due).is_some() {
                self.miss_pc(helicopter);
            }
            if self.take_off.begins_at == Some(due) {
                self.begin_late_take_off(helicopter);
            }
            if self.status_due == Some(due) {
                self.status_due = Some(due + self.status_period());
                self.queue_status(due, helicopter);
            }
            if self.flow_control_due == Some(due) {
                self.flow_control_due = Some(due + self.flow_control_period());
                self.queue_flow_control(helicopter);
            }
        }
    }

    /// When [`advance`](Self::advance) has something to do next; nothing while the DSP is silent.
    pub fn next_deadline(&self) -> Option<Duration> {
        [
            self.status_due,
            self.flow_control_due,
            self.pc_timeout_due,
            self.take_off.begins_at,
        ]
        .into_iter()
        .flatten()
        .min()
    }

    /// What waits to be sent.
    pub fn output(&self) -> &Output {
        &self.output
    }

    /// Counts `count` bytes of the output's front as sent.
    pub fn sent(&mut self, count: usize) {
        self.output.consume(count);
    }

    /// What was counted since the boot.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Errors that wait to be told.
    pub fn errors(&self) -> &ErrorQueue {
        &self.errors
    }

    /// The values of the ports.
    pub fn ports(&self) -> &Ports {
        &self.ports
    }

    /// Whether waypoint following is on.
    pub fn is_following(&self) -> bool {
        self.flow_control_due.is_some()
    }

    /// Whether the PC has started the DSP up since its boot: it has switched waypoint following on at least once.
    pub fn was_started_up(&self) -> bool {
        self.started_up
    }

    /// Acknowledges a command, then carries it out or refuses it, unless it is a copy.
    fn serve(
        &mut self,
        now: Duration,
        command: Command,
        sequence: Option<Sequence>,
        helicopter: &mut Helicopter,
    ) {
        if let Some(count) = self.counters.commands.get_mut(usize::from(command.code())) {
            *count += 1;
        }
        if let Some(answer) = self.copies.answer(sequence, command) {
            self.counters.command_copies += 1;
            self.acknowledge(answer, sequence);
            return;
        }
        let code = command.code();
        let (answer, is_known) = match command {
            Command::Read16 { port } => {
                let value = self.read_16(port, helicopter);
                let answer = Downlink::Ack16 {
                    command: code,
                    value: value.unwrap_or(0),
                };
                (answer, value.is_some())
            }
            Command::Read32 { port } => {
                let value = self.ports.read_32(port);
                let answer = Downlink::Ack32 {
                    command: code,
                    value: value.unwrap_or(0.0),
                };
                (answer, value.is_some())
            }
            _ => (Downlink::Ack { command: code }, true),
        };
        self.acknowledge(answer, sequence);
        self.copies.executed(sequence, command, answer);
        if !(is_known && self.carry_out(now, command, helicopter)) {
            self.errors.push(DspErrorCode::INVALID_COMMAND);
        }
    }

    /// The value of a 16-bit port. Take-off and landing tell whether one is under way.
    fn read_16(&self, number: u16, helicopter: &Helicopter) -> Option<u16> {
        match number {
            _ if !self.has_port(number) => None,
            port::TAKE_OFF => Some(self.is_taking_off(helicopter).into()),
            port::LAND => Some(self.is_landing(helicopter).into()),
            // Bit 15 tells it from an unknown port, which reads 0.
            port::WAYPOINT_COUNT => Some(0x8000 | (self.counters.waypoints & 0x7FFF) as u16),
            _ => self.ports.read_16(number),
        }
    }

    /// Whether the firmware has this 16-bit port, if the protocol has it.
    fn has_port(&self, number: u16) -> bool {
        match number {
            port::PC_TIMEOUT_MS => self.firmware.has_pc_timeout,
            port::WAYPOINT_COUNT => self.firmware.has_waypoint_count,
            _ => true,
        }
    }

    /// Does what a command says once it is acknowledged, which for a read is nothing; false when it is refused.
    fn carry_out(&mut self, now: Duration, command: Command, helicopter: &mut Helicopter) -> bool {
        match command {
            Command::Read16 { .. } | Command::Read32 { .. } => true,
            Command::Write16 { port, value } => self.write_16(now, port, value, helicopter),
            Command::Write32 { port, value } => {
                let written = self.ports.write_32(port, value).is_ok();
                helicopter.set_settings(self.ports.settings());
                written
            }
            Command::ClearErrors => {
                self.errors.clear();
                self.output.forget_error();
                true
            }
            Command::ActivateStatus => {
                let first = now + self.status_period();
                self.status_due.get_or_insert(first);
                true
            }
            Command::InvalidatePath => {
                self.invalidate_path(helicopter);
                true
            }
            Command::Following { on: true } => {
                self.started_up = true;
                let first = now + self.flow_control_period();
                self.flow_control_due.get_or_insert(first);
                true
            }
            Command::Following { on: false } => {
                self.flow_control_due = None;
                self.take_off.awaits_flow_control = false;
                self.invalidate_path(helicopter);
                true
            }
        }
    }

    fn invalidate_path(&mut self, helicopter: &mut Helicopter) {
        helicopter.clear_path();
        self.copies.forget_waypoint();
    }

    /// The PC has been silent for the time of port 10004: waypoints that it may no longer watch over are not flown.
    fn miss_pc(&mut self, helicopter: &mut Helicopter) {
        if helicopter.held_waypoints() > 0 {
            self.counters.pc_timeouts += 1;
            self.invalidate_path(helicopter);
        }
    }

    fn write_16(
        &mut self,
        now: Duration,
        number: u16,
        bits: u16,
        helicopter: &mut Helicopter,
    ) -> bool {
        match number {
            port::TAKE_OFF => bits == 1 && self.order_take_off(now, helicopter),
            port::LAND => bits == 1 && self.order_landing(helicopter),
            _ if !self.has_port(number) => false,
            _ => {
                let written = self.ports.write_16(number, bits).is_ok();
                helicopter.set_settings(self.ports.settings());
                // What is due later than a new, shorter period allows is due then.
                let (status, flow) = (self.status_period(), self.flow_control_period());
                self.status_due = self.status_due.map(|due| due.min(now + status));
                self.flow_control_due = self.flow_control_due.map(|due| due.min(now + flow));
                written
            }
        }
    }

    fn take_waypoint(
        &mut self,
        waypoint: Waypoint,
        sequence: Option<Sequence>,
        helicopter: &mut Helicopter,
    ) {
        let outcome = if self.copies.has_waypoint(sequence) {
            Err(Refused::Copy)
        } else if self.is_following() && !self.is_taking_off(helicopter) && waypoint.is_plausible()
        {
            helicopter.push_waypoint(Geographic {
                latitude_deg: waypoint.latitude_deg,
                longitude_deg: waypoint.longitude_deg,
                altitude_m: waypoint.altitude_m,
            })
        } else {
            Err(Refused::Impossible)
        };
        let error = match outcome {
            Ok(()) => {
                self.counters.waypoints += 1;
                self.copies.took_waypoint(sequence);
                return;
            }
            // Silence: the PC sent it again because it could not know that it had arrived.
            Err(Refused::Copy) => {
                self.counters.waypoint_copies += 1;
                return;
            }
            Err(Refused::PathFull) => DspErrorCode::UART_QUEUE_FULL,
            Err(Refused::Impossible) => DspErrorCode::INVALID_COMMAND,
        };
        self.counters.waypoints_discarded += 1;
        self.errors.push(error);
    }

    /// Counts bytes that were refused, and tells the PC about those that can be told.
    fn refuse(&mut self, now: Duration, refusal: Refusal) {
        if let Some(count) = self.counters.refusals.get_mut(refusal as usize) {
            *count += 1;
        }
        self.errors.push(match refusal {
            Refusal::Stray | Refusal::Truncated => return,
            Refusal::OtherProfile => return self.tell_other_profile(now),
            Refusal::UnknownHeader => DspErrorCode::UNKNOWN_HEADER,
            Refusal::Checksum => DspErrorCode::PC_CHECKSUM,
            Refusal::Padding | Refusal::Value | Refusal::UnknownCommand => {
                DspErrorCode::INVALID_COMMAND
            }
        });
    }

    /// Tells the PC at once that it speaks the other profile. It may not have switched the status on, and the errors that
    /// wait for one would never be told.
    fn tell_other_profile(&mut self, now: Duration) {
        let told = self.other_profile_told;
        if told.is_none_or(|told| now >= told + OTHER_PROFILE_PERIOD) {
            self.other_profile_told = Some(now);
            self.output.push_alarm(DspErrorCode::UNKNOWN_HEADER);
        }
    }

    fn queue_status(&mut self, now: Duration, helicopter: &mut Helicopter) {
        if self.output.status_pending() {
            self.counters.statuses_left_out += 1;
            return;
        }
        helicopter.advance(now);
        let mask = self.sent_groups();
        let time_ms = self.clock_ms(now - self.booted_at);
        let status = chosen(helicopter.sense(), time_ms, mask);
        self.output.push_status(status, self.errors.pop());
        self.counters.statuses += 1;
    }

    /// Asks for a waypoint, or for none.
    fn queue_flow_control(&mut self, helicopter: &Helicopter) {
        let has_room = helicopter.free_places() >= PLACES_TO_SEND;
        let is_auto = helicopter.switch() == PilotSwitch::Auto;
        let request = if has_room && is_auto && helicopter.takes_waypoints() {
            self.take_off.awaits_flow_control = false;
            self.counters.waypoint_requests += 1;
            FlowControl::Send
        } else {
            FlowControl::Stop
        };
        self.output.push_flow_control(request);
    }

    /// The groups that a status carries: those of the mask, as far as the firmware obeys it.
    fn sent_groups(&self) -> StatusMask {
        let asked = self.ports.read_16(port::STATUS_MASK).unwrap_or(0);
        let sent = asked | self.firmware.extra_groups.0;
        if self.firmware.has_time {
            StatusMask(sent)
        } else {
            StatusMask(sent & !StatusMask::NONE.with(Group::Time).0)
        }
    }

    fn acknowledge(&mut self, ack: Downlink, sequence: Option<Sequence>) {
        // Without a number nothing is sent of it.
        if !self.output.push_ack(ack, sequence.unwrap_or_default()) {
            self.errors.push(WRITE_QUEUE_FULL);
        }
    }

    fn status_period(&self) -> Duration {
        self.period(port::STATUS_PERIOD_MS)
    }

    fn flow_control_period(&self) -> Duration {
        self.period(port::FLOW_CONTROL_PERIOD_MS)
    }

    /// The longest silence of the PC that leaves the path as it is.
    fn pc_timeout(&self) -> Option<Duration> {
        let timeout_ms = self.ports.read_16(port::PC_TIMEOUT_MS)?;
        (timeout_ms > 0).then(|| Duration::from_millis(timeout_ms.into()))
    }

    fn period(&self, number: u16) -> Duration {
        // No period is zero, or time would stand still; the ports do not take one.
        Duration::from_millis(self.ports.read_16(number).unwrap_or(1).max(1).into())
    }
}

/// The groups of `sensed` that the mask chooses, and the DSP's time.
fn chosen(sensed: Status, time_ms: u32, mask: StatusMask) -> Status {
    let mut status = Status {
        time_ms: Some(time_ms),
        ..sensed
    };
    status.retain(mask);
    status
}

#[cfg(test)]
mod tests;
