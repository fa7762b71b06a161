//! The commands of the PC (`docs/protocol.md` section 8.2): acknowledged first, then carried out or refused.

use std::time::Duration;

use dsp_protocol::{Command, Downlink, DspErrorCode, Sequence, port};

use crate::helicopter::Helicopter;

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
