//! Hashes of types: RIHS01, the first version of the ROS interface hash (REP-2011).
//!
//! The hash is the SHA-256 of a description of the type in JSON, byte by byte as Python's `json.dumps` writes it: names
//! of structs and fields, types and lengths of arrays, and all nested structs in the order of their names. Comments,
//! units and the version of our layouts are not part of it.

use std::collections::BTreeMap;
use std::fmt::Write;

use ipc_types::payload::Number;
use ipc_types::schema::{Field, Kind, Message, Schema};
use sha2::{Digest, Sha256};

/// Number of a nested type in a type description.
const NESTED_TYPE: u32 = 1;

/// Distance from the number of a type to the number of an array of it with fixed length.
const ARRAY: u32 = 48;

/// The hash of a schema's type in ROS 2, such as `RIHS01_` with 64 hexadecimal digits.
///
/// The names in a schema are identifiers in ASCII, so that nothing in the JSON needs an escape.
pub fn type_hash(schema: &Schema) -> String {
    let mut nested = BTreeMap::new();
    collect(schema.root(), &mut nested);
    let root = description(schema.root());
    let nested: Vec<String> = nested.values().map(|nested| description(nested)).collect();
    let text = format!(
        r#"{{"type_description": {root}, "referenced_type_descriptions": [{}]}}"#,
        nested.join(", ")
    );
    let mut hash = String::from("RIHS01_");
    for byte in Sha256::digest(text.as_bytes()) {
        // Writing to a string cannot fail.
        let _ = write!(hash, "{byte:02x}");
    }
    hash
}

/// Full name of a struct in ROS 2, such as `hero_msgs/msg/HeroGeodetic`.
pub(super) fn full_name(message: &Message) -> String {
    format!("{}/msg/{}", message.package, message.name)
}

/// The structs that `message` contains, by their full names. A schema bounds the depth.
fn collect<'a>(message: &'a Message, nested: &mut BTreeMap<String, &'a Message>) {
    for field in &message.fields {
        if let Kind::Struct(inner) = &field.kind
            && nested.insert(full_name(inner), inner).is_none()
        {
            collect(inner, nested);
        }
    }
}

fn description(message: &Message) -> String {
    let fields: Vec<String> = message.fields.iter().map(field_description).collect();
    format!(
        r#"{{"type_name": "{}", "fields": [{}]}}"#,
        full_name(message),
        fields.join(", ")
    )
}

fn field_description(field: &Field) -> String {
    let (mut type_id, nested) = match &field.kind {
        Kind::Number(number) => (number_id(*number), String::new()),
        Kind::Struct(inner) => (NESTED_TYPE, full_name(inner)),
    };
    if field.len.is_some() {
        type_id += ARRAY;
    }
    format!(
        r#"{{"name": "{}", "type": {{"type_id": {type_id}, "capacity": {}, "string_capacity": 0, "nested_type_name": "{nested}"}}}}"#,
        field.name,
        field.len.unwrap_or(0)
    )
}

/// Number of the type in `type_description_interfaces/msg/FieldType`.
const fn number_id(number: Number) -> u32 {
    match number {
        Number::I8 => 2,
        Number::U8 => 3,
        Number::I16 => 4,
        Number::U16 => 5,
        Number::I32 => 6,
        Number::U32 => 7,
        Number::I64 => 8,
        Number::U64 => 9,
        Number::F32 => 10,
        Number::F64 => 11,
    }
}

#[cfg(test)]
mod tests {
    use ril_tests::stranger::STRANGER;

    use super::*;
    use crate::ros2::own_schemas;

    /// Each value is the one that `rosbags` 0.11 computes from the same text; `tests/ros2` compares them again.
    const GOLDEN: [(&str, &str); 9] = [
        (
            "hero_msgs/msg/DspTelemetry",
            "c701682abdfd742183138fbee6015e45f13415f8659ef56d951f308832597052",
        ),
        (
            "hero_msgs/msg/HeroTelemetry",
            "3a93c2a3a6bc3d94d5f96c9010e976f34f27d1bbd78f7e3ed9f97daaddbc55a5",
        ),
        (
            "hero_msgs/msg/ModuleControl",
            "79354edf43cc804dc03a09ba1d364a09d54b2bdf151cd7c15c90c300d33583bb",
        ),
        (
            "hero_msgs/msg/ModuleState",
            "e50419d8de7e59cc39823c99c468f9eb20cc8d6bad1115d37b2f4d58cc090b77",
        ),
        (
            "hero_msgs/msg/MovementData",
            "57e67f9e1071174b0f007f95cea94b23c2895679495ad415b9608c8d06468287",
        ),
        (
            "hero_msgs/msg/ParameterRequest",
            "da6daf1f82718d94bd38882d99bd913bed0178c89e5ddd785a38ea6ccaf70015",
        ),
        (
            "hero_msgs/msg/RequestReport",
            "ff8096a82a8d69cedef0e47b1aa6b8f4773310cf4541243a1a1304a2a904e4dd",
        ),
        (
            "module_msgs/msg/State",
            "61c46cdee93fea2d4d7fc2b5e955b43ecfd6adfa5c34c9ec1fa21cb7b9093791",
        ),
        (
            "battery_watch_msgs/msg/Battery",
            "be5111469f17f0552332f1c3e013ad83709b8ea224ad42b35590b29a8919c26b",
        ),
    ];

    #[test]
    fn hashes_are_those_of_another_implementation() {
        let mut schemas = own_schemas();
        schemas.push(Schema::parse(STRANGER).unwrap());
        let hashes: Vec<_> = schemas
            .iter()
            .map(|schema| (schema.ros_resource_name(), type_hash(schema)))
            .collect();
        let golden = GOLDEN.map(|(name, hash)| (name.to_owned(), format!("RIHS01_{hash}")));
        assert_eq!(hashes, golden);
    }

    #[test]
    fn comments_do_not_change_a_hash_and_names_do() {
        let hash = |text: &str| type_hash(&Schema::parse(text).unwrap());
        let commented = STRANGER.replace("uint64 sequence", "# Counts.\nuint64 sequence");
        assert_eq!(hash(&commented), hash(STRANGER));
        let renamed = STRANGER.replace("age_s", "age_ms");
        assert_ne!(hash(&renamed), hash(STRANGER));
    }
}
