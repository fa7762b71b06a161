use std::fmt::Write;
use std::fs;

use proptest::prelude::*;

use super::*;
use crate::module::State;
use crate::payload::{
    BridgeOutline, DspTelemetry, FieldKind, HeroTelemetry, Layout, MAX_PAYLOAD_SIZE, MAX_STATIONS,
    ModuleControl, ModuleState, MovementData, ParameterRequest, RelayLink, RelayStations,
    RequestReport, SharedStruct,
};
use crate::service::SERVICES;

mod stranger {
    #![allow(unsafe_code)]

    crate::shared_struct! {
        /// One cell of a battery.
        pub struct Cell("battery_watch.Cell.v1") = 12 {
            /// Voltage under load.
            pub voltage_v: f32,
            /// Temperature at the middle of the cell [degC].
            pub temperature: f32,
            pub age: u16,
            /// Always zero.
            pub reserved: [i8; 2],
        }
    }

    crate::shared_struct! {
        /// The flight battery, see [`Cell`](Cell).
        ///
        /// Made by `battery_watch`.
        pub struct Battery("battery_watch.Battery.v3") = 72 {
            /// Counts the samples of this publisher from 1.
            pub sequence: u64,
            /// When the publisher began,
            /// host monotonic ns.
            pub epoch_ns: u64,
            /// Into the battery is positive, in [-80, 80].
            pub charge_rate: f64,
            /// From the negative pole.
            pub cells: [Cell; 3],
            /// Of the whole battery.
            pub whole: Cell,
        }
    }
}

use stranger::Battery;

/// Written by hand from the module's documentation.
const BATTERY: &str = "\
# The flight battery, see Cell.
#
# Made by `battery_watch`.
#
# Layout: battery_watch.Battery.v3

# Counts the samples of this publisher from 1.
uint64 sequence
# When the publisher began,
# host monotonic ns. [ns]
uint64 epoch_ns
# Into the battery is positive, in [-80, 80].
float64 charge_rate
# From the negative pole.
battery_watch_msgs/Cell[3] cells
# Of the whole battery.
battery_watch_msgs/Cell whole

================================================================================
MSG: battery_watch_msgs/Cell
# One cell of a battery.
#
# Layout: battery_watch.Cell.v1

# Voltage under load. [V]
float32 voltage_v
# Temperature at the middle of the cell [degC].
float32 temperature
uint16 age
# Always zero.
int8[2] reserved
";

fn robots_own() -> impl Iterator<Item = &'static Layout> {
    let payloads = SERVICES.iter().map(|spec| spec.contract.payload);
    payloads.chain([
        RequestReport::LAYOUT,
        RelayLink::LAYOUT,
        RelayStations::LAYOUT,
    ])
}

fn battery() -> Battery {
    let mut battery = Battery {
        sequence: 7,
        epoch_ns: u64::MAX,
        charge_rate: -1.5,
        ..Battery::ZERO
    };
    battery.cells[2].voltage_v = 3.7;
    battery.cells[2].reserved = [-1, 5];
    battery.whole.age = 65_535;
    battery
}

#[test]
fn the_text_is_the_one_written_by_hand() {
    assert_eq!(text(Battery::LAYOUT), BATTERY);
}

/// What was worked out of a text is what the compiler has made of the struct.
fn assert_same(message: &Message, layout: &Layout) {
    assert_eq!((message.size, message.align), (layout.size, layout.align));
    assert_eq!(message.fields.len(), layout.fields.len(), "{}", layout.name);
    for (field, compiled) in message.fields.iter().zip(layout.fields) {
        assert_eq!(
            (field.name.as_str(), field.offset, field.size, field.len),
            (compiled.name, compiled.offset, compiled.size, compiled.len)
        );
        match (&field.kind, compiled.kind) {
            (Kind::Number(number), FieldKind::Number(compiled)) => assert_eq!(*number, compiled),
            (Kind::Struct(nested), FieldKind::Struct(compiled)) => assert_same(nested, compiled),
            _ => panic!("{}: {}", layout.name, field.name),
        }
    }
}

#[test]
fn a_parsed_text_is_the_layout_that_it_was_made_of() {
    for layout in robots_own().chain([Battery::LAYOUT]) {
        let schema = Schema::parse(&text(layout)).unwrap();
        assert_same(schema.root(), layout);
        assert_eq!(schema.type_name(), layout.type_name);
        assert_eq!(schema.ros_resource_name(), layout.ros_resource_name());
        assert!(text(layout).len() < MAX_TEXT_LEN / 16);
        // It is made without the text, and yet the same.
        assert_eq!(
            Schema::parse(&text(layout)),
            Ok(Schema::from_layout(layout))
        );
    }
}

#[test]
fn the_hash_sees_what_the_size_does_not() {
    let hash = |fields: &str| {
        let text = format!("# Layout: a.A.v1\n\n{fields}");
        Schema::parse(&text).unwrap().layout_hash()
    };
    let original = hash("float32 pitch\nfloat32 roll\n");
    assert_eq!(original, hash("float32 pitch\nfloat32 roll\n"));
    assert_ne!(original, hash("float32 roll\nfloat32 pitch\n"));
    assert_ne!(original, hash("float32 pitch\nuint32 roll\n"));
}

#[test]
fn without_comments_every_field_is_where_it_is_with_them() {
    let whole = Schema::of::<HeroTelemetry>();
    let bare = Schema::of_fields::<HeroTelemetry>();
    let places = |schema: &Schema| -> Vec<_> {
        let leaves = schema.leaves().into_iter();
        let place = |leaf: Leaf<'_>| (leaf.path.clone(), leaf.offset, leaf.number);
        leaves.map(place).collect()
    };
    assert_eq!(places(&bare), places(&whole));
    assert_eq!(bare.layout_hash(), whole.layout_hash());
    assert_eq!((bare.size(), bare.align()), (whole.size(), whole.align()));
    assert_eq!(bare.type_name(), whole.type_name());
    let is_said = |schema: &Schema| {
        schema
            .leaves()
            .iter()
            .any(|it| !it.field.comment.is_empty())
    };
    assert_eq!((is_said(&bare), is_said(&whole)), (false, true));
}

#[test]
fn names_are_those_of_ros() {
    let telemetry = Schema::of::<DspTelemetry>();
    assert_eq!(telemetry.type_name(), "hero.DspTelemetry.v3");
    assert_eq!(telemetry.ros_resource_name(), "hero_msgs/msg/DspTelemetry");
    assert_eq!(DspTelemetry::LAYOUT.ros_name(), "hero_msgs/DspTelemetry");
}

#[test]
fn units_come_from_the_name_or_from_the_comment() {
    let schema = Schema::parse(BATTERY).unwrap();
    for (path, unit) in [
        ("epoch_ns", Some("ns")),
        ("cells[0].voltage_v", Some("V")),
        ("whole.temperature", Some("degC")),
        ("charge_rate", None),
        ("whole.age", None),
    ] {
        assert_eq!(schema.number(path).unwrap().field.unit(), unit, "{path}");
    }
    let telemetry = Schema::of::<HeroTelemetry>();
    let speed = telemetry.number("velocity.up_mps").unwrap();
    assert_eq!(speed.field.comment, "Upwards, m/s. [m/s]");
}

#[test]
fn values_are_found_by_their_names() {
    let schema = Schema::parse(BATTERY).unwrap();
    let battery = battery();
    let read = |path: &str| schema.number(path)?.value(battery.bytes());
    for (path, expected) in [
        ("sequence", Some(Value::Unsigned(7))),
        ("epoch_ns", Some(Value::Unsigned(u64::MAX))),
        ("charge_rate", Some(Value::Double(-1.5))),
        ("cells[2].voltage_v", Some(Value::Single(3.7))),
        ("cells[2].reserved[0]", Some(Value::Signed(-1))),
        ("whole.age", Some(Value::Unsigned(65_535))),
        ("whole", None),
        ("cells", None),
        ("cells[3].voltage_v", None),
        ("cells.voltage_v", None),
        ("whole[0].age", None),
        ("sequence.age", None),
        ("sequence[0]", None),
        ("cells[2].reserved[2]", None),
        ("cells[-1].age", None),
        ("", None),
        (".", None),
        ("cells[", None),
    ] {
        assert_eq!(read(path), expected, "{path}");
    }
    let array = schema.find("cells[2].reserved");
    let values: Vec<_> = array[0].values(battery.bytes()).collect();
    assert_eq!(values, [Value::Signed(-1), Value::Signed(5)]);
    let paths = |path: &str| -> Vec<String> {
        schema
            .find(path)
            .into_iter()
            .map(|leaf| leaf.path)
            .collect()
    };
    assert_eq!(paths("cells").len(), 12);
    assert_eq!(paths("cells[1]")[3], "cells[1].reserved");
    assert_eq!(schema.leaves().len(), 3 + 4 * 4);
    assert_eq!(schema.leaves().last().unwrap().path, "whole.reserved");
}

#[test]
fn moments_are_found_in_nested_structs_and_arrays_and_are_neither_epochs_nor_durations() {
    let text = format!(
        "# Layout: stranger.Timed.v1\n\n\
         uint64 sequence\nuint64 epoch_ns\nuint64 source_epoch_ns\nStep first\nStep[2] steps\n\
         uint32 short_ns\nuint32 columns\nuint64 end_ns\n{}\nMSG: stranger_msgs/Step\n\
         uint64 began_ns\nint64 lasted_ns\nfloat64 lasted_s\nuint64[2] seen_ns\n",
        "=".repeat(80)
    );
    let moments = Schema::parse(&text).unwrap().moments();
    assert_eq!(moments, [24, 48, 56, 64, 88, 96, 104, 128, 136, 152]);
}

/// By hand, so that a new field is looked at: is it a moment of the host's monotonic clock?
#[test]
fn the_moments_of_the_robot_s_own_structs_are_these() {
    let names = |layout: &'static Layout| -> Vec<String> {
        let schema = Schema::from_layout(layout);
        let moments = schema.moments();
        let leaves = schema.leaves();
        let is_moment = |leaf: &&Leaf<'_>| moments.contains(&leaf.offset);
        leaves
            .iter()
            .filter(is_moment)
            .map(|leaf| leaf.path.clone())
            .collect()
    };
    assert_eq!(names(DspTelemetry::LAYOUT), ["received_ns", "sent_ns"]);
    assert_eq!(
        names(HeroTelemetry::LAYOUT),
        ["received_ns", "sent_ns", "published_ns"]
    );
    assert_eq!(
        names(ModuleState::LAYOUT),
        [
            "published_ns",
            "last_end.ended_ns",
            "link.last_message_ns",
            "link.last_telemetry_ns",
            "link.state_since_ns",
            "control.since_ns",
            "control.last_order_ns"
        ]
    );
    assert_eq!(names(BridgeOutline::LAYOUT), ["published_ns"]);
    assert_eq!(names(State::LAYOUT), ["published_ns", "since_ns"]);
    assert_eq!(names(RequestReport::LAYOUT), ["reported_ns"]);
    assert_eq!(names(MovementData::LAYOUT), ["issued_ns", "begin_by_ns"]);
    assert_eq!(names(ModuleControl::LAYOUT), ["issued_ns", "begin_by_ns"]);
    assert_eq!(
        names(ParameterRequest::LAYOUT),
        ["issued_ns", "begin_by_ns"]
    );
    assert_eq!(
        names(RelayLink::LAYOUT),
        ["published_ns", "since_ns", "last_heard_ns"]
    );
    let stations = names(RelayStations::LAYOUT);
    assert_eq!(stations.len(), 1 + 3 * MAX_STATIONS);
    assert_eq!(stations[2], "stations[0].since_ns");
}

#[test]
fn a_payload_that_is_too_short_has_no_value() {
    let schema = Schema::parse(BATTERY).unwrap();
    let battery = battery();
    for len in 0..battery.bytes().len() {
        for leaf in schema.leaves() {
            let end = leaf.offset + leaf.len.unwrap_or(1) * leaf.number.size();
            let count = leaf.values(&battery.bytes()[..len]).count();
            assert_eq!(count == leaf.len.unwrap_or(1), end <= len, "{}", leaf.path);
        }
    }
}

#[test]
fn numbers_convert_only_as_long_as_they_stay_the_same() {
    let max = Value::Unsigned(u64::MAX);
    assert_eq!(max.as_u64(), Some(u64::MAX));
    let less = Value::Signed(-1);
    assert_eq!((less.as_u64(), less.as_f64()), (None, -1.0));
    let half = Value::Single(0.5);
    assert_eq!((half.as_u64(), half.as_f64()), (None, 0.5));
    assert_eq!(Value::Single(0.1).to_string(), "0.1");
}

/// A decoder of CDR messages that knows nothing of this crate: it reads the definition as text, pads each number to its
/// own size, counted from the end of the header, and gives `path=value` lines.
mod cdr {
    use std::collections::HashMap;

    pub fn decode(definition: &str, message: &[u8]) -> (String, usize) {
        assert_eq!(message[..4], [0, 1, 0, 0], "plain CDR, little-endian");
        let mut types: HashMap<&str, Vec<(&str, &str)>> = HashMap::new();
        let mut name = "";
        for line in definition.lines() {
            if let Some(text) = line.strip_prefix("MSG: ") {
                name = text;
            } else if !line.is_empty() && !line.starts_with(['#', '=']) {
                let (kind, field) = line.split_once(' ').unwrap();
                types.entry(name).or_default().push((kind, field));
            }
        }
        let mut decoder = Decoder {
            body: &message[4..],
            at: 0,
            out: String::new(),
        };
        decoder.message(&types, "", "");
        (decoder.out, decoder.at)
    }

    struct Decoder<'a> {
        body: &'a [u8],
        at: usize,
        out: String,
    }

    impl Decoder<'_> {
        fn message(&mut self, types: &HashMap<&str, Vec<(&str, &str)>>, name: &str, path: &str) {
            for (kind, field) in &types[name] {
                let (kind, count) = match kind.split_once('[') {
                    Some((kind, len)) => (kind, len.trim_end_matches(']').parse().unwrap()),
                    None => (*kind, 1),
                };
                for index in 0..count {
                    let path = format!("{path}.{field}#{index}");
                    match types.contains_key(kind) {
                        true => self.message(types, kind, &path),
                        false => self.number(kind, &path),
                    }
                }
            }
        }

        fn number(&mut self, kind: &str, path: &str) {
            let size = kind.trim_start_matches(|c: char| c.is_alphabetic());
            let size = size.parse::<usize>().unwrap() / 8;
            while !self.at.is_multiple_of(size) {
                self.at += 1;
            }
            let mut bytes = [0; 8];
            bytes[..size].copy_from_slice(&self.body[self.at..self.at + size]);
            let bits = u64::from_le_bytes(bytes);
            let shift = 64 - 8 * size;
            let value = match (&kind[..kind.len() - (size * 8).to_string().len()], size) {
                ("uint", _) => bits.to_string(),
                ("int", _) => (((bits << shift) as i64) >> shift).to_string(),
                ("float", 4) => f32::from_bits(bits as u32).to_string(),
                ("float", 8) => f64::from_bits(bits).to_string(),
                other => panic!("{other:?}"),
            };
            self.at += size;
            self.out += &format!("{path}={value}\n");
        }
    }
}

/// The values as [`Schema`] reads them, written as the decoder writes them.
fn listed(schema: &Schema, payload: &[u8]) -> String {
    let mut out = String::new();
    for leaf in schema.leaves() {
        let mut path = String::new();
        for part in leaf.path.split('.') {
            let part = match part.strip_suffix(']') {
                Some(indexed) => indexed.replace('[', "#"),
                None => format!("{part}#0"),
            };
            path = format!("{path}.{part}");
        }
        for (index, value) in leaf.values(payload).enumerate() {
            let path = path.trim_end_matches("#0");
            let path = match path.ends_with(&leaf.field.name) {
                true => format!("{path}#{index}"),
                false => unreachable!("{path}"),
            };
            writeln!(out, "{path}={value}").unwrap();
        }
    }
    out
}

#[test]
fn a_sample_with_a_header_is_a_cdr_message() {
    for layout in robots_own().chain([Battery::LAYOUT]) {
        // Every byte differs from its neighbours, so that a wrong place is a wrong value.
        let payload: Vec<u8> = (0..layout.size)
            .map(|index| (index * 37 + 11) as u8)
            .collect();
        let message = [&CDR_HEADER[..], &payload].concat();
        let definition = text(layout);
        let (decoded, end) = cdr::decode(&definition, &message);
        let schema = Schema::parse(&definition).unwrap();
        assert_eq!(end, layout.size, "{}", layout.name);
        assert_eq!(decoded, listed(&schema, &payload), "{}", layout.name);
    }
}

#[test]
fn what_ros_allows_beside_is_understood() {
    let schema = "\
# Layout: a.A.v1\r

uint8 NONE=0
uint8 SOME = 1
string NAME=\"# no comment\"
# [m]
float64 length  # along \u{1b}the keel
byte kind 3
char[3] letters
A2 in_the_same_package
b_msgs/msg/B elsewhere
================================================================================
MSG: a_msgs/A2
int32 x
================================================================================
MSG: b_msgs/msg/B
int64 y
";
    let schema = Schema::parse(schema).unwrap();
    let fields: Vec<_> = schema
        .root()
        .fields
        .iter()
        .map(|field| (field.name.as_str(), field.offset))
        .collect();
    assert_eq!(
        fields,
        [
            ("length", 0),
            ("kind", 8),
            ("letters", 9),
            ("in_the_same_package", 12),
            ("elsewhere", 16)
        ]
    );
    let length = &schema.root().fields[0];
    assert_eq!(
        (length.unit(), length.comment.as_str()),
        (Some("m"), "[m]\nalong  the keel")
    );
    assert_eq!(schema.size(), 24);
}

/// `A1` contains `A2` twice, and so on.
fn nested(depth: usize, fields: &str) -> String {
    let mut text = String::from("# Layout: a.A1.v1\n\n");
    for index in 1..depth {
        let next = index + 1;
        let _ = write!(
            text,
            "{}\n{SEPARATOR}\nMSG: a_msgs/A{next}\n",
            fields.replace("$", &format!("A{next}"))
        );
    }
    text + "uint8 x\n"
}

const SEPARATOR: &str = text::SEPARATOR;

/// 16,000 structs in an array of this name, with this comment on the one field that each has: without a bound, 1.6 GB
/// of names.
fn wordy(array: &str, comment: &str, field: &str) -> String {
    format!(
        "# Layout: a.A.v1\n\na_msgs/B[16000] {array}\n{SEPARATOR}\nMSG: a_msgs/B\n# {comment}\n{field}\n"
    )
}

#[test]
fn hostile_texts_are_refused() {
    let head = "# Layout: a.A.v1\n\n";
    let deep_at_second_sight = format!(
        "{}\n{SEPARATOR}\nMSG: a_msgs/B\nA2 x\n",
        nested(MAX_DEPTH, "$ x").replacen("A2 x", "A2 x\nB y", 1)
    );
    let cases = [
        (String::new(), "does not name its type"),
        ("uint8 x".to_owned(), "does not name its type"),
        (
            "# Layout: a.A.v1\nuint8 x".to_owned(),
            "does not name its type",
        ),
        (
            "# Layout: a.A\n\nuint8 x".to_owned(),
            "does not name its type",
        ),
        (
            "# Layout: ../../etc.A.v1\n\nuint8 x".to_owned(),
            "does not name its type",
        ),
        (head.to_owned(), "no fields"),
        (format!("{head}uint8"), "a type and a name"),
        (format!("{head}uint8 X"), "lower snake case"),
        (format!("{head}uint8 x\u{1b}[2J"), "lower snake case"),
        (format!("{head}uint8 x\nuint8 x"), "same name"),
        (format!("{head}bool x"), "`bool`"),
        (format!("{head}string x"), "`string`"),
        (format!("{head}uint8[] x"), "fixed length"),
        (format!("{head}uint8[<=4] x"), "fixed length"),
        (format!("{head}uint8[0] x"), "fixed length"),
        (format!("{head}uint8[-1] x"), "fixed length"),
        (format!("{head}uint8[4][4] x"), "fixed length"),
        (
            format!("{head}uint8[99999999999999999999] x"),
            "fixed length",
        ),
        (format!("{head}uint8[18446744073709551615] x"), "more than"),
        (format!("{head}uint64[2305843009213693953] x"), "more than"),
        (
            format!("{head}uint8[{}] x", MAX_PAYLOAD_SIZE + 1),
            "more than",
        ),
        (format!("{head}uint16 x\nuint64 y"), "padding at its byte 2"),
        (format!("{head}uint64 x\nuint8 y"), "padding at its byte 9"),
        (format!("{head}A x"), "contain themselves"),
        (
            format!("{head}B x\n{SEPARATOR}\nMSG: a_msgs/B\nA x"),
            "contain themselves",
        ),
        (format!("{head}b_msgs/B x"), "`b_msgs/B`"),
        (format!("{head}\u{1b}[31m x"), "fixed length"),
        (
            format!("{head}{}\u{1b} x", "y".repeat(100)),
            &*"y".repeat(64),
        ),
        (format!("{head}uint8 x\n{SEPARATOR}"), "MSG: package/Name"),
        (
            format!("{head}uint8 x\n{SEPARATOR}\nMSG: ../B\nuint8 x"),
            "MSG: package/Name",
        ),
        (
            format!("{head}uint8 x\n{SEPARATOR}\nMSG: a_msgs/A\nuint8 x"),
            "twice",
        ),
        (nested(MAX_DEPTH + 1, "$ x"), "deeper"),
        (deep_at_second_sight, "deeper"),
        (nested(MAX_DEPTH, "$ x\n$ y\n$ z"), "more than"),
        (nested(MAX_DEPTH, "$[1000000] x"), "more than"),
        ("#".repeat(MAX_TEXT_LEN + 1), "bytes"),
        (
            wordy(&"x".repeat(100_000), "", "uint8 y"),
            "names and comments",
        ),
        (
            wordy("x", &"x".repeat(100_000), "uint8 y"),
            "names and comments",
        ),
        (
            wordy("x", "", &format!("uint8 {}", "y".repeat(100_000))),
            "names and comments",
        ),
    ];
    for (text, expected) in cases {
        let error = Schema::parse(&text).unwrap_err().to_string();
        assert!(error.contains(expected), "{text:.200}: {error}");
        assert!(!error.contains('\u{1b}') && error.len() < 300, "{error:?}");
    }
    assert!(Schema::parse(&nested(MAX_DEPTH, "$ x")).is_ok());
    let widest = Schema::parse(&nested(MAX_DEPTH - 2, "$ x\n$ y")).unwrap();
    assert_eq!(widest.leaves().len(), 1 << (MAX_DEPTH - 3));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    /// Whatever is done to a text, reading it and reading with it does not panic, and stays in the payload.
    #[test]
    fn spoiled_texts_do_no_harm(
        spoils in prop::collection::vec((any::<prop::sample::Index>(), 0_usize..6, "[ -~\n\\[\\]#=/]{0,8}"), 1..6),
        path in "[a-z_.\\[\\]0-9]{0,24}",
    ) {
        let mut text = BATTERY.to_owned();
        for (index, cut, insert) in spoils {
            let at = index.index(text.len() + 1);
            let end = (at + cut).min(text.len());
            text.replace_range(at..end, &insert);
        }
        if let Ok(schema) = Schema::parse(&text) {
            let payload = vec![0xa5; schema.size()];
            for leaf in schema.leaves() {
                prop_assert_eq!(leaf.values(&payload).count(), leaf.len.unwrap_or(1));
            }
            let _ = schema.find(&path);
            prop_assert!(schema.size() <= MAX_PAYLOAD_SIZE);
        }
    }

    #[test]
    fn any_text_does_no_harm(text in "\\PC{0,200}") {
        let _ = Schema::parse(&format!("# Layout: a.A.v1\n\n{text}"));
    }
}

#[test]
fn a_file_that_is_no_schema_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("schema.msg");
    let is_unreadable = || matches!(load(&path), Err(LoadError::Unreadable { .. }));
    let is_invalid = || matches!(load(&path), Err(LoadError::Invalid { .. }));
    assert!(is_unreadable());
    fs::write(&path, BATTERY).unwrap();
    assert_eq!(load(&path).unwrap().0, Schema::of::<Battery>());
    fs::write(&path, "uint8 x").unwrap();
    assert!(is_invalid());
    fs::write(&path, " ".repeat(MAX_TEXT_LEN + 10)).unwrap();
    assert!(is_invalid());
    fs::write(&path, [0xff]).unwrap();
    assert!(is_unreadable());
    fs::remove_file(&path).unwrap();
    fs::create_dir(&path).unwrap();
    assert!(is_unreadable());
}
