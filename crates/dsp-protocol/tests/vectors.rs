//! The golden vectors of `vectors/`, in both directions. `vectors/README.md` explains the files.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Debug;
use std::str::FromStr;

use dsp_protocol::downlink::{
    Acceleration, AngularRate, Attitude, Geographic, GpsVelocity, PanTilt, References, ServoPulses,
    Status, Supply, Xy,
};
use dsp_protocol::{
    Command, DecodeError, Decoded, Direction, Downlink, DspErrorCode, FlowControl, Profile,
    Received, Sequence, StatusMask, Uplink, Waypoint,
};

use crate::common;

const DOWNLINK: &str = include_str!("../vectors/downlink.tsv");
const UPLINK: &str = include_str!("../vectors/uplink.tsv");
pub const ENCODE: &str = include_str!("../vectors/encode.tsv");
const REFUSALS: &str = include_str!("../vectors/refusals.tsv");
const EXTENDED_DOWNLINK: &str = include_str!("../vectors/extended_downlink.tsv");
const EXTENDED_UPLINK: &str = include_str!("../vectors/extended_uplink.tsv");
const EXTENDED_REFUSALS: &str = include_str!("../vectors/extended_refusals.tsv");

/// The files of a profile: downlink, uplink, refusals.
pub fn files(profile: Profile) -> [&'static str; 3] {
    match profile {
        Profile::Classic => [DOWNLINK, UPLINK, REFUSALS],
        Profile::Extended => [EXTENDED_DOWNLINK, EXTENDED_UPLINK, EXTENDED_REFUSALS],
    }
}

/// The rows of a file, each cut into its four columns; the names are unique.
pub fn rows(file: &'static str) -> Vec<[&'static str; 4]> {
    let rows: Vec<[&str; 4]> = file
        .lines()
        .skip(1)
        .map(|line| {
            let columns: Vec<&str> = line.split('\t').collect();
            columns
                .try_into()
                .unwrap_or_else(|columns| panic!("not four columns: {columns:?}"))
        })
        .collect();
    let names: BTreeSet<&str> = rows.iter().map(|[name, ..]| *name).collect();
    assert_eq!(names.len(), rows.len(), "a name stands twice");
    rows
}

pub fn bytes_of(hex: &str) -> Vec<u8> {
    hex.split(' ')
        .map(|byte| u8::from_str_radix(byte, 16).expect("two hexadecimal digits"))
        .collect()
}

/// The `field=value` pairs of a vector, each of which must be used.
struct Fields(BTreeMap<&'static str, &'static str>);

impl Fields {
    fn of(column: &'static str) -> Self {
        Fields(
            column
                .split(' ')
                .filter(|pair| *pair != "-")
                .map(|pair| pair.split_once('=').expect("field=value"))
                .collect(),
        )
    }

    fn has(&self, name: &str) -> bool {
        self.0.contains_key(name)
    }

    fn text(&mut self, name: &str) -> &'static str {
        self.0
            .remove(name)
            .unwrap_or_else(|| panic!("no field {name}"))
    }

    fn get<T: FromStr<Err: Debug>>(&mut self, name: &str) -> T {
        self.text(name).parse().expect(name)
    }

    /// A number of the extended profile, which the fields of the classic one do not have.
    fn sequence(&mut self, name: &str) -> Option<Sequence> {
        self.number(name).map(Sequence::new)
    }

    fn switch(&mut self, name: &str) -> bool {
        self.get::<u8>(name) == 1
    }

    fn number<T: FromStr<Err: Debug>>(&mut self, name: &str) -> Option<T> {
        self.has(name).then(|| self.get(name))
    }

    fn finish(self, name: &str) {
        assert!(self.0.is_empty(), "{name}: unused fields {:?}", self.0);
    }
}

/// A group of which each field has its own name in the column, behind a prefix; `None` if none of them is there.
macro_rules! group {
    ($fields:ident, $prefix:literal, $group:ident { $($field:ident),+ }) => {
        [$(concat!($prefix, stringify!($field))),+]
            .iter()
            .any(|name| $fields.has(name))
            .then(|| $group {
                $($field: $fields.get(concat!($prefix, stringify!($field))),)+
            })
    };
}

fn status_of(fields: &mut Fields) -> Status {
    let mask = fields.text("mask").trim_start_matches("0x");
    let mask = StatusMask(u16::from_str_radix(mask, 16).expect("mask"));
    let status = Status {
        flying: fields.switch("flying"),
        time_ms: fields.number("time_ms"),
        geographic: group!(
            fields,
            "",
            Geographic {
                latitude_deg,
                longitude_deg,
                altitude_m
            }
        ),
        xy: group!(fields, "", Xy { x_m, y_m }),
        gps_velocity: group!(
            fields,
            "",
            GpsVelocity {
                horizontal_speed_mps,
                vertical_speed_mps,
                heading_deg
            }
        ),
        gps_quality: fields.number("gps_quality"),
        attitude: group!(
            fields,
            "",
            Attitude {
                pitch_deg,
                roll_deg,
                yaw_deg
            }
        ),
        acceleration: group!(
            fields,
            "acceleration_",
            Acceleration {
                x_mps2,
                y_mps2,
                z_mps2
            }
        ),
        angular_rate: group!(
            fields,
            "rate_",
            AngularRate {
                x_radps,
                y_radps,
                z_radps
            }
        ),
        pilot_pwm: group!(
            fields,
            "pilot_",
            ServoPulses {
                collective_us,
                roll_us,
                pitch_us,
                tail_us,
                throttle_us
            }
        ),
        sonar_adc: fields.number("sonar_adc"),
        supply: group!(
            fields,
            "",
            Supply {
                battery_mv,
                fuel_percent,
                auto_switch
            }
        ),
        pan_tilt: group!(fields, "", PanTilt { pan_adc, tilt_adc }),
        rotor_rpm: fields.number("rotor_rpm"),
        barometer_adc: fields.number("barometer_adc"),
        actuation: group!(
            fields,
            "actuation_",
            ServoPulses {
                collective_us,
                roll_us,
                pitch_us,
                tail_us,
                throttle_us
            }
        ),
        references: group!(
            fields,
            "reference_",
            References {
                x_speed_mps,
                y_speed_mps,
                altitude_m,
                pitch_deg,
                roll_deg,
                yaw_deg
            }
        ),
    };
    assert_eq!(status.mask(), mask);
    status
}

fn downlink_of(kind: &str, fields: &mut Fields) -> Option<Downlink> {
    Some(match kind {
        "status" => Downlink::Status(status_of(fields)),
        "flow_control" if fields.switch("request") => Downlink::FlowControl(FlowControl::Send),
        "flow_control" => Downlink::FlowControl(FlowControl::Stop),
        "ack" => Downlink::Ack {
            command: fields.get("command"),
        },
        "ack16" => Downlink::Ack16 {
            command: fields.get("command"),
            value: fields.get("value"),
        },
        "ack32" => Downlink::Ack32 {
            command: fields.get("command"),
            value: fields.get("value"),
        },
        "error" => Downlink::Error(DspErrorCode(fields.get("code"))),
        _ => return None,
    })
}

fn uplink_of(kind: &str, fields: &mut Fields) -> Option<Uplink> {
    let command = match kind {
        "waypoint" => {
            return Some(Uplink::Waypoint(Waypoint {
                latitude_deg: fields.get("latitude_deg"),
                longitude_deg: fields.get("longitude_deg"),
                altitude_m: fields.get("altitude_m"),
            }));
        }
        "read16" => Command::Read16 {
            port: fields.get("port"),
        },
        "write16" => Command::Write16 {
            port: fields.get("port"),
            value: fields.get("value"),
        },
        "read32" => Command::Read32 {
            port: fields.get("port"),
        },
        "write32" => Command::Write32 {
            port: fields.get("port"),
            value: fields.get("value"),
        },
        "clear_errors" => Command::ClearErrors,
        "activate_status" => Command::ActivateStatus,
        "invalidate_path" => Command::InvalidatePath,
        "following" => Command::Following {
            on: fields.switch("on"),
        },
        _ => return None,
    };
    Some(Uplink::Command(command))
}

/// `bytes` decode to `expected`, whole and byte by byte, and to nothing else.
fn check_decoding<M: Direction + Debug + PartialEq>(
    name: &str,
    profile: Profile,
    bytes: &[u8],
    expected: Received<M>,
) {
    let expected = [Decoded::Message(expected)];
    let whole = common::receive_all::<M>(profile, [bytes]);
    assert_eq!(whole, expected, "{name}");
    let by_byte = common::receive_all::<M>(profile, bytes.chunks(1));
    assert_eq!(by_byte, expected, "{name} byte by byte");
}

#[test]
fn every_downlink_vector_is_encoded_and_decoded() {
    for profile in Profile::ALL {
        let [file, ..] = files(profile);
        for [name, kind, hex, column] in rows(file) {
            let mut fields = Fields::of(column);
            let expected = Received {
                sequence: fields.sequence("sequence"),
                acknowledges: fields.sequence("acknowledges"),
                message: downlink_of(kind, &mut fields).expect(name),
            };
            fields.finish(name);
            let bytes = bytes_of(hex);
            let encoded = expected.message.encode_in(
                profile,
                expected.sequence.unwrap_or_default(),
                expected.acknowledges.unwrap_or_default(),
            );
            assert_eq!(encoded.as_bytes(), bytes, "{name}");
            check_decoding(name, profile, &bytes, expected);
        }
    }
}

#[test]
fn every_uplink_vector_is_encoded_and_decoded() {
    for profile in Profile::ALL {
        let [_, file, _] = files(profile);
        for [name, kind, hex, column] in rows(file) {
            let mut fields = Fields::of(column);
            let expected = Received {
                sequence: fields.sequence("sequence"),
                acknowledges: None,
                message: uplink_of(kind, &mut fields).expect(name),
            };
            fields.finish(name);
            let bytes = bytes_of(hex);
            let sequence = expected.sequence.unwrap_or_default();
            let encoded = expected.message.encode_in(profile, sequence);
            assert_eq!(encoded.as_bytes(), bytes, "{name}");
            check_decoding(name, profile, &bytes, expected);
        }
    }
}

#[test]
fn values_off_the_grid_are_rounded_and_saturate() {
    for [name, kind, hex, column] in rows(ENCODE) {
        let mut fields = Fields::of(column);
        let frame = match downlink_of(kind, &mut fields) {
            Some(message) => message.encode(),
            None => uplink_of(kind, &mut fields).expect(name).encode(),
        };
        fields.finish(name);
        assert_eq!(frame.as_bytes(), bytes_of(hex), "{name}");
    }
}

/// The outcomes of a stream in the words of the file, cut in every way that one cut allows and byte by byte.
fn outcomes<M: Direction + Debug>(name: &str, profile: Profile, bytes: &[u8]) -> String {
    let words = |decoded: Vec<Decoded<M>>| {
        let words: Vec<&str> = decoded
            .iter()
            .map(|decoded| match decoded {
                Decoded::Message(_) => "message",
                Decoded::Rejected(error) => error.name(),
                Decoded::Incomplete => unreachable!("not collected"),
            })
            .collect();
        if words.is_empty() {
            String::from("-")
        } else {
            words.join(" ")
        }
    };
    let whole = words(common::decode_all(profile, [bytes]));
    assert_eq!(
        words(common::decode_all(profile, bytes.chunks(1))),
        whole,
        "{name}"
    );
    for cut in 0..=bytes.len() {
        let (front, back) = bytes.split_at(cut);
        assert_eq!(
            words(common::decode_all(profile, [front, back])),
            whole,
            "{name} cut at {cut}"
        );
    }
    whole
}

#[test]
fn every_refusal_vector_gives_its_outcomes() {
    for profile in Profile::ALL {
        let [.., file] = files(profile);
        for [name, direction, hex, expected] in rows(file) {
            let bytes = bytes_of(hex);
            let outcomes = match direction {
                "downlink" => outcomes::<Downlink>(name, profile, &bytes),
                "uplink" => outcomes::<Uplink>(name, profile, &bytes),
                other => panic!("{name}: direction {other}"),
            };
            assert_eq!(outcomes, expected, "{name}");
        }
    }
}

#[test]
fn the_vectors_cover_every_message_every_group_and_every_refusal() {
    for profile in Profile::ALL {
        let [downlink, uplink, refusals] = files(profile);
        let kinds: BTreeSet<&str> = rows(downlink)
            .into_iter()
            .chain(rows(uplink))
            .map(|[_, kind, ..]| kind)
            .collect();
        assert_eq!(kinds.len(), 6 + 8 + 1, "{kinds:?}");
        for bit in 0..16 {
            let alone = format!("mask=0x{:04X}", 1 << bit);
            assert!(downlink.contains(&alone), "no status with {alone} alone");
        }
        let outcomes: BTreeSet<&str> = rows(refusals)
            .into_iter()
            .flat_map(|[.., outcomes]| outcomes.split(' '))
            .collect();
        for error in DecodeError::ALL {
            assert!(outcomes.contains(error.name()), "{error:?}");
        }
    }
}
