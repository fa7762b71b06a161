//! [`RequestFields`]: the fields of a request that a relay reads or writes, whatever its struct is.

use ipc_types::code::{ControlCommand, MovementKind};
use ipc_types::payload::{ModuleControl, MovementData, Number, SharedStruct};
use ipc_types::{MonotonicNs, Schema};

use crate::orders::robot::Traits;

/// Where a request has these fields.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RequestFields {
    /// `uint64 path_id`: which path the request belongs to, 0 for none.
    path_id: Option<usize>,
    /// `uint16 repeat`: 1 asks a server what became of a request that it may have had.
    repeat: Option<usize>,
    /// `uint64 issued_ns`: when the order was issued, 0 when it does not say.
    issued: Option<usize>,
    /// `uint64 begin_by_ns`: until when it may begin, 0 for the server's default.
    begin_by: Option<usize>,
    /// `uint32 issued_within_ns`: by how much later it may have been issued.
    issued_within: Option<usize>,
    /// `uint32 origin`: by which clock it was issued.
    origin: Option<usize>,
    /// `uint32`: what is to be done, and the two codes that end a movement.
    what: Option<(usize, [u32; 2])>,
}

impl RequestFields {
    /// The fields of the requests that `schema` describes.
    pub fn of(schema: &Schema) -> RequestFields {
        let offset = |path, number| schema.offset_of(path, number);
        let what = if schema.type_name() == MovementData::TYPE_NAME {
            let ends = [MovementKind::Hold.code(), MovementKind::Land.code()];
            offset("kind", Number::U32).zip(Some(ends))
        } else if schema.type_name() == ModuleControl::TYPE_NAME {
            offset("command", Number::U32).zip(Some([ControlCommand::Stop.code(); 2]))
        } else {
            None
        };
        RequestFields {
            path_id: offset("path_id", Number::U64),
            repeat: offset("repeat", Number::U16),
            issued: offset("issued_ns", Number::U64),
            begin_by: offset("begin_by_ns", Number::U64),
            issued_within: offset("issued_within_ns", Number::U32),
            origin: offset("origin", Number::U32),
            what,
        }
    }

    /// What is to be known of a request before it is handed on.
    pub fn traits(&self, request: &[u8]) -> Traits {
        let code = self.what.zip(self.what.and_then(|(offset, _)| {
            let bytes = request.get(offset..)?.first_chunk()?;
            Some(u32::from_le_bytes(*bytes))
        }));
        Traits {
            is_repeatable: self.repeat.is_some(),
            ends_movement: code.is_some_and(|((_, ends), code)| ends.contains(&code)),
        }
    }

    /// Path of the request; 0 if it has none.
    pub fn path_id(&self, request: &[u8]) -> u64 {
        let word = self.path_id.and_then(|offset| word(request, offset));
        word.unwrap_or_default()
    }

    /// Says in the request that it is a repetition.
    pub fn set_repeat(&self, request: &mut [u8]) {
        write(request, self.repeat, &1_u16.to_le_bytes());
    }

    /// When the order was issued. `None` if it does not say.
    pub fn issued(&self, request: &[u8]) -> Option<MonotonicNs> {
        moment(request, self.issued)
    }

    /// Says when the order was issued, and by how much later it may have been.
    pub fn set_issued(&self, request: &mut [u8], at: MonotonicNs, within_ns: u32) {
        write(request, self.issued, &at.0.to_le_bytes());
        write(request, self.issued_within, &within_ns.to_le_bytes());
    }

    /// Says by which clock the order was issued, in a request that says when it was.
    pub fn set_origin(&self, request: &mut [u8], origin: u32) {
        let place = self.origin.filter(|_| self.issued.is_some());
        write(request, place, &origin.to_le_bytes());
    }

    /// Until when the request may begin. `None` if it does not say.
    pub fn begin_by(&self, request: &[u8]) -> Option<MonotonicNs> {
        moment(request, self.begin_by)
    }

    /// Says until when the request may begin.
    pub fn set_begin_by(&self, request: &mut [u8], at: MonotonicNs) {
        write(request, self.begin_by, &at.0.to_le_bytes());
    }
}

fn moment(request: &[u8], offset: Option<usize>) -> Option<MonotonicNs> {
    word(request, offset?)
        .filter(|word| *word > 0)
        .map(MonotonicNs)
}

/// The eight bytes at `offset` as a number. `None` if there are fewer.
pub fn word(bytes: &[u8], offset: usize) -> Option<u64> {
    let word = bytes.get(offset..)?.first_chunk()?;
    Some(u64::from_le_bytes(*word))
}

fn write(request: &mut [u8], offset: Option<usize>, value: &[u8]) {
    let place = offset.and_then(|offset| request.get_mut(offset..offset + value.len()));
    if let Some(place) = place {
        place.copy_from_slice(value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOME: MonotonicNs = MonotonicNs(7_000);
    const LATER: MonotonicNs = MonotonicNs(8_000);

    #[test]
    fn a_movement_says_when_it_was_issued_and_until_when_it_may_begin() {
        let fields = RequestFields::of(&Schema::of::<MovementData>());
        let movement = MovementData {
            issued_ns: 0,
            ..MovementData::take_off(7, 10.0).following(6)
        };
        let mut request = movement.bytes().to_vec();
        assert_eq!(fields.issued(&request), None);
        assert_eq!(fields.begin_by(&request), None);
        fields.set_issued(&mut request, SOME, 9);
        fields.set_origin(&mut request, 5);
        fields.set_begin_by(&mut request, LATER);
        fields.set_repeat(&mut request);
        assert_eq!(fields.issued(&request), Some(SOME));
        assert_eq!(fields.begin_by(&request), Some(LATER));
        assert_eq!(fields.path_id(&request), movement.path_id);
        let expected = MovementData {
            issued_ns: 7_000,
            begin_by_ns: 8_000,
            issued_within_ns: 9,
            origin: 5,
            repeat: 1,
            ..movement
        };
        assert_eq!(MovementData::from_bytes(&request), Some(expected));
    }

    #[test]
    fn a_control_request_cannot_be_repeated_and_too_few_bytes_change_nothing() {
        let control = RequestFields::of(&Schema::of::<ModuleControl>());
        let request = ModuleControl::new(7, ControlCommand::Start);
        let mut bytes = request.bytes().to_vec();
        control.set_repeat(&mut bytes);
        assert_eq!(bytes, request.bytes());
        assert!(!control.traits(&bytes).is_repeatable);
        control.set_issued(&mut [], SOME, 9);
        control.set_origin(&mut [], 5);
        control.set_begin_by(&mut [0; 12], SOME);
        assert_eq!(control.issued(&[]), None);
        assert!(!control.traits(&[]).ends_movement);
        assert_eq!((control.path_id(&bytes), control.path_id(&[])), (0, 0));
        assert_eq!(word(&[0; 8], usize::MAX), None);
    }

    #[test]
    fn a_hold_a_landing_and_a_stop_end_movements() {
        let movements = RequestFields::of(&Schema::of::<MovementData>());
        let ends = |request: &MovementData| movements.traits(request.bytes()).ends_movement;
        assert!(ends(&MovementData::hold(7)) && ends(&MovementData::land(7)));
        assert!(!ends(&MovementData::take_off(7, 10.0)));
        let control = RequestFields::of(&Schema::of::<ModuleControl>());
        for command in [
            ControlCommand::Start,
            ControlCommand::Stop,
            ControlCommand::ReloadFence,
        ] {
            let request = ModuleControl::new(7, command);
            let is_stop = command == ControlCommand::Stop;
            assert_eq!(control.traits(request.bytes()).ends_movement, is_stop);
        }
    }
}
