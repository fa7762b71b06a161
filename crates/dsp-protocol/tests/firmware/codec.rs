//! The codec in C is this crate to the byte: the golden vectors both ways, and streams of chance compared with the Rust
//! codec.

use std::collections::BTreeMap;
use std::fmt::{Debug, Write};
use std::fs;
use std::path::Path;
use std::process;

use dsp_protocol::port::{PORTS_16, PORTS_32};
use dsp_protocol::{
    Command, DecodeError, Decoded, Direction, Downlink, DspErrorCode, FieldSpec, Group, Profile,
    Received, Sequence, StatusMask, Uplink, checksum, crc32, header,
};
use fastrand::Rng;

use super::harness::{FREESTANDING, Harness, compiler, run, skip};
use super::source::{c_place, path, range};
use crate::common;
use crate::vectors::{self, bytes_of, rows};

/// Streams of chance for each profile and direction.
const SEEDS: u64 = 3000;

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}

/// Digits of 7 bits and unused bits on top of a value of this type.
fn digits_of(wire: &str) -> (usize, u32) {
    match wire {
        "u7" => (1, 0),
        "u14" => (2, 0),
        "u16" | "i16" => (3, 5),
        _ => (5, 3),
    }
}

/// The value of a field that lies at the front of `payload`.
fn take(payload: &mut &[u8], wire: &str) -> i64 {
    let (digits, rest) = payload.split_at(digits_of(wire).0);
    *payload = rest;
    let value = digits
        .iter()
        .fold(0u64, |value, digit| value << 7 | u64::from(*digit));
    match wire {
        "i16" => (value as u16).cast_signed().into(),
        "i32" => (value as u32).cast_signed().into(),
        _ => value as i64,
    }
}

/// A direction of the line as the harness names and describes its messages.
trait Described: Direction + Debug {
    const NAME: &'static str;
    fn bytes(received: &Received<Self>, profile: Profile) -> Vec<u8>;
    /// The message's own fields, in the order of the harness.
    fn fields(&self, text: &mut String, acknowledges: Sequence);
}

impl Described for Uplink {
    const NAME: &'static str = "uplink";

    fn bytes(received: &Received<Self>, profile: Profile) -> Vec<u8> {
        let sequence = received.sequence.unwrap_or_default();
        let frame = received.message.encode_in(profile, sequence);
        frame.as_bytes().to_vec()
    }

    fn fields(&self, text: &mut String, _: Sequence) {
        let frame = self.encode();
        let mut payload = &frame.as_bytes()[1..];
        match self {
            Uplink::Waypoint(waypoint) => {
                for name in ["latitude_deg_e7", "longitude_deg_e7", "altitude_mm"] {
                    write!(text, "{name}={},", take(&mut payload, "i32")).unwrap();
                }
                let is_implausible = u8::from(!waypoint.is_plausible());
                write!(text, "implausible={is_implausible},").unwrap();
            }
            Uplink::Command(command) => {
                take(&mut payload, "u7");
                let code = command.code();
                let mut next = |wire: &str, has: &[u8]| match has.contains(&code) {
                    true => take(&mut payload, wire),
                    false => 0,
                };
                let port = next("u16", &[0, 1, 2, 3]);
                let (value16, value32) = (next("u16", &[1]), next("u32", &[3]));
                let on = next("u7", &[7]);
                write!(
                    text,
                    "code={code},port={port},value16={value16},value32={value32},on={on},"
                )
                .unwrap();
            }
        }
    }
}

impl Described for Downlink {
    const NAME: &'static str = "downlink";

    fn bytes(received: &Received<Self>, profile: Profile) -> Vec<u8> {
        let sequence = received.sequence.unwrap_or_default();
        let acknowledges = received.acknowledges.unwrap_or_default();
        let message = received.message;
        let frame = message.encode_in(profile, sequence, acknowledges);
        frame.as_bytes().to_vec()
    }

    fn fields(&self, text: &mut String, acknowledges: Sequence) {
        let frame = self.encode();
        let mut payload = &frame.as_bytes()[1..];
        let number = acknowledges.number();
        match *self {
            Downlink::Status(ref status) => {
                let mask = status.mask();
                take(&mut payload, "u16");
                let flying = take(&mut payload, "u7");
                write!(text, "mask={},flying={flying},", mask.0).unwrap();
                for group in mask.groups() {
                    for field in group.limits() {
                        let value = take(&mut payload, field.wire);
                        write!(text, "{}={value},", c_place(group, field)).unwrap();
                    }
                }
                write!(text, "implausible={},", status.implausible_groups().0).unwrap();
            }
            Downlink::FlowControl(_) => write!(text, "send={},", payload[0]).unwrap(),
            Downlink::Error(DspErrorCode(code)) => write!(text, "error={code},").unwrap(),
            Downlink::Ack { command } => {
                write!(text, "acknowledges={number},command={command},").unwrap();
            }
            Downlink::Ack16 { command, value } => write!(
                text,
                "acknowledges={number},command={command},value16={value},"
            )
            .unwrap(),
            Downlink::Ack32 { command, value } => write!(
                text,
                "acknowledges={number},command={command},value32={},",
                value.to_bits()
            )
            .unwrap(),
        }
    }
}

/// What the harness answers when the codec in C is right: from the Rust codec.
fn expected<M: Described>(profile: Profile, bytes: &[u8]) -> String {
    let describe = |decoded: Decoded<Received<M>>| match decoded {
        Decoded::Rejected(error) => error.name().to_owned(),
        Decoded::Incomplete => unreachable!("not collected"),
        Decoded::Message(received) => {
            let again = M::bytes(&received, profile);
            let classic = M::bytes(&received, Profile::Classic)[0];
            let sequence = received.sequence.unwrap_or_default().number();
            let mut text = format!("message,header={classic},sequence={sequence},");
            let acknowledges = received.acknowledges.unwrap_or_default();
            received.message.fields(&mut text, acknowledges);
            text + &hex(&again)
        }
    };
    let all = common::receive_all::<M>(profile, [bytes]);
    let words: Vec<String> = all.into_iter().map(describe).collect();
    match words.is_empty() {
        true => "-".to_owned(),
        false => words.join(" "),
    }
}

fn decode(profile: Profile, direction: &str, chunk: usize, bytes: &[u8]) -> String {
    let name = profile.name();
    format!("decode {name} {direction} {chunk} {}", hex(bytes))
}

/// Questions and the right answers.
#[derive(Default)]
struct Quiz {
    questions: Vec<String>,
    answers: Vec<String>,
}

impl Quiz {
    fn add(&mut self, question: String, answer: String) {
        self.questions.push(question);
        self.answers.push(answer);
    }

    /// A stream, in pieces of this many bytes.
    fn stream(&mut self, profile: Profile, direction: &str, chunk: usize, bytes: &[u8]) {
        let answer = match direction {
            Uplink::NAME => expected::<Uplink>(profile, bytes),
            _ => expected::<Downlink>(profile, bytes),
        };
        self.add(decode(profile, direction, chunk, bytes), answer);
    }

    /// The first wrong answer of a harness.
    fn wrong(&self, harness: &Harness) -> Option<String> {
        let answers = match harness.try_ask(&self.questions) {
            Ok(answers) => answers,
            Err(why) => return Some(why),
        };
        let all = self.questions.iter().zip(&self.answers).zip(&answers);
        let mut wrong = all.filter(|((_, right), answer)| right != answer);
        let found = wrong
            .next()
            .map(|((question, right), answer)| format!("{question}\n  {answer}\nnot\n  {right}"));
        found.or_else(|| (answers.len() != self.answers.len()).then(|| "too few answers".into()))
    }

    fn check(&self) {
        assert!(!self.questions.is_empty());
        for harness in Harness::all() {
            let wrong = self.wrong(harness);
            assert!(wrong.is_none(), "{}: {}", harness.name, wrong.unwrap());
        }
    }
}

/// The fields of a status by their names in the vectors.
fn fields_by_name() -> BTreeMap<String, (String, &'static FieldSpec)> {
    let mut all = BTreeMap::new();
    for group in Group::ALL {
        let prefix = match group {
            Group::Acceleration => "acceleration_",
            Group::AngularRate => "rate_",
            Group::PilotPwm => "pilot_",
            Group::Actuation => "actuation_",
            Group::References => "reference_",
            _ => "",
        };
        for field in group.limits() {
            let name = format!("{prefix}{}", field.name);
            all.insert(name, (c_place(group, field), field));
        }
    }
    all
}

/// The header and the code of a message by its name in the vectors.
fn header_of(message: &str) -> (u8, Option<u8>) {
    let command = |code| (header::COMMAND, Some(code));
    match message {
        "status" => (header::STATUS, None),
        "flow_control" => (header::FLOW_CONTROL, None),
        "ack" => (header::ACK, None),
        "ack16" => (header::ACK_16, None),
        "ack32" => (header::ACK_32, None),
        "error" => (header::ERROR, None),
        "waypoint" => (header::WAYPOINT, None),
        "read16" => command(0),
        "write16" => command(1),
        "read32" => command(2),
        "write32" => command(3),
        "clear_errors" => command(4),
        "activate_status" => command(5),
        "invalidate_path" => command(6),
        "following" => command(7),
        other => panic!("no message {other}"),
    }
}

/// The fields of a vector as the harness has them, from the vector's decimal numbers alone. `scale` makes steps of a
/// value in its unit.
fn in_steps(
    message: &str,
    column: &str,
    mut scale: impl FnMut(&FieldSpec, f64) -> i64,
) -> Vec<String> {
    let by_name = fields_by_name();
    let (header, code) = header_of(message);
    let mut all = vec![format!("header={header}")];
    all.extend(code.map(|code| format!("code={code}")));
    for pair in column.split(' ').filter(|pair| *pair != "-") {
        let (name, value) = pair.split_once('=').expect("field=value");
        let (name, value) = match name {
            "mask" => {
                let mask = value.trim_start_matches("0x");
                let mask = u16::from_str_radix(mask, 16).expect("a mask");
                (name, mask.to_string())
            }
            "request" => ("send", value.to_owned()),
            "code" => ("error", value.to_owned()),
            "value" if message.ends_with("32") => {
                let value: f32 = value.parse().expect("a number");
                ("value32", value.to_bits().to_string())
            }
            "value" => ("value16", value.to_owned()),
            "flying" | "sequence" | "acknowledges" | "command" | "port" | "on" => {
                (name, value.to_owned())
            }
            _ => {
                let (place, field) = &by_name[name];
                let value: f64 = value.parse().expect("a number");
                // A waypoint has the fields of the geographic position, without that group.
                let place = match header == header::WAYPOINT {
                    true => place.trim_start_matches("geographic."),
                    false => place,
                };
                (place, scale(field, value).to_string())
            }
        };
        all.push(format!("{name}={value}"));
    }
    all
}

fn on_the_grid(field: &FieldSpec, value: f64) -> i64 {
    (value * f64::from(field.steps_per_unit)).round() as i64
}

/// Every vector of messages: profile, direction, its four columns.
fn message_vectors() -> Vec<(Profile, &'static str, [&'static str; 4])> {
    let mut all = Vec::new();
    for profile in Profile::ALL {
        let [downlink, uplink, _] = vectors::files(profile);
        for (direction, file) in [(Downlink::NAME, downlink), (Uplink::NAME, uplink)] {
            all.extend(rows(file).into_iter().map(|row| (profile, direction, row)));
        }
    }
    all
}

/// Each vector as the harness encodes it.
fn vectors_to_encode() -> Quiz {
    let mut quiz = Quiz::default();
    for (profile, direction, [_, message, bytes, column]) in message_vectors() {
        let fields = in_steps(message, column, on_the_grid).join(" ");
        let question = format!("encode {} {direction} {fields}", profile.name());
        quiz.add(question, bytes.replace(' ', ""));
    }
    quiz
}

/// Each vector, and each stream of refusals, as the harness decodes it whole, byte by byte and in larger pieces.
fn vectors_to_decode() -> Quiz {
    let mut quiz = Quiz::default();
    let mut add = |profile, direction: &str, bytes: &str| {
        let bytes = bytes_of(bytes);
        for chunk in [0, 1, 2, 3, 5, 7, 11, 64] {
            quiz.stream(profile, direction, chunk, &bytes);
        }
    };
    for (profile, direction, [_, _, bytes, _]) in message_vectors() {
        add(profile, direction, bytes);
    }
    for profile in Profile::ALL {
        let [.., refusals] = vectors::files(profile);
        for [_, direction, bytes, _] in rows(refusals) {
            add(profile, direction, bytes);
        }
    }
    quiz
}

#[test]
fn every_vector_is_encoded_by_the_codec_in_c() {
    vectors_to_encode().check();
}

#[test]
fn every_vector_is_decoded_by_the_codec_in_c() {
    vectors_to_decode().check();
    // The fields have the names and numbers of the vectors, too: the quiz has them from the Rust codec's bytes.
    let harnesses = Harness::all();
    for (profile, direction, [name, message, bytes, column]) in message_vectors() {
        let Some(harness) = harnesses.first() else {
            return;
        };
        let question = decode(profile, direction, 0, &bytes_of(bytes));
        let answer = &harness.ask(&[question])[0];
        for field in in_steps(message, column, on_the_grid) {
            let is_there = answer.split(',').any(|word| word == field);
            assert!(is_there, "{name}: {field} is not in {answer}");
        }
    }
}

#[test]
fn values_off_the_grid_are_rounded_by_the_codec_in_c() {
    for harness in Harness::all() {
        for [name, message, bytes, column] in rows(vectors::ENCODE) {
            let scaled = |field: &FieldSpec, value: f64| {
                if field.steps_per_unit == 1 {
                    return value as i64;
                }
                // What the firmware has is a `float`, but for positions.
                let value = match field.wire {
                    "i32" => value,
                    _ => f64::from(value as f32),
                };
                let (wire, bits, steps) = (field.wire, value.to_bits(), field.steps_per_unit);
                let answer = &harness.ask(&[format!("steps {wire} {bits} {steps}")])[0];
                answer.parse().expect("a number")
            };
            let fields = in_steps(message, column, scaled).join(" ");
            let direction = match message {
                "waypoint" => Uplink::NAME,
                _ => Downlink::NAME,
            };
            let frame = &harness.ask(&[format!("encode classic {direction} {fields}")])[0];
            assert_eq!(*frame, bytes.replace(' ', ""), "{name}: {}", harness.name);
        }
    }
}

#[test]
fn steps_are_those_of_the_rust_codec() {
    let mut rng = Rng::with_seed(7);
    let mut quiz = Quiz::default();
    let special = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -0.0, 1e300];
    // The nearest number below a half, which must not be rounded up.
    let halves = [
        0.5,
        0.5f64.next_down(),
        -0.5,
        (-0.5f64).next_up(),
        2.5,
        -3.5,
    ];
    let near_ends = [65_535.0, 65_534.5, 32_767.0, 32_766.5, -32_768.0, -32_767.5];
    let large = [
        2_147_483_647.0,
        2_147_483_646.5,
        -2_147_483_648.0,
        -2_147_483_647.5,
    ];
    let mut values = [&special[..], &halves, &near_ends, &large].concat();
    values.extend((0..2000).map(|_| (rng.f64() - 0.5) * 10f64.powi(rng.i32(-3..12))));
    values.extend((0..2000).map(|_| f64::from_bits(rng.u64(..))));
    for value in values {
        for steps in [1u32, 100, 1000, 10_000_000] {
            let exact = (value * f64::from(steps)).round();
            for (wire, right) in [
                ("u16", i64::from(exact as u16)),
                ("i16", i64::from(exact as i16)),
                ("i32", i64::from(exact as i32)),
            ] {
                let question = format!("steps {wire} {} {steps}", value.to_bits());
                quiz.add(question, right.to_string());
            }
        }
    }
    quiz.check();
}

#[test]
fn ports_lengths_and_errors_are_those_of_the_tables() {
    let mut rng = Rng::with_seed(8);
    let mut quiz = Quiz::default();
    for number in (0..=u16::MAX)
        .filter(|number| number % 97 == 0 || *number / 1000 == 10 || *number / 1000 == 20)
    {
        let row = PORTS_16.iter().find(|port| port.number == number);
        let edges = row
            .iter()
            .flat_map(|port| [port.min - 1, port.min, port.max, port.max + 1]);
        let edges: Vec<u16> = edges.map(|value| value as u16).collect();
        for bits in edges.into_iter().chain([rng.u16(..), rng.u16(..)]) {
            let answer = row.map_or("-".to_owned(), |port| {
                let (signed, accepted) = (u8::from(port.signed), u8::from(port.accepts(bits)));
                let (min, max, boot) = (port.min, port.max, port.boot);
                format!("{number} {signed} {min} {max} {boot} {accepted}")
            });
            quiz.add(format!("port16 {number} {bits}"), answer);
        }
        let row = PORTS_32.iter().find(|port| port.number == number);
        let edges = row.iter().flat_map(|port| {
            [
                port.min,
                port.max,
                port.min.next_down(),
                port.max.next_up(),
                f32::NAN,
                f32::INFINITY,
            ]
        });
        let edges: Vec<f32> = edges.collect();
        for value in edges.into_iter().chain([rng.f32() * 20.0]) {
            let answer = row.map_or("-".to_owned(), |port| {
                let [min, max, boot] = [port.min, port.max, port.boot].map(f32::to_bits);
                format!(
                    "{number} {min} {max} {boot} {}",
                    u8::from(port.accepts(value))
                )
            });
            quiz.add(format!("port32 {number} {}", value.to_bits()), answer);
        }
    }
    for mask in (0..=u16::MAX).step_by(61).map(StatusMask) {
        let len = mask.status_frame_len();
        quiz.add(format!("len classic {}", mask.0), len.to_string());
        quiz.add(format!("len extended {}", mask.0), (len + 6).to_string());
    }
    for (number, error) in (2..).zip(DecodeError::ALL) {
        // Section 5.1, and 11 for the other profile.
        let code = match error {
            DecodeError::UnknownHeader | DecodeError::OtherProfile => 100,
            DecodeError::Checksum => 102,
            DecodeError::Padding | DecodeError::Value | DecodeError::UnknownCommand => 30,
            DecodeError::Stray | DecodeError::Truncated => 0,
        };
        quiz.add(format!("error {number}"), code.to_string());
    }
    quiz.check();
}

/// A payload of chance of the message with this classic header; rarely one with padding, or a value that cannot be.
fn payload(rng: &mut Rng, header: u8) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut put = |rng: &mut Rng, wire: &str| {
        let (digits, unused) = digits_of(wire);
        let at = bytes.len();
        bytes.extend((0..digits).map(|_| rng.u8(..128)));
        if rng.u8(..50) != 0 {
            bytes[at] &= 0x7F >> unused;
        }
        at
    };
    let few = |rng: &mut Rng, values: u8| match rng.u8(..50) {
        0 => rng.u8(..128),
        _ => rng.u8(..values),
    };
    match header {
        header::STATUS => {
            let mask = match rng.u8(..4) {
                0 => u16::MAX,
                1 => 1 << rng.u8(..16),
                _ => rng.u16(..),
            };
            let flags = few(rng, 2);
            let fields: Vec<&str> = StatusMask(mask)
                .groups()
                .flat_map(|group| group.limits().iter().map(|field| field.wire))
                .collect();
            for wire in fields {
                put(rng, wire);
            }
            let [high, low] = [mask >> 14, mask >> 7].map(|digit| digit as u8 & 0x7F);
            let excess = if rng.u8(..50) == 0 {
                rng.u8(..128) & 0x7C
            } else {
                0
            };
            bytes.splice(0..0, [high | excess, low, mask as u8 & 0x7F, flags]);
        }
        header::FLOW_CONTROL => bytes.push(few(rng, 2)),
        header::ACK => bytes.push(few(rng, 8)),
        header::ACK_16 | header::ACK_32 => {
            put(
                rng,
                if header == header::ACK_16 {
                    "u16"
                } else {
                    "u32"
                },
            );
            bytes.insert(0, few(rng, 8));
        }
        header::ERROR => {
            put(rng, "u16");
        }
        header::WAYPOINT => {
            for _ in 0..3 {
                put(rng, "i32");
            }
        }
        _ => {
            let code = few(rng, 8);
            let fields: &[&str] = match code {
                0 | 2 => &["u16"],
                1 => &["u16", "u16"],
                3 => &["u16", "u32"],
                _ => &[],
            };
            for wire in fields {
                put(rng, wire);
            }
            if code == 7 {
                bytes.push(few(rng, 2));
            }
            bytes.insert(0, code);
        }
    }
    bytes
}

/// A frame of chance with a right checksum or CRC.
fn frame(rng: &mut Rng, profile: Profile, direction: &str) -> Vec<u8> {
    const DOWNLINK: [u8; 6] = [
        header::STATUS,
        header::FLOW_CONTROL,
        header::ACK,
        header::ACK_16,
        header::ACK_32,
        header::ERROR,
    ];
    const UPLINK: [u8; 2] = [header::COMMAND, header::WAYPOINT];
    let (headers, extended) = match direction {
        Uplink::NAME => (&UPLINK[..], header::EXTENDED_UPLINK),
        _ => (&DOWNLINK[..], header::EXTENDED_DOWNLINK),
    };
    let header = headers[rng.usize(..headers.len())];
    let payload = payload(rng, header);
    match profile {
        Profile::Classic => {
            let mut bytes = [&[header], &payload[..]].concat();
            bytes.push(checksum(&bytes));
            bytes
        }
        Profile::Extended => {
            let front = [extended, rng.u8(..128), header & 0x7F];
            let mut bytes = [&front, &payload[..]].concat();
            if header::is_acknowledgement(header) {
                bytes.push(rng.u8(..128));
            }
            let crc = crc32(&bytes);
            bytes.extend([28, 21, 14, 7, 0].map(|shift| (crc >> shift) as u8 & 0x7F));
            bytes
        }
    }
}

/// Frames, pieces of them, damage and noise.
fn stream(rng: &mut Rng, profile: Profile, direction: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    for _ in 0..rng.usize(1..8) {
        let mut piece = frame(rng, profile, direction);
        match rng.u8(..12) {
            0 => piece = (0..rng.usize(..12)).map(|_| rng.u8(..)).collect(),
            1 => piece.truncate(rng.usize(..piece.len())),
            2 | 3 => {
                let at = rng.usize(..piece.len());
                piece[at] ^= 1 << rng.u8(..8);
            }
            4 => {
                let at = rng.usize(..piece.len());
                piece.remove(at);
            }
            5 => piece.insert(rng.usize(..piece.len()), rng.u8(..)),
            6 => {
                let other = Profile::ALL[usize::from(profile == Profile::Classic)];
                piece = frame(rng, other, direction);
            }
            _ => {}
        }
        bytes.extend(piece);
    }
    bytes
}

#[test]
fn streams_of_chance_mean_the_same_in_c_and_in_rust() {
    let mut quiz = Quiz::default();
    for profile in Profile::ALL {
        for direction in [Uplink::NAME, Downlink::NAME] {
            for seed in 0..SEEDS {
                let mut rng = Rng::with_seed(seed);
                let bytes = stream(&mut rng, profile, direction);
                let chunk = [0, 1, 2, 3, 7, 40][rng.usize(..6)];
                quiz.stream(profile, direction, chunk, &bytes);
            }
        }
    }
    // Every result is among the right answers, or chance has shown nothing.
    for result in DecodeError::ALL.map(DecodeError::name) {
        let is_there = |answer: &String| answer.split(' ').any(|word| word == result);
        let count = quiz
            .answers
            .iter()
            .filter(|answer| is_there(answer))
            .count();
        assert!(count > 20, "{result}: only {count}");
    }
    quiz.check();
}

#[test]
fn noise_means_the_same_in_c_and_in_rust() {
    let mut quiz = Quiz::default();
    for profile in Profile::ALL {
        for direction in [Uplink::NAME, Downlink::NAME] {
            for seed in 0..SEEDS / 4 {
                let mut rng = Rng::with_seed(!seed);
                let bytes: Vec<u8> = (0..rng.usize(1..300)).map(|_| rng.u8(..)).collect();
                quiz.stream(profile, direction, 0, &bytes);
            }
        }
    }
    quiz.check();
}

/// Each field at the ends of its type, and beyond those of its type on the wire.
fn ends_of_fields() -> Quiz {
    let mut rng = Rng::with_seed(9);
    let mut quiz = Quiz::default();
    for group in Group::ALL {
        for field in group.limits() {
            let (least, greatest) = range(field.wire);
            let beyond = match field.wire {
                "u7" => 200,
                "u14" => 20_000,
                _ => greatest,
            };
            for value in [least, greatest, beyond, rng.i64(least..=greatest)] {
                let mut frame = vec![header::STATUS];
                let digits = |value: i64, digits: usize| {
                    let shifts = (0..digits).rev().map(|digit| 7 * digit);
                    shifts.map(move |shift| (value >> shift) as u8 & 0x7F)
                };
                frame.extend(digits(group.bit().into(), 3));
                frame.push(1);
                for other in group.limits() {
                    let (count, unused) = digits_of(other.wire);
                    let sent = if other == field {
                        value.min(greatest)
                    } else {
                        0
                    };
                    let bits = 7 * count as u32 - unused;
                    frame.extend(digits(sent & ((1 << bits) - 1), count));
                }
                frame.push(checksum(&frame));
                let (mask, place) = (group.bit(), c_place(group, field));
                let header = header::STATUS;
                let question = format!(
                    "encode classic downlink header={header} mask={mask} flying=1 {place}={value}"
                );
                quiz.add(question, hex(&frame));
            }
        }
    }
    quiz
}

/// Each of some commands as a copy of each: number and bytes must be equal.
fn copies() -> Quiz {
    let commands = [
        Command::Read16 { port: 10_001 },
        Command::Read16 { port: 10_002 },
        Command::Read32 { port: 10_001 },
        Command::Write16 {
            port: 10_001,
            value: 50,
        },
        Command::Write16 {
            port: 10_001,
            value: 51,
        },
        Command::Write32 {
            port: 20_000,
            value: 0.0,
        },
        Command::Write32 {
            port: 20_000,
            value: -0.0,
        },
        Command::Write32 {
            port: 20_000,
            value: f32::NAN,
        },
        Command::ClearErrors,
        Command::InvalidatePath,
        Command::Following { on: false },
        Command::Following { on: true },
    ];
    let frame = |command, number| {
        let frame = Uplink::Command(command).encode_in(Profile::Extended, Sequence::new(number));
        hex(frame.as_bytes())
    };
    let frames: Vec<String> = [7, 8]
        .into_iter()
        .flat_map(|number| commands.map(|command| frame(command, number)))
        .collect();
    let mut quiz = Quiz::default();
    for last in &frames {
        for command in &frames {
            let is_copy = u8::from(last == command);
            quiz.add(format!("copy {last} {command}"), is_copy.to_string());
        }
    }
    quiz
}

#[test]
fn a_copy_of_a_command_has_its_number_and_its_bytes() {
    copies().check();
}

#[test]
fn any_value_of_a_field_is_sent_within_its_type() {
    ends_of_fields().check();
}

#[test]
fn what_cannot_be_encoded_gives_no_frame() {
    let mut quiz = Quiz::default();
    for profile in Profile::ALL.map(Profile::name) {
        for question in [
            "uplink header=233",
            "uplink header=240 code=8",
            "downlink header=240",
            "downlink header=218",
        ] {
            quiz.add(format!("encode {profile} {question}"), "-".to_owned());
        }
    }
    quiz.check();
}

/// Mistakes that a codec may have: the text, and what stands there instead.
const MISTAKES: [(&str, &str); 22] = [
    (
        "(value.bits == last_value.bits)",
        "(value.number == last_value.number)",
    ),
    ("(command->sequence == last->sequence) &&", "true &&"),
    (
        "(bits <= 0x7FFFFFFFu) ? (int32_t)bits",
        "true ? (int32_t)(bits & 0x7FFFFFFFu)",
    ),
    (
        "(bits <= 0x7FFFu) ? (int16_t)bits",
        "true ? (int16_t)(bits & 0x7FFFu)",
    ),
    ("in->has_excess = true", "in->has_excess = false"),
    (
        "if (in->has_excess)",
        "if (in->has_excess && has_possible_values)",
    ),
    ("return flags <= 1u", "return flags <= 127u"),
    (
        "is_possible = (request <= 1u)",
        "is_possible = (request <= 2u)",
    ),
    ("is_possible = (on <= 1u)", "is_possible = (on <= 127u)"),
    (
        "message->command <= MAX_COMMAND_CODE)",
        "message->command <= 127u)",
    ),
    (
        "payload[0] > MAX_COMMAND_CODE",
        "payload[0] > MAX_COMMAND_CODE + 1u",
    ),
    (
        "decoder->skipping = true;\n        decoder->held = 0u",
        "decoder->skipping = false;\n        decoder->held = 0u",
    ),
    (
        "found = HERO_DSP_TRUNCATED;",
        "taken++;\n            found = HERO_DSP_TRUNCATED;",
    ),
    ("if (!decoder->skipping)", "if (true)"),
    (
        "found = unknown(HERO_DSP_OTHER_PROFILE);\n        } else",
        "found = unknown(HERO_DSP_UNKNOWN_HEADER);\n        } else",
    ),
    ("0xF36E6F75u", "0xF36E6F74u"),
    (
        "sound && (bytes[summed + at] == digits[at])",
        "(bytes[summed + at] == digits[at])",
    ),
    ("(value > 0x3FFFu) ? 0x3FFFu : value", "value"),
    ("(value > DIGIT_MASK) ? DIGIT_MASK : value", "value"),
    (
        "put_i32(out, group->latitude_deg_e7);\n    put_i32(out, group->longitude_deg_e7)",
        "put_i32(out, group->longitude_deg_e7);\n    put_i32(out, group->latitude_deg_e7)",
    ),
    (
        "found.len += 1u; /* the number",
        "found.len += 0u; /* the number",
    ),
    (
        "((uint32_t)payload[0] << 14)",
        "((uint32_t)payload[0] << 13)",
    ),
];

/// The vectors and the streams show a mistake.
#[test]
fn a_codec_with_a_mistake_is_found() {
    let Some(compiler) = compiler() else {
        return;
    };
    let right = fs::read_to_string(path("hero_dsp.c")).expect("a file of the repository");
    let quizzes = [
        vectors_to_encode(),
        vectors_to_decode(),
        ends_of_fields(),
        copies(),
    ];
    for (text, mistake) in MISTAKES {
        let wrong = right.replacen(text, mistake, 1);
        assert_ne!(wrong, right, "`{text}` is not in hero_dsp.c");
        let options = ["-O0", "-Wno-error", "-Wno-conversion"];
        let harness = Harness::build(&compiler, "wrong", &options, &wrong);
        let harness = harness.unwrap_or_else(|why| panic!("`{mistake}`: {why}"));
        let is_found = quizzes.iter().any(|quiz| quiz.wrong(&harness).is_some());
        assert!(is_found, "`{mistake}` instead of `{text}` is not found");
    }
}

/// Debian's compiler for Cortex-M takes the codec and the DSP of the examples, and the codec needs nothing but the
/// arithmetic of `double` and `float`, which the compiler's own library has.
#[test]
fn the_codec_is_compiled_for_a_cortex_m_and_needs_nothing_but_arithmetic() {
    let compiler = "arm-none-eabi-gcc";
    if let Err(why) = run(process::Command::new(compiler).arg("--version")) {
        return skip("the codec in C for Cortex-M", &why);
    }
    let folder = tempfile::tempdir().expect("a folder");
    let object = folder.path().join("object");
    for processor in ["cortex-m0", "cortex-m4"] {
        let compile = |source: &Path| {
            let mut command = process::Command::new(compiler);
            command.args([&format!("-mcpu={processor}"), "-mthumb", "-Os"]);
            command.args(FREESTANDING).arg("-I").arg(path("")).arg("-c");
            run(command.arg(source).arg("-o").arg(&object)).expect("it is compiled");
        };
        compile(&path("../../examples/firmware/dsp.c"));
        compile(&path("hero_dsp.c"));
        let symbols = run(process::Command::new("arm-none-eabi-nm")
            .arg("-u")
            .arg(&object))
        .expect("nm");
        let wanted = symbols.split_whitespace().filter(|word| *word != "U");
        let others: Vec<_> = wanted
            .filter(|name| !name.starts_with("__aeabi_"))
            .collect();
        assert!(others.is_empty(), "{processor}: {others:?}");
    }
}

/// The rules that the head of the header promises.
#[test]
fn the_codec_includes_and_calls_nothing_of_the_c_library() {
    for file in ["hero_dsp.h", "hero_dsp.c"] {
        let text = fs::read_to_string(path(file)).expect("a file of the repository");
        assert!(
            text.is_ascii(),
            "{file}: some compilers for DSPs read nothing else"
        );
        let included = text
            .lines()
            .filter_map(|line| line.strip_prefix("#include "));
        let allowed = ["<stdbool.h>", "<stddef.h>", "<stdint.h>", "\"hero_dsp.h\""];
        for name in included {
            assert!(allowed.contains(&name), "{file} includes {name}");
        }
        for word in ["malloc", "memcpy", "memset", "goto ", "TODO"] {
            assert!(!text.contains(word), "{file} has `{word}`");
        }
    }
}
