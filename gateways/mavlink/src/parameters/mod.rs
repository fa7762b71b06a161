//! [`Parameters`]: reads and writes of the DSP's ports that stations have asked for, one at a time.
//!
//! | | idle | reading | writing |
//! |---|---|---|---|
//! | a read is asked for | → reading | waits | waits |
//! | a write is asked for | → writing | waits, before all reads | waits, before all reads |
//! | the bridge has ended it | – | its askers get the value, or an error; → next | all get the value, the asker an error; → next |
//! | nothing comes for [`LIMIT`] | – | as an error; → next | as an error; → next |
//!
//! A write that comes after a newer one of its station, or once more, is answered with the value that there is.
//!
//! A list is a read of each port. So each value that a station gets is one that the DSP had then, and not one that is
//! remembered.

mod names;

use std::collections::VecDeque;
use std::net::SocketAddr;
use std::time::Duration;

use dsp_protocol::port::Port;
use ipc_types::MonotonicNs;
use ipc_types::code::{Reason, Stage};

pub use self::names::{ALL, NAME, ParameterSource, ParameterValue, TAKE_OFF_M};
use crate::commands::{FrameTime, MEMORY};
use crate::event::OrderKind;
use crate::message::{PARAM_ERROR, PARAM_VALUE};
use crate::stations::StationAddress;
use crate::wire::MessageWriter;

/// Most writes that wait: the bridge has as many for all its clients. A further one is refused.
const MAX_WRITES: usize = 8;

/// Most writes by which late frames are known: more than a station sends within [`MEMORY`]. An address may name itself
/// as any number of stations, so the oldest goes; a late copy of that one is written.
const MAX_NEWEST: usize = 256;

/// How long the bridge has for a read or a write: it answers within its own limits, which are shorter. A relay's link
/// may be lost.
const LIMIT: Duration = Duration::from_secs(10);

/// MAV_PARAM_ERROR.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum ParameterError {
    /// No parameter has this name or number.
    DoesNotExist = 1,
    /// The value is too small or too large.
    OutOfRange = 2,
    /// This station may not write it, or not now.
    PermissionDenied = 3,
    /// It can only be read.
    ReadOnly = 5,
    /// The value has another type.
    TypeMismatch = 7,
    /// The DSP does not say which value it has.
    ReadFailed = 8,
}

/// A write that a station has asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Write {
    pub by: StationAddress,
    pub index: usize,
    pub value: ParameterValue,
    pub frame: FrameTime,
}

impl Write {
    /// Whether it is about the same parameter, of the same station.
    fn is_beside(&self, other: &Write) -> bool {
        (self.by, self.index) == (other.by, other.index)
    }

    /// Whether it came after `other`, and is a copy of its frame, or of one that was sent before it.
    fn is_before(&self, other: &Write) -> bool {
        let ahead = self.frame.sequence.wrapping_sub(other.frame.sequence);
        let is_copy = ahead == 0 && self.value.bits() == other.value.bits();
        let is_recent = self.frame.came.since(other.frame.came) < MEMORY;
        is_recent && (ahead.cast_signed() < 0 || is_copy)
    }
}

/// What is with the bridge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Work {
    /// A port is read.
    Read(usize),
    /// A port is written.
    Write(Write),
}

impl Work {
    fn index(&self) -> usize {
        match self {
            Work::Read(index) => *index,
            Work::Write(write) => write.index,
        }
    }

    /// What is asked of the bridge.
    pub fn order(&self) -> Option<OrderKind> {
        let ParameterSource::Port(port) = ALL.get(self.index())?.source else {
            return None;
        };
        let port = match port {
            Port::Bits16(port) => port.number,
            Port::Bits32(port) => port.number,
        };
        Some(match self {
            Work::Read(_) => OrderKind::ReadPort(port),
            Work::Write(write) => OrderKind::WritePort(port, write.value.number()),
        })
    }
}

/// A message for a station, or for all.
#[derive(Clone, Debug, PartialEq)]
pub struct Reply {
    /// `None` if it is for all.
    pub to: Option<SocketAddr>,
    pub message: MessageWriter,
}

#[derive(Clone, Copy, Debug)]
struct InFlight {
    number: u64,
    work: Work,
    until: MonotonicNs,
}

/// Reads and writes of the DSP's ports that stations have asked for, one at a time.
#[derive(Clone, Debug, Default)]
pub struct Parameters {
    /// Who asks for which. None twice, so that there are at most as many as stations have parameters.
    reads: VecDeque<(SocketAddr, usize)>,
    writes: VecDeque<Write>,
    in_flight: Option<InFlight>,
    /// The newest write of each station and parameter within [`MEMORY`], by which frames are known that come late.
    newest: Vec<Write>,
}

impl Parameters {
    /// A station asks for a value.
    pub fn read(&mut self, by: SocketAddr, index: usize) {
        if !self.reads.contains(&(by, index)) {
            self.reads.push_back((by, index));
        }
    }

    /// A station gives a value. A copy of the newest write of that parameter, if it is not done yet, is the same write.
    ///
    /// # Errors
    ///
    /// When too many wait.
    pub fn write(&mut self, write: Write) -> Result<(), ParameterError> {
        let in_flight = match self.in_flight.map(|one| one.work) {
            Some(Work::Write(one)) => Some(one),
            _ => None,
        };
        let mut open = in_flight.iter().chain(&self.writes);
        let newest = open.rfind(|one| one.index == write.index);
        let what = |one: &Write| (one.by, one.value.bits());
        if newest.is_some_and(|newest| what(newest) == what(&write)) {
            return Ok(());
        }
        if self.writes.len() == MAX_WRITES {
            return Err(ParameterError::PermissionDenied);
        }
        self.writes.push_back(write);
        Ok(())
    }

    /// The writes of this parameter that wait are not wanted any more: those who wanted them get the value that holds.
    pub fn replace_writes(&mut self, index: usize) {
        let dropped = self.writes.iter().filter(|one| one.index == index);
        let addresses: Vec<SocketAddr> = dropped.map(|one| one.by.address).collect();
        self.writes.retain(|one| one.index != index);
        for address in addresses {
            self.read(address, index);
        }
    }

    /// Whether a write comes late: its station has sent a newer one of that parameter, or this one before.
    pub fn is_past(&self, write: &Write) -> bool {
        let mut newest = self.newest.iter();
        newest.any(|one| one.is_beside(write) && write.is_before(one))
    }

    /// Notes that a write is the newest one of its station and parameter.
    pub fn note_newest(&mut self, write: Write) {
        let came = write.frame.came;
        self.newest
            .retain(|one| !one.is_beside(&write) && came.since(one.frame.came) < MEMORY);
        if self.newest.len() == MAX_NEWEST {
            self.newest.remove(0);
        }
        self.newest.push(write);
    }

    /// What the bridge is to be asked next, if it has nothing; `number` will name it.
    pub fn next(&mut self, number: u64, now: MonotonicNs) -> Option<Work> {
        if self.in_flight.is_some() {
            return None;
        }
        let work = match self.writes.pop_front() {
            Some(write) => Work::Write(write),
            None => Work::Read(self.reads.front()?.1),
        };
        let until = now + LIMIT;
        self.in_flight = Some(InFlight {
            number,
            work,
            until,
        });
        Some(work)
    }

    /// Whose write is with the bridge.
    pub fn writer(&self) -> Option<StationAddress> {
        match self.in_flight?.work {
            Work::Write(write) => Some(write.by),
            Work::Read(_) => None,
        }
    }

    /// The bridge has reported on `number`, with a value; whether that was asked here, and the answers.
    pub fn report(
        &mut self,
        number: u64,
        (stage, reason): (Stage, Reason),
        value: Option<f64>,
    ) -> Option<Vec<Reply>> {
        let in_flight = self.in_flight.filter(|one| one.number == number)?;
        if !stage.is_final() {
            return Some(Vec::new());
        }
        self.in_flight = None;
        Some(self.end(in_flight.work, (stage, reason), value))
    }

    /// Gives up what the bridge says nothing of.
    pub fn expire(&mut self, now: MonotonicNs) -> Vec<Reply> {
        match self.in_flight.take_if(|one| one.until <= now) {
            Some(late) => self.end(late.work, (Stage::Unknown, Reason::None), None),
            None => Vec::new(),
        }
    }

    fn end(
        &mut self,
        work: Work,
        (stage, reason): (Stage, Reason),
        value: Option<f64>,
    ) -> Vec<Reply> {
        let index = work.index();
        // Other reports give other values: one that is too late by how many seconds.
        let is_of_port = stage == Stage::Done || reason == Reason::RefusedByDsp;
        let value = value.filter(|_| is_of_port);
        let message = match value {
            Some(value) => value_message(index, ALL[index].value(value)),
            None => error_message(index, ParameterError::ReadFailed),
        };
        let mut replies = Vec::new();
        if let Work::Write(write) = work {
            if stage != Stage::Done {
                let error = match reason {
                    Reason::OutOfRange | Reason::NotFinite | Reason::RefusedByDsp => {
                        ParameterError::OutOfRange
                    }
                    Reason::NoSuchPort => ParameterError::DoesNotExist,
                    _ => ParameterError::PermissionDenied,
                };
                let to = Some(write.by.address);
                let message = error_message(index, error);
                replies.push(Reply { to, message });
            }
            match value {
                Some(_) => replies.push(Reply { to: None, message }),
                // QGroundControl reads no errors: it is shown the value that the port has.
                None => self.read(write.by.address, index),
            }
            return replies;
        }
        self.reads.retain(|(by, asked)| {
            let is_answered = *asked == index;
            if is_answered {
                let message = message.clone();
                let to = Some(*by);
                replies.push(Reply { to, message });
            }
            !is_answered
        });
        replies
    }

    /// Forgets what an address has asked for at which no station is any more.
    pub fn forget(&mut self, gone: SocketAddr) {
        self.reads.retain(|(by, _)| *by != gone);
        self.newest.retain(|one| one.by.address != gone);
    }

    /// When [`Parameters::expire`] is to be called.
    pub fn deadline(&self) -> Option<MonotonicNs> {
        self.in_flight.map(|one| one.until)
    }
}

/// Which parameter a station means: its number, or −1 and a name.
pub fn find(index: i16, name: &str) -> Option<usize> {
    match usize::try_from(index) {
        Ok(index) => (index < ALL.len()).then_some(index),
        Err(_) => ALL.iter().position(|one| one.name == name),
    }
}

/// PARAM_VALUE.
pub fn value_message(index: usize, value: ParameterValue) -> MessageWriter {
    MessageWriter::new(PARAM_VALUE)
        .u32(value.bits())
        .u16(ALL.len() as u16)
        .u16(index as u16)
        .text(ALL[index].name, NAME)
        .u8(value.kind())
}

/// PARAM_ERROR of a parameter that there is, without its addressee.
pub fn error_message(index: usize, error: ParameterError) -> MessageWriter {
    error_about(index as i16, ALL[index].name, error)
}

/// PARAM_ERROR of what a station has asked for.
pub fn error_about(index: i16, name: &str, error: ParameterError) -> MessageWriter {
    MessageWriter::new(PARAM_ERROR)
        .i16(index)
        .u8(0)
        .u8(0)
        .text(name, NAME)
        .u8(error as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sender(port: u16) -> StationAddress {
        StationAddress {
            address: ([127, 0, 0, 1], port).into(),
            system: 255,
            component: 190,
        }
    }

    fn write(port: u16, index: usize, value: f32) -> Write {
        Write {
            by: sender(port),
            index,
            value: ParameterValue::Real(value),
            frame: FrameTime::default(),
        }
    }

    fn cruise() -> usize {
        find(-1, "DSP_CRUISE_MPS").unwrap()
    }

    const DONE: (Stage, Reason) = (Stage::Done, Reason::None);
    const NOW: MonotonicNs = MonotonicNs(0);

    /// An address may name itself as 65,536 stations.
    #[test]
    fn the_writes_by_which_late_ones_are_known_are_few_and_forgotten() {
        let mut parameters = Parameters::default();
        let as_station = |number: usize| Write {
            by: StationAddress {
                system: (number / 256) as u8,
                component: (number % 256) as u8,
                ..sender(1)
            },
            ..write(1, cruise(), 5.0)
        };
        let count = 4 * MAX_NEWEST;
        (0..count).for_each(|number| parameters.note_newest(as_station(number)));
        assert_eq!(parameters.newest.len(), MAX_NEWEST);
        let last = as_station(count - 1);
        assert!(parameters.is_past(&last), "a copy of the newest");
        assert!(!parameters.is_past(&as_station(0)), "the oldest went");
        let mut later = as_station(0);
        later.frame.came = NOW + MEMORY;
        parameters.note_newest(later);
        assert_eq!(parameters.newest.len(), 1);
    }

    /// To whom, which message, and the error or the bits of the value.
    fn told(replies: &[Reply]) -> Vec<(Option<u16>, u32, u32)> {
        let told = |reply: &Reply| {
            let payload = reply.message.payload();
            let what = match reply.message.kind {
                PARAM_VALUE => payload.u32(0),
                _ => payload.u8(20).into(),
            };
            let to = reply.to.map(|to| to.port());
            (to, reply.message.kind.id, what)
        };
        replies.iter().map(told).collect()
    }

    #[test]
    fn one_is_with_the_bridge_and_who_asks_the_same_gets_the_same_answer() {
        let mut parameters = Parameters::default();
        let (one, two) = (cruise(), cruise() + 1);
        assert_eq!(parameters.next(1, NOW), None);
        for port in [1, 2, 1] {
            parameters.read(sender(port).address, one);
        }
        parameters.read(sender(1).address, two);
        assert_eq!(parameters.next(1, NOW), Some(Work::Read(one)));
        assert_eq!(parameters.next(2, NOW), None);
        assert_eq!(parameters.report(9, DONE, None), None, "another order");
        let accepted = (Stage::Accepted, Reason::None);
        assert_eq!(parameters.report(1, accepted, None), Some(Vec::new()));
        let replies = parameters.report(1, DONE, Some(5.0)).unwrap();
        let five = 5_f32.to_bits();
        assert_eq!(told(&replies), [(Some(1), 22, five), (Some(2), 22, five)]);
        // A write comes first.
        parameters.write(write(2, one, 7.0)).unwrap();
        assert_eq!(
            parameters.next(2, NOW),
            Some(Work::Write(write(2, one, 7.0)))
        );
        parameters.write(write(2, one, 7.0)).unwrap();
        let replies = parameters.report(2, DONE, Some(7.0)).unwrap();
        assert_eq!(told(&replies), [(None, 22, 7_f32.to_bits())]);
        assert_eq!(parameters.next(3, NOW), Some(Work::Read(two)));
        // Nothing comes.
        assert_eq!(parameters.expire(NOW), []);
        let late = parameters.deadline().unwrap();
        assert_eq!(told(&parameters.expire(late)), [(Some(1), 345, 8)]);
        assert_eq!(parameters.next(4, late), None);
        assert_eq!(parameters.report(3, DONE, Some(1.0)), None, "too late");
    }

    #[test]
    fn a_write_that_is_refused_is_an_error_and_the_value_that_the_port_has() {
        let cases = [
            (Reason::RefusedByDsp, Some(5.0), 2),
            (Reason::NotInControl, None, 3),
            (Reason::NotInFlight, None, 3),
            (Reason::LinkDown, None, 3),
            (Reason::NoSuchPort, None, 1),
            // By how many seconds it was late.
            (Reason::TooLate, Some(0.5), 3),
        ];
        for (reason, found, error) in cases {
            let mut parameters = Parameters::default();
            parameters.write(write(1, cruise(), 7.0)).unwrap();
            assert!(parameters.next(1, NOW).is_some());
            let refused = (Stage::Refused, reason);
            let replies = parameters.report(1, refused, found).unwrap();
            assert_eq!(told(&replies)[0], (Some(1), 345, error), "{reason}");
            match found.filter(|_| reason != Reason::TooLate) {
                Some(_) => assert_eq!(replies.len(), 2),
                None => assert_eq!(parameters.next(2, NOW), Some(Work::Read(cruise()))),
            }
        }
    }

    #[test]
    fn the_value_that_was_given_last_is_written_last() {
        let mut parameters = Parameters::default();
        for value in [7.0, 8.0, 8.0, 7.0, 7.0] {
            parameters.write(write(1, cruise(), value)).unwrap();
            if value == 7.0 {
                let _ = parameters.next(1, NOW);
            }
        }
        let mut written = vec![7.0];
        while parameters.report(1, DONE, Some(1.0)).is_some() {
            if let Some(Work::Write(write)) = parameters.next(1, NOW) {
                written.push(write.value.number());
            }
        }
        assert_eq!(written, [7.0, 8.0, 7.0]);
    }

    #[test]
    fn eight_writes_wait_and_a_station_that_is_gone_waits_for_nothing() {
        let mut parameters = Parameters::default();
        for value in 0..8_u8 {
            parameters
                .write(write(1, cruise(), f32::from(value)))
                .unwrap();
        }
        let ninth = parameters.write(write(1, cruise(), 9.0));
        assert_eq!(ninth, Err(ParameterError::PermissionDenied));
        let mut parameters = Parameters::default();
        for index in 0..ALL.len() {
            parameters.read(sender(1).address, index);
            parameters.read(sender(1).address, index);
        }
        assert_eq!(parameters.reads.len(), ALL.len());
        parameters.forget(sender(1).address);
        assert_eq!(parameters.next(1, NOW), None);
    }
}
