//! [`Difference`]: where a core said something else than what was recorded.

use std::fmt;

use ipc_types::MonotonicNs;
use ipc_types::payload::SharedStruct;
use ipc_types::schema::Schema;

/// A core said something else than what was recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// When, by the journal, host monotonic.
    pub at: MonotonicNs,
    /// Where it would have been published, such as `module_state` or `serial/sent`.
    pub topic: String,
    /// The first field that differs, such as `movement.waypoints_sent`; `presence` when one side said nothing.
    pub field: String,
    /// What the recording has.
    pub recorded: String,
    /// What the core said.
    pub replayed: String,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Difference {
            at,
            topic,
            field,
            recorded,
            replayed,
        } = self;
        write!(
            f,
            "{at:?}: {topic}: {field} was {recorded} and is {replayed}"
        )
    }
}

/// What differs between two values, without when and where.
#[derive(Clone, Debug, PartialEq)]
pub struct Values {
    pub field: String,
    pub recorded: String,
    pub replayed: String,
}

/// The first field in which two structs differ; `None` if they are the same bit for bit.
pub fn of_structs<T: SharedStruct>(recorded: &T, replayed: &T) -> Option<Values> {
    let (recorded, replayed) = (recorded.bytes(), replayed.bytes());
    if recorded == replayed {
        return None;
    }
    let schema = Schema::of::<T>();
    for leaf in schema.leaves() {
        for index in 0..leaf.len.unwrap_or(1) {
            let value = |bytes| match leaf.len {
                Some(_) => leaf.element(bytes, index),
                None => leaf.value(bytes),
            };
            let size = leaf.number.size();
            let begin = leaf.offset + index * size;
            if recorded[begin..begin + size] == replayed[begin..begin + size] {
                continue;
            }
            let field = match leaf.len {
                Some(_) => format!("{}[{index}]", leaf.path),
                None => leaf.path.clone(),
            };
            let text = |bytes| value(bytes).map_or_else(String::new, |value| value.to_string());
            return Some(Values {
                field,
                recorded: text(recorded),
                replayed: text(replayed),
            });
        }
    }
    of_bytes(recorded, replayed)
}

/// The first byte in which two texts of bytes differ; `None` if they are the same.
pub fn of_bytes(recorded: &[u8], replayed: &[u8]) -> Option<Values> {
    if recorded == replayed {
        return None;
    }
    let same = recorded
        .iter()
        .zip(replayed)
        .take_while(|(recorded, replayed)| recorded == replayed)
        .count();
    let text = |bytes: &[u8]| match bytes.get(same) {
        Some(byte) => format!("{byte:#04x} (of {} bytes)", bytes.len()),
        None => format!("nothing (of {} bytes)", bytes.len()),
    };
    Some(Values {
        field: format!("byte {same}"),
        recorded: text(recorded),
        replayed: text(replayed),
    })
}

/// One side said something, the other nothing or something else.
pub fn presence(recorded: &str, replayed: &str) -> Values {
    Values {
        field: "presence".to_owned(),
        recorded: recorded.to_owned(),
        replayed: replayed.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::payload::{DspTelemetry, ModuleState};

    use super::*;

    #[test]
    fn the_first_field_that_differs_is_named_with_both_values() {
        let recorded = ModuleState::default();
        let mut replayed = recorded;
        assert_eq!(of_structs(&recorded, &replayed), None);
        replayed.movement.waypoints_sent = 3;
        replayed.safety.interventions = 1;
        let values = of_structs(&recorded, &replayed).unwrap();
        assert_eq!(values.field, "movement.waypoints_sent");
        assert_eq!(
            (values.recorded.as_str(), values.replayed.as_str()),
            ("0", "3")
        );

        let mut replayed = recorded;
        replayed.dsp_errors.known[7] = 2;
        let values = of_structs(&recorded, &replayed).unwrap();
        assert_eq!(values.field, "dsp_errors.known[7]");
    }

    #[test]
    fn bits_differ_where_values_do_not() {
        let recorded = DspTelemetry::default();
        let mut replayed = recorded;
        replayed.geographic.altitude_m = -0.0;
        let values = of_structs(&recorded, &replayed).unwrap();
        assert_eq!(values.field, "geographic.altitude_m");
        assert_eq!(values.replayed, "-0");
    }

    #[test]
    fn bytes_differ_at_a_place_or_in_their_number() {
        assert_eq!(of_bytes(b"abc", b"abc"), None);
        let values = of_bytes(b"abc", b"abd").unwrap();
        assert_eq!(values.field, "byte 2");
        assert_eq!(values.recorded, "0x63 (of 3 bytes)");
        let values = of_bytes(b"abc", b"ab").unwrap();
        assert_eq!(values.replayed, "nothing (of 2 bytes)");
    }
}
