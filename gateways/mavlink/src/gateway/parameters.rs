//! What stations ask about parameters.

use ipc_types::MonotonicNs;
use ipc_types::code::{Reason, Stage};

use super::Gateway;
use crate::commands::{FrameTime, Subject};
use crate::event::{Event, Order};
use crate::number::MavSeverity;
use crate::parameters::{
    ALL, ParameterError, ParameterSource, ParameterValue, Reply, Work, Write, error_about,
    error_message, find, value_message,
};
use crate::received::ParameterQuery;
use crate::stations::StationAddress;

/// The parameter that DO_CHANGE_SPEED sets, too.
const SPEED: &str = "DSP_CRUISE_MPS";

impl Gateway {
    /// Only a station gets values: an address that has sent one small message is not sent many.
    pub(super) fn parameter(
        &mut self,
        sender: StationAddress,
        is_station: bool,
        asked: &ParameterQuery,
        now: MonotonicNs,
    ) {
        if !is_station {
            let why = self.not_permitted(sender, is_station);
            let text = why.map_or("", |(_, text)| text);
            // After a restart of the gateway it may be a station whose next heartbeat is on its way.
            if let ParameterQuery::Set { name, .. } = asked {
                let error = error_about(-1, name, ParameterError::PermissionDenied);
                self.send(sender.address, &error);
            }
            return self.tell(sender, MavSeverity::Error, text, now);
        }
        match *asked {
            ParameterQuery::List => {
                (0..ALL.len()).for_each(|index| self.read_parameter(sender, index))
            }
            ParameterQuery::Read { index, name } => match find(index, &name) {
                Some(index) => self.read_parameter(sender, index),
                None => {
                    let error = error_about(index, &name, ParameterError::DoesNotExist);
                    self.send(sender.address, &error);
                }
            },
            ParameterQuery::Set { name, bits, kind } => match find(-1, &name) {
                Some(index) => {
                    self.set_parameter(sender, index, ParameterValue::of(kind, bits), now)
                }
                None => {
                    let error = error_about(-1, &name, ParameterError::DoesNotExist);
                    self.send(sender.address, &error);
                    let text = format!("{name}: there is no such parameter");
                    self.tell(sender, MavSeverity::Error, &text, now);
                }
            },
        }
    }

    fn read_parameter(&mut self, sender: StationAddress, index: usize) {
        match ALL[index].source {
            ParameterSource::Port(_) => self.parameters.read(sender.address, index),
            ParameterSource::TakeOff => {
                let height = ALL[index].value(self.settings.take_off_m);
                self.send(sender.address, &value_message(index, height));
            }
            ParameterSource::Fixed(value) => {
                self.send(sender.address, &value_message(index, value))
            }
        }
    }

    /// A command sets the speed: what waits to set it is older. Who wanted that gets the value that holds.
    pub(super) fn replace_speed_writes(&mut self) {
        if let Some(index) = find(-1, SPEED) {
            self.parameters.replace_writes(index);
        }
    }

    fn set_parameter(
        &mut self,
        sender: StationAddress,
        index: usize,
        value: Option<ParameterValue>,
        now: MonotonicNs,
    ) {
        let parameter = ALL[index];
        let value = value.filter(|value| value.kind() == parameter.kind());
        let refused = match (self.not_permitted(sender, true), value, parameter.range()) {
            (Some((_, why)), ..) => Err((ParameterError::PermissionDenied, why.to_owned())),
            _ if self.age_of_frame(now).is_some() => {
                let text = "it came too long ago; repeat it".to_owned();
                Err((ParameterError::PermissionDenied, text))
            }
            (_, _, None) => Err((ParameterError::ReadOnly, "it can only be read".to_owned())),
            (_, None, _) => {
                let kind = match parameter.kind() {
                    9 => "REAL32",
                    _ => "INT32",
                };
                let text = format!("its type is {kind}, and that of the value is another one");
                Err((ParameterError::TypeMismatch, text))
            }
            (_, Some(value), Some((min, max))) if !(min..=max).contains(&value.number()) => {
                let text = {
                    let (min, max) = (parameter.value(min), parameter.value(max));
                    format!("{value} is not from {min} to {max}")
                };
                Err((ParameterError::OutOfRange, text))
            }
            (_, Some(value), _) => Ok(value),
        };
        let (frame, sets_speed) = (self.frame, parameter.name == SPEED);
        let write = |value| Write {
            by: sender,
            index,
            value,
            frame,
        };
        if let Ok(write) = refused.as_ref().map(|value| write(*value)) {
            let is_outdated =
                sets_speed && (self.commands).is_outdated(Some(sender), Subject::Speed, frame);
            if is_outdated || self.parameters.is_past(&write) {
                return self.read_parameter(sender, index);
            }
            self.parameters.note_newest(write);
        }
        let taken = refused.and_then(|value| {
            if parameter.source == ParameterSource::TakeOff {
                self.settings.take_off_m = value.number();
                return Ok(Some(value));
            }
            if sets_speed {
                self.commands
                    .order(Some(sender), Subject::Speed, false, frame);
            }
            let taken = self.parameters.write(write(value)).map(|()| None);
            taken.map_err(|error| (error, "too many writes are waiting".to_owned()))
        });
        match taken {
            Ok(Some(value)) => {
                self.reply(&Reply {
                    to: None,
                    message: value_message(index, value),
                });
                let text = format!("{} = {value} by {sender}", parameter.name);
                self.note(Event::Commanded(text));
            }
            Ok(None) => {}
            Err((error, why)) => {
                self.send(sender.address, &error_message(index, error));
                let text = format!("{} was not set: {why}", parameter.name);
                self.tell(sender, MavSeverity::Error, &text, now);
                // For stations that read no errors.
                self.read_parameter(sender, index);
            }
        }
    }

    fn reply(&mut self, reply: &Reply) {
        let to = match reply.to {
            Some(address) => vec![address],
            None => self.stations.addresses(),
        };
        for address in to {
            self.send(address, &reply.message);
        }
    }

    /// Gives up what takes too long, and asks the bridge for the next one.
    pub(super) fn advance_parameters(&mut self, now: MonotonicNs) {
        for reply in self.parameters.expire(now) {
            self.reply(&reply);
        }
        let number = self.last_number + 1;
        let Some(work) = self.parameters.next(number, now) else {
            return;
        };
        let Some(kind) = work.order() else {
            return;
        };
        self.last_number = number;
        let (issued, begin_by) = match work {
            Work::Read(_) => (now, None),
            Work::Write(write) => {
                let Write {
                    by,
                    index,
                    value,
                    frame: FrameTime { came, .. },
                } = write;
                let text = format!("{} = {value} by {by}", ALL[index].name);
                self.note(Event::Commanded(text));
                (came, Some(came + self.settings.answer_within))
            }
        };
        self.orders.push_back(Order {
            number,
            kind,
            issued,
            begin_by,
            preempts: false,
            after: 0,
        });
    }

    /// Whether a report was on a parameter; the askers get their answer.
    pub(super) fn parameter_report(
        &mut self,
        number: u64,
        (stage, reason): (Stage, Reason),
        value: Option<f64>,
        words: &str,
        now: MonotonicNs,
    ) -> bool {
        let writer = self.parameters.writer();
        let Some(replies) = self.parameters.report(number, (stage, reason), value) else {
            return false;
        };
        for reply in &replies {
            self.reply(reply);
        }
        if let Some(sender) = writer.filter(|_| stage.is_final() && stage != Stage::Done) {
            self.tell(sender, MavSeverity::Error, words, now);
        }
        // The next one is asked for at once, also when this one could not be sent.
        self.advance_parameters(now);
        true
    }
}
