//! The commands of the PC (`docs/protocol.md` sections 8.2 and 8.5): acknowledged first, then carried out or refused.

use std::time::Duration;

use dsp_protocol::{Command, Downlink, DspErrorCode, Sequence, port};

use crate::helicopter::{Helicopter, Phase};

use super::Dsp;

impl Dsp {
    /// Acknowledges a command, then carries it out or refuses it, unless it is a copy.
    pub(super) fn serve(
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

    /// The value of a 16-bit port. Those of take-off and landing read 1 while one is under way.
    fn read_16(&self, number: u16, helicopter: &Helicopter) -> Option<u16> {
        match number {
            _ if !self.has_port(number) => None,
            port::TAKE_OFF => Some(self.is_taking_off(helicopter).into()),
            port::LAND => Some(self.is_landing(helicopter).into()),
            // Bit 15 distinguishes it from an unknown port, which reads 0.
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

    /// Carries a command out once it is acknowledged, which for a read is nothing; false when it is refused.
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

    pub(super) fn invalidate_path(&mut self, helicopter: &mut Helicopter) {
        helicopter.clear_path();
        self.copies.forget_waypoint();
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
}

// Take-off and landing: ports 10121 and 10122 (section 8.5).
impl Dsp {
    /// Whether port 10121 reads 1: from the order until the first flow control with 1, which ends the
    /// take-off. With following off no flow control comes, and the end of the climb is the end.
    pub fn is_taking_off(&self, helicopter: &Helicopter) -> bool {
        let climbs = matches!(helicopter.phase(), Phase::SpinningUp | Phase::TakingOff);
        climbs || (self.take_off.awaits_flow_control && self.is_following())
    }

    /// Whether port 10122 reads 1: from the order until the rotor has stopped.
    pub fn is_landing(&self, helicopter: &Helicopter) -> bool {
        matches!(helicopter.phase(), Phase::Landing | Phase::SpinningDown)
    }

    /// Takes off, or will do so after the delay of the firmware; false when it is refused.
    pub(super) fn order_take_off(&mut self, now: Duration, helicopter: &mut Helicopter) -> bool {
        if self.firmware.refuses_take_off_before_start_up && !self.started_up {
            return false;
        }
        // Repeating the order changes nothing.
        if self.take_off.begins_at.is_some() || self.is_taking_off(helicopter) {
            return true;
        }
        if self.firmware.take_off_delay.is_zero() {
            return self.begin_take_off(helicopter);
        }
        let is_possible = helicopter.may_take_off();
        self.take_off.begins_at = is_possible.then(|| now + self.firmware.take_off_delay);
        is_possible
    }

    /// Begins the take-off whose delay is over.
    pub(super) fn begin_late_take_off(&mut self, helicopter: &mut Helicopter) {
        self.take_off.begins_at = None;
        self.begin_take_off(helicopter);
    }

    fn begin_take_off(&mut self, helicopter: &mut Helicopter) -> bool {
        let has_begun = helicopter.take_off().is_ok();
        self.take_off.awaits_flow_control |= has_begun;
        has_begun
    }

    /// Lands; false when it is refused.
    pub(super) fn order_landing(&self, helicopter: &mut Helicopter) -> bool {
        !self.is_taking_off(helicopter) && helicopter.land().is_ok()
    }
}
