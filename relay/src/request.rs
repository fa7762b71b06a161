//! [`RequestFields`]: the two fields of a request that a relay reads or writes, whatever its struct is.

use std::time::Duration;

use ipc_types::Schema;
use ipc_types::payload::Number;

use crate::orders::robot::Repeat;

/// Where a request has these fields.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RequestFields {
    /// `uint16 repeat`: 1 asks a server what became of a request that it may have had.
    repeat: Option<usize>,
    /// `uint32 deadline_ms`: within how long the request must have begun, 0 for the server's default.
    deadline_ms: Option<usize>,
}

impl RequestFields {
    /// Those of the requests that `schema` describes.
    pub fn of(schema: &Schema) -> RequestFields {
        let offset = |path: &str, number: Number| {
            let leaf = schema.number(path)?;
            (leaf.number == number && leaf.len.is_none()).then_some(leaf.offset)
        };
        RequestFields {
            repeat: offset("repeat", Number::U16),
            deadline_ms: offset("deadline_ms", Number::U32),
        }
    }

    /// Whether a server can be asked again.
    pub fn repeat(&self) -> Repeat {
        match self.repeat {
            Some(_) => Repeat::Field,
            None => Repeat::None,
        }
    }

    /// Says in the request that it is a repetition.
    pub fn set_repeat(&self, request: &mut [u8]) {
        if let Some(bytes) = self
            .repeat
            .and_then(|offset| request.get_mut(offset..offset + 2))
        {
            bytes.copy_from_slice(&1_u16.to_le_bytes());
        }
    }

    /// The request's own deadline; nothing when it has none.
    pub fn deadline(&self, request: &[u8]) -> Option<Duration> {
        let bytes = request.get(self.deadline_ms?..)?.first_chunk::<4>()?;
        let deadline_ms = u32::from_le_bytes(*bytes);
        (deadline_ms > 0).then(|| Duration::from_millis(deadline_ms.into()))
    }

    /// Gives the request what is left of its deadline, at least 1 ms, because 0 is the server's default.
    pub fn set_deadline(&self, request: &mut [u8], left: Duration) {
        let left_ms = u32::try_from(left.as_millis()).unwrap_or(u32::MAX).max(1);
        if let Some(bytes) = self
            .deadline_ms
            .and_then(|offset| request.get_mut(offset..offset + 4))
        {
            bytes.copy_from_slice(&left_ms.to_le_bytes());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ipc_types::payload::{ModuleControl, MovementData, SharedStruct};

    #[test]
    fn a_movement_can_be_repeated_and_a_control_request_has_a_deadline_alone() {
        let fields = RequestFields::of(&Schema::of::<MovementData>());
        let mut request = MovementData::take_off(7, 10.0).bytes().to_vec();
        assert_eq!(fields.deadline(&request), None);
        fields.set_deadline(&mut request, Duration::from_micros(1_500_900));
        fields.set_repeat(&mut request);
        assert_eq!(fields.deadline(&request), Some(Duration::from_millis(1500)));
        let read = MovementData::from_bytes(&request).unwrap();
        assert_eq!(
            (read.repeat, read.deadline_ms, read.request_id),
            (1, 1500, 7)
        );
        fields.set_deadline(&mut request, Duration::ZERO);
        assert_eq!(fields.deadline(&request), Some(Duration::from_millis(1)));
        assert!(fields.repeat() == Repeat::Field);
        let control = RequestFields::of(&Schema::of::<ModuleControl>());
        assert!(control.repeat() == Repeat::None);
        let before = request.clone();
        control.set_repeat(&mut request);
        assert_eq!(request, before);
        control.set_deadline(&mut [], Duration::ZERO);
        assert_eq!(control.deadline(&[]), None);
    }
}
