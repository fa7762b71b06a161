use ril_tests::stranger::STRANGER;

use super::*;
use crate::ros2::own_schemas;

/// Each value is the one that `rosbags` 0.11 computes from the same text; `tests/ros2` compares them again.
const GOLDEN: [(&str, &str); 9] = [
    (
        "hero_msgs/msg/DspTelemetry",
        "a4ab4412c69e2fa023ee8f72c70baa2446198f1bea75aca1cb974e1664fcdcba",
    ),
    (
        "hero_msgs/msg/HeroTelemetry",
        "c6c48a3341fb9ea07af1a35b80342d23003660102050a6c155374b29f9276533",
    ),
    (
        "hero_msgs/msg/ModuleControl",
        "8cff0aef1d98de723986593aa484166e03b7b7b21e27743acddb0d3cca23ef2f",
    ),
    (
        "hero_msgs/msg/ModuleState",
        "edb748a66da7809a5390299f2844be42ad51a8cddcd902efeca0281210759517",
    ),
    (
        "hero_msgs/msg/MovementData",
        "cbad4a723cf78f1aa4de6402e83b1738aea892b639e7c012eb54dcfdc6d270c3",
    ),
    (
        "hero_msgs/msg/ParameterRequest",
        "1ca17da82eaeff7feed1b58148eddab87f97481c467bdda472be5bac0e12c874",
    ),
    (
        "hero_msgs/msg/RequestReport",
        "9c1c5fc24fa2247e7a313e8689da367ced390d00b192aac34444961f69820dd3",
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
