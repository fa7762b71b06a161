//! The DSP's side of the protocol (`docs/protocol.md` sections 5 … 8): a pure value that is given bytes and time, and
//! is drained of bytes.
//!
//! It was written from that page alone. Where the page leaves a choice:
//!
//! * *Stray* bytes and *truncated* messages are only counted: what they were cannot be known, and error 102 is kept
//!   for a checksum that is wrong.
//! * A waypoint outside the limits of section 9, or lower than 0.5 m above the home, is discarded with error 30.
//! * The first status and the first flow control come one period after they were switched on; a shorter period takes
//!   effect at once.
//! * Following off does all that *invalidate path* does.
//! * A reboot in flight lets a take-off or landing go on, because nothing here models a crash; otherwise the helicopter
//!   hovers on the spot.
//! * A copy of a command is acknowledged as the command was, a read with the value of the first time.
//! * While the pilot's switch stands on manual, flow control asks for no waypoint, waypoints are still taken, and an
//!   order to take off or to land is refused with error 30.
//! * An acknowledgement that finds its queue full is dropped with error 5.
//!
//! Time is simulated: a [`Duration`] since the start of the simulator. The DSP's own clock starts when it boots.

mod command;
pub mod copies;
pub mod firmware;
pub mod output;
pub mod ports;

use std::time::Duration;

use dsp_protocol::downlink::Geographic;
use dsp_protocol::{
    DecodeError, Decoded, Decoder, Downlink, DspErrorCode, FlowControl, Group, Profile, Sequence,
    Status, StatusMask, Uplink, Waypoint, port,
};

use crate::helicopter::pilot::PilotSwitch;
use crate::helicopter::{Helicopter, Refused};

use copies::Copies;
use firmware::Firmware;
use output::{ErrorQueue, Output};
use ports::Ports;

/// Free places of the path buffer without which flow control is 0: the second is for a waypoint on its way.
const PLACES_TO_SEND: usize = 2;
/// "Write to sci_a with a full queue": the serial link to the PC hangs at the first serial interface.
const WRITE_QUEUE_FULL: DspErrorCode = DspErrorCode(5);

/// Least time between two errors that report the other profile (section 11).
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
    /// What the decoder rejected, by the reasons of [`DecodeError::ALL`].
    pub rejections: [u64; DecodeError::ALL.len()],
    /// Status messages that were queued.
    pub statuses: u64,
    /// Status messages that were left out because the serial link was too slow.
    pub statuses_left_out: u64,
}

/// What the DSP knows of a take-off beyond what the helicopter does.
#[derive(Clone, Copy, Debug, Default)]
struct TakeOff {
    /// When a take-off begins that was acknowledged; only a firmware that begins late has one.
    begins_at: Option<Duration>,
    /// Whether flow control has not said 1 since the take-off began.
    awaits_flow_control: bool,
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
    /// When the next status is due; `None` while transmission is off.
    status_due: Option<Duration>,
    /// When the next flow control is due; `None` while following is off.
    flow_control_due: Option<Duration>,
    /// When the PC has been silent for too long; `None` while port 10004 is 0, or when it has been already.
    pc_timeout_due: Option<Duration>,
    /// Simulated seconds in a second of the PC.
    speed: f64,
    /// Whether following has been switched on since the boot.
    started_up: bool,
    take_off: TakeOff,
    copies: Copies,
    /// When it was last reported that the PC speaks the other profile.
    other_profile_reported: Option<Duration>,
    /// How far a fault has moved the clock.
    clock_shift_ms: i64,
    counters: Counters,
}

impl Dsp {
    /// A DSP with `firmware` that speaks `profile`. It boots at `now`, and queues `boot_errors` while it does so, now
    /// and at every reboot.
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
            speed: 1.0,
            started_up: false,
            take_off: TakeOff::default(),
            copies: Copies::default(),
            other_profile_reported: None,
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
        *self = Dsp {
            speed: self.speed,
            ..Dsp::boot(now, self.decoder.profile(), boot_errors, firmware)
        };
        helicopter.reboot(self.ports.settings());
    }

    /// Takes bytes that the serial link delivers at `now`.
    pub fn receive(&mut self, now: Duration, mut bytes: &[u8], helicopter: &mut Helicopter) {
        self.advance(now, helicopter);
        helicopter.advance(now);
        while !bytes.is_empty() {
            let (taken, decoded) = self.decoder.receive(bytes);
            bytes = bytes.get(taken..).unwrap_or_default();
            match decoded {
                Decoded::Incomplete => {}
                Decoded::Rejected(error) => self.reject(now, error),
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

    /// When [`advance`](Self::advance) has something to do next; `None` while the DSP is silent.
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

    /// Errors that wait to be sent.
    pub fn errors(&self) -> &ErrorQueue {
        &self.errors
    }

    /// The values of the ports.
    pub fn ports(&self) -> &Ports {
        &self.ports
    }

    /// Sets how many simulated seconds pass in a second of the PC. The PC keeps to the time-out of port 10004 by its
    /// own clock, so the DSP waits for that many times as long.
    pub fn set_speed(&mut self, speed: f64) {
        self.speed = speed;
    }

    /// Whether waypoint following is on.
    pub fn is_following(&self) -> bool {
        self.flow_control_due.is_some()
    }

    /// Whether the PC has started the DSP up since its boot: it has switched waypoint following on at least once.
    pub fn was_started_up(&self) -> bool {
        self.started_up
    }

    /// The PC has been silent for the time of port 10004: waypoints that it may no longer watch over are not flown.
    fn miss_pc(&mut self, helicopter: &mut Helicopter) {
        if helicopter.held_waypoints() > 0 {
            self.counters.pc_timeouts += 1;
            self.invalidate_path(helicopter);
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

    /// Counts bytes that were rejected, and queues an error for those that have one.
    fn reject(&mut self, now: Duration, error: DecodeError) {
        if let Some(count) = self.counters.rejections.get_mut(error as usize) {
            *count += 1;
        }
        self.errors.push(match error {
            DecodeError::Stray | DecodeError::Truncated => return,
            DecodeError::OtherProfile => return self.report_other_profile(now),
            DecodeError::UnknownHeader => DspErrorCode::UNKNOWN_HEADER,
            DecodeError::Checksum => DspErrorCode::PC_CHECKSUM,
            DecodeError::Padding | DecodeError::Value | DecodeError::UnknownCommand => {
                DspErrorCode::INVALID_COMMAND
            }
        });
    }

    /// Reports at once that the PC speaks the other profile. The PC may not have activated the status, and the errors
    /// that wait for a status would never be sent.
    fn report_other_profile(&mut self, now: Duration) {
        let reported = self.other_profile_reported;
        if reported.is_none_or(|reported| now >= reported + OTHER_PROFILE_PERIOD) {
            self.other_profile_reported = Some(now);
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
        (timeout_ms > 0).then(|| Duration::from_millis(timeout_ms.into()).mul_f64(self.speed))
    }

    fn period(&self, number: u16) -> Duration {
        // No period is zero, or time would stand still; the ports do not take one.
        Duration::from_millis(self.ports.read_16(number).unwrap_or(1).max(1).into())
    }
}

// What a script of faults does inside the DSP ([`crate::faults`]). Nothing here happens by itself.
impl Dsp {
    /// Queues an error, as if something in the DSP had failed.
    pub fn raise(&mut self, error: DspErrorCode) {
        self.errors.push(error);
    }

    /// Stops the status transmission, which no command of the PC can do. One that waits is still sent.
    pub fn stop_status(&mut self) {
        self.status_due = None;
    }

    /// Lets the clock jump, as a status carries it. It never reads less than zero; a reboot sets it right.
    pub fn shift_clock(&mut self, milliseconds: i64) {
        self.clock_shift_ms = self.clock_shift_ms.saturating_add(milliseconds);
    }

    /// Changes the status mask, as a write to port 10000 does that the PC did not send.
    pub fn change_mask(&mut self, mask: StatusMask) {
        // Port 10000 takes every value.
        let _ = self.ports.write_16(port::STATUS_MASK, mask.0);
    }

    /// Puts off everything that is due before `until`.
    pub fn hold(&mut self, until: Duration) {
        for due in [
            &mut self.status_due,
            &mut self.flow_control_due,
            &mut self.pc_timeout_due,
            &mut self.take_off.begins_at,
        ] {
            *due = due.map(|due| due.max(until));
        }
    }

    /// What the clock reads after running for `elapsed`, ms. It has 32 bits, and wraps after 49.7 days.
    fn clock_ms(&self, elapsed: Duration) -> u32 {
        let elapsed_ms = i64::try_from(elapsed.as_millis()).unwrap_or(i64::MAX);
        elapsed_ms
            .saturating_add(self.firmware.clock_start_ms.into())
            .saturating_add(self.clock_shift_ms)
            .max(0) as u32
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
