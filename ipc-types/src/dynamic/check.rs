//! Whether a service may have a key, and whether a schema is one of the contract's.

use super::error::DynamicError;
use crate::module::{Module as _, OWN_NAMES, RelayModule};
use crate::payload::Number;
use crate::schema::Schema;
use crate::service::{
    EPOCH_OFFSET, Pattern, REQUEST_ID_OFFSET, SEQUENCE_OFFSET, ServiceId, is_key, own,
};

/// The schema of the service `key` by its text.
pub(super) fn parse(key: &str, schema: &str) -> Result<Schema, DynamicError> {
    Schema::parse(schema).map_err(|source| DynamicError::Schema {
        key: key.to_owned(),
        source,
    })
}

/// The process that plays recorded flights to consumers, with the topics of bridge and status.
const REPLAY_PROCESS: &str = "replay";

/// Whether a process may provide the service `key`. The keys of the RIL's own modules belong to the processes of their names, to the
/// relay, which provides those of another machine, and to a replay.
pub(super) fn check_provider(key: &str, process: &str) -> Result<(), DynamicError> {
    let own = OWN_NAMES.iter().find(|own| is_below(key, own));
    match own {
        Some(module) if ![module, RelayModule::NAME, REPLAY_PROCESS].contains(&process) => {
            Err(own_module(key, module))
        }
        _ => Ok(()),
    }
}

fn is_below(key: &str, module: &str) -> bool {
    key.split('/').next() == Some(module)
}

fn own_module(key: &str, module: &'static str) -> DynamicError {
    DynamicError::OwnModule {
        key: key.to_owned(),
        module,
    }
}

/// Whether a service of this pattern, with this layout, may have this key. Those of bridge and status may be opened too, because a
/// relay and a replay provide them; those of the relay are used as structs alone.
pub(super) fn check_key(key: &str, pattern: Pattern, layout_hash: u64) -> Result<(), DynamicError> {
    if is_below(key, RelayModule::NAME) {
        return Err(own_module(key, RelayModule::NAME));
    }
    let Some(own) = own(key).map(ServiceId::contract) else {
        return match is_key(key) && key.contains('/') {
            true => Ok(()),
            false => Err(DynamicError::InvalidKey(key.to_owned())),
        };
    };
    match own.pattern == pattern && own.layout_hash() == layout_hash {
        true => Ok(()),
        false => Err(DynamicError::OwnService {
            key: key.to_owned(),
            expected: own.layout(),
        }),
    }
}

/// Whether samples begin as those of every topic do.
pub(super) fn is_sample(schema: &Schema) -> bool {
    has_number(schema, "sequence", SEQUENCE_OFFSET) && has_number(schema, "epoch_ns", EPOCH_OFFSET)
}

/// Whether requests begin as all of the contract's do.
pub(super) fn is_request(schema: &Schema) -> bool {
    has_number(schema, "request_id", REQUEST_ID_OFFSET)
}

/// Whether there is a `uint64` of this name at this offset.
fn has_number(schema: &Schema, path: &str, offset: usize) -> bool {
    schema.number(path).is_some_and(|leaf| {
        leaf.number == Number::U64 && leaf.len.is_none() && leaf.offset == offset
    })
}
