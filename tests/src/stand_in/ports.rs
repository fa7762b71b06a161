//! [`PortTable`]: the virtual ports of the DSP behind a [`StandInBridge`](super::StandInBridge), in memory.

use dsp_protocol::port::{self, Access, Port16, Port32};
use ipc_types::code::{ParameterOperation, PortKind, Reason, Stage};
use ipc_types::payload::{ParameterRequest, PortInfo, RequestReport};

/// A virtual port, its value, and what the DSP does when it is written.
#[derive(Clone, Debug, PartialEq)]
pub struct StandInPort {
    /// Number of the port.
    pub number: u16,
    /// Its name, of up to 32 ASCII letters.
    pub name: String,
    /// How the value is coded.
    pub kind: PortKind,
    /// Least and greatest value that may be written.
    pub range: (f64, f64),
    /// Whether a request may write it.
    pub writable: bool,
    /// Whether a request may write it while the helicopter flies.
    pub writable_in_flight: bool,
    /// The value that the DSP has.
    pub value: f64,
    /// The DSP refuses to take a value with this error.
    pub refuses_with: Option<u16>,
}

impl StandInPort {
    fn of_16(port: &Port16) -> StandInPort {
        StandInPort {
            number: port.number,
            name: port.name.to_owned(),
            kind: if port.signed {
                PortKind::I16
            } else {
                PortKind::U16
            },
            range: (port.min.into(), port.max.into()),
            writable: port.access != Access::Bridge,
            writable_in_flight: port.access == Access::Always,
            value: port.boot.into(),
            refuses_with: None,
        }
    }

    fn of_32(port: &Port32) -> StandInPort {
        StandInPort {
            number: port.number,
            name: port.name.to_owned(),
            kind: PortKind::F32,
            range: (port.min.into(), port.max.into()),
            writable: port.access != Access::Bridge,
            writable_in_flight: port.access == Access::Always,
            value: port.boot.into(),
            refuses_with: None,
        }
    }

    fn info(&self, count: u32) -> PortInfo {
        let writable = u32::from(self.writable) * PortInfo::WRITABLE;
        let in_flight = u32::from(self.writable_in_flight) * PortInfo::WRITABLE_IN_FLIGHT;
        PortInfo {
            min: self.range.0,
            max: self.range.1,
            number: self.number.into(),
            kind: self.kind.code(),
            access: writable | in_flight,
            count,
            name: PortInfo::name_bytes(&self.name),
        }
    }

    /// Why `value` may not be written.
    fn refusal(&self, value: f64, is_flying: bool) -> Option<Reason> {
        let is_whole = self.kind == PortKind::F32 || value.fract() == 0.0;
        if !self.writable {
            Some(Reason::NoSuchPort)
        } else if !value.is_finite() {
            Some(Reason::NotFinite)
        } else if !(self.range.0..=self.range.1).contains(&value) || !is_whole {
            Some(Reason::OutOfRange)
        } else if is_flying && !self.writable_in_flight {
            Some(Reason::NotInFlight)
        } else if self.refuses_with.is_some() {
            Some(Reason::RefusedByDsp)
        } else {
            None
        }
    }
}

/// The ports of a DSP, in ascending order of their numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct PortTable {
    ports: Vec<StandInPort>,
    is_flying: bool,
}

impl Default for PortTable {
    /// The ports of `docs/protocol.md` with the values that they have when the DSP boots.
    fn default() -> PortTable {
        let bits16 = port::PORTS_16.iter().map(StandInPort::of_16);
        let bits32 = port::PORTS_32.iter().map(StandInPort::of_32);
        PortTable {
            ports: bits16.chain(bits32).collect(),
            is_flying: false,
        }
    }
}

impl PortTable {
    /// The port with this number.
    pub fn port(&self, number: u16) -> Option<&StandInPort> {
        self.ports.iter().find(|port| port.number == number)
    }

    /// Adds `port`, or puts it in the place of the one with its number.
    pub fn set(&mut self, port: StandInPort) {
        self.ports.retain(|other| other.number != port.number);
        let place = self
            .ports
            .partition_point(|other| other.number < port.number);
        self.ports.insert(place, port);
    }

    /// Whether the helicopter flies, so that some ports may not be written.
    pub fn set_flying(&mut self, is_flying: bool) {
        self.is_flying = is_flying;
    }

    /// Carries `request` out, and gives the final report about it.
    pub fn answer(&mut self, request: &ParameterRequest) -> RequestReport {
        let count = self.ports.len() as u32;
        let operation = request.operation();
        let place = match operation {
            None => return refused(Reason::InvalidRequest),
            Some(ParameterOperation::List) => usize::try_from(request.port).ok(),
            Some(ParameterOperation::Read | ParameterOperation::Write) => self
                .ports
                .iter()
                .position(|port| u32::from(port.number) == request.port),
        };
        let Some(port) = place.and_then(|place| self.ports.get_mut(place)) else {
            return refused(Reason::NoSuchPort);
        };
        let info = port.info(count);
        if operation == Some(ParameterOperation::Write) {
            if let Some(reason) = port.refusal(request.value, self.is_flying) {
                let error = port.refuses_with.filter(|_| reason == Reason::RefusedByDsp);
                return RequestReport {
                    port: info,
                    dsp_error_code: error.unwrap_or_default().into(),
                    dsp_error_valid: error.is_some().into(),
                    ..refused(reason)
                };
            }
            port.value = match port.kind {
                PortKind::F32 => f64::from(request.value as f32),
                PortKind::U16 | PortKind::I16 => request.value,
            };
        }
        let is_listed = operation == Some(ParameterOperation::List);
        RequestReport {
            port: info,
            value: if is_listed { 0.0 } else { port.value },
            value_valid: u16::from(!is_listed),
            ..RequestReport::new(Stage::Done, Reason::None)
        }
    }
}

fn refused(reason: Reason) -> RequestReport {
    RequestReport::new(Stage::Refused, reason)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(table: &mut PortTable, number: u16, value: f64) -> RequestReport {
        table.answer(&ParameterRequest::write(1, number, value))
    }

    #[test]
    fn the_list_names_every_port_once_and_ends_with_its_count() {
        let mut table = PortTable::default();
        let first = table.answer(&ParameterRequest::list(1, 0));
        let count = first.port.count;
        let numbers: Vec<u32> = (0..count)
            .map(|index| table.answer(&ParameterRequest::list(1, index)))
            .map(|report| {
                assert_eq!((report.stage(), report.value()), (Some(Stage::Done), None));
                report.port.number
            })
            .collect();
        assert!(numbers.is_sorted() && numbers.len() > 10, "{numbers:?}");
        let beyond = table.answer(&ParameterRequest::list(1, count));
        assert_eq!(beyond.reason(), Some(Reason::NoSuchPort));
    }

    #[test]
    fn a_value_that_was_written_is_read_back() {
        let mut table = PortTable::default();
        for (number, value) in [(port::CRUISE_SPEED_MPS, 7.5), (port::TRIM_TAIL_US, -40.0)] {
            for report in [
                write(&mut table, number, value),
                table.answer(&ParameterRequest::read(1, number)),
            ] {
                assert_eq!(report.stage(), Some(Stage::Done));
                assert_eq!(report.value(), Some(value));
                assert_eq!(report.port.number, u32::from(number));
            }
            assert_eq!(table.port(number).map(|port| port.value), Some(value));
        }
    }

    #[test]
    fn what_may_not_be_written_is_refused_with_the_reason_and_changes_nothing() {
        let mut table = PortTable::default();
        table.set(StandInPort {
            refuses_with: Some(30),
            ..table.port(port::YAW_GAIN).unwrap().clone()
        });
        table.set_flying(true);
        let before = table.clone();
        for (number, value, reason) in [
            (1, 0.0, Reason::NoSuchPort),
            (port::TAKE_OFF, 1.0, Reason::NoSuchPort),
            (port::CRUISE_SPEED_MPS, f64::NAN, Reason::NotFinite),
            (port::CRUISE_SPEED_MPS, 21.0, Reason::OutOfRange),
            (port::STATUS_PERIOD_MS, 20.5, Reason::OutOfRange),
            (port::TRIM_TAIL_US, 1.0, Reason::NotInFlight),
            (port::YAW_GAIN, 1.0, Reason::NotInFlight),
        ] {
            let report = write(&mut table, number, value);
            assert_eq!(report.stage(), Some(Stage::Refused));
            assert_eq!(report.reason(), Some(reason), "{number}");
            assert_eq!(report.dsp_error(), None);
        }
        assert_eq!(table, before);
        table.set_flying(false);
        let report = write(&mut table, port::YAW_GAIN, 1.0);
        assert_eq!(report.reason(), Some(Reason::RefusedByDsp));
        assert_eq!(report.dsp_error(), Some(30));
    }
}
