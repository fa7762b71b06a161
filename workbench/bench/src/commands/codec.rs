//! `codec`: how fast the decoder of the serial line takes full status frames.

use std::fmt;
use std::hint::black_box;
use std::time::{Duration, Instant};

use anyhow::{Result, ensure};
use dsp_protocol::{Decoded, Decoder, Downlink, Framed, Profile, StatusMask, checksum};

use super::Common;
use crate::report::{Bound, Section};
use crate::rounds::Measured;
use crate::statistics::{Ratio, median};
use crate::stream;

/// Frames of one pass: 256 kB, which lie in the second cache as bytes do that have just been read.
const FRAMES: u32 = 2000;

/// Bytes of one slice: those of one read of the bridge.
const SLICE_LEN: usize = 4096;

/// Options of the command.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    common: Common,

    /// Milliseconds that one parser is measured for in one round
    #[arg(long, default_value_t = 200)]
    millis: u64,
}

/// A parser.
#[derive(Clone, Copy, PartialEq)]
enum Parser {
    /// Our decoder with all values.
    Ours(Profile),
    /// Our decoder up to the checksum.
    OurFramer,
    /// The least that finds and checks frames.
    Framer,
    /// The same, and every value unpacked.
    Unpacker,
    #[cfg(feature = "peers")]
    Mavlink,
}

/// A parser and its input.
#[derive(Clone, Copy, PartialEq)]
struct Case {
    parser: Parser,
    is_corrupted: bool,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parser = match self.parser {
            Parser::Ours(Profile::Classic) => "RIL, classic",
            Parser::Ours(Profile::Extended) => "RIL, extended",
            Parser::OurFramer => "RIL, classic, frames only",
            Parser::Framer => "bare framer with checksum",
            Parser::Unpacker => "bare framer with checksum and values",
            #[cfg(feature = "peers")]
            Parser::Mavlink => "rust-mavlink, ODOMETRY",
        };
        let corrupted = if self.is_corrupted {
            ", 1 % corrupted"
        } else {
            ""
        };
        write!(f, "{parser}{corrupted}")
    }
}

impl Parser {
    const ALL: &[Parser] = &[
        Parser::Ours(Profile::Classic),
        Parser::Ours(Profile::Extended),
        Parser::OurFramer,
        Parser::Framer,
        Parser::Unpacker,
        #[cfg(feature = "peers")]
        Parser::Mavlink,
    ];

    fn frames(self) -> Result<Vec<Vec<u8>>> {
        match self {
            Parser::Ours(profile) => Ok(stream::frames(profile, FRAMES)),
            Parser::OurFramer | Parser::Framer | Parser::Unpacker => {
                Ok(stream::frames(Profile::Classic, FRAMES))
            }
            #[cfg(feature = "peers")]
            Parser::Mavlink => mavlink::frames(),
        }
    }

    /// Parses `stream` once and says how many messages that gave.
    fn pass(self, stream: &[u8]) -> usize {
        match self {
            Parser::Ours(profile) => decode(profile, stream),
            Parser::OurFramer => next_frames(stream),
            Parser::Framer => frame(stream, |frame| {
                black_box(frame);
            }),
            Parser::Unpacker => frame(stream, |frame| {
                black_box(unpack(&frame[5..frame.len() - 1]));
            }),
            #[cfg(feature = "peers")]
            Parser::Mavlink => mavlink::parse(stream),
        }
    }
}

/// Our decoder, as the bridge uses it.
fn decode(profile: Profile, stream: &[u8]) -> usize {
    let mut decoder = Decoder::<Downlink>::with_profile(profile);
    let mut messages = 0;
    for mut slice in stream.chunks(SLICE_LEN) {
        loop {
            let (taken, decoded) = decoder.receive(slice);
            slice = &slice[taken..];
            match decoded {
                Decoded::Incomplete => break,
                Decoded::Message(received) => {
                    black_box(&received);
                    messages += 1;
                }
                Decoded::Rejected(error) => {
                    black_box(error);
                }
            }
        }
    }
    messages
}

/// Our decoder up to the checksum, as a recorder or a relay uses it.
fn next_frames(stream: &[u8]) -> usize {
    let mut decoder = Decoder::<Downlink>::new();
    let mut messages = 0;
    for mut slice in stream.chunks(SLICE_LEN) {
        loop {
            let (taken, framed) = decoder.next_frame(slice);
            match framed {
                Framed::Incomplete => break,
                Framed::Frame(frame) => {
                    black_box(frame);
                    messages += 1;
                }
                Framed::Rejected(error) => {
                    black_box(error);
                }
            }
            slice = &slice[taken..];
        }
    }
    messages
}

/// The least that can be done: find the header, tell the length from the mask, add up, compare. No look for headers within
/// a frame, no judgement of its values, no frame that is cut by the end of a slice.
fn frame(stream: &[u8], mut take: impl FnMut(&[u8])) -> usize {
    const HEADER: u8 = 0xE9;
    let mut rest = stream;
    let mut messages = 0;
    while let Some(begin) = rest.iter().position(|byte| *byte == HEADER) {
        rest = &rest[begin..];
        let [_, high, middle, low, ..] = *rest else {
            break;
        };
        let mask = u16::from(high) << 14 | u16::from(middle) << 7 | u16::from(low);
        let len = StatusMask(mask).status_frame_len();
        let Some(frame) = rest.get(..len) else { break };
        if checksum(&frame[..len - 1]) == frame[len - 1] {
            take(frame);
            messages += 1;
            rest = &rest[len..];
        } else {
            rest = &rest[1..];
        }
    }
    messages
}

/// How many digits each value of a full status has, in order.
const DIGITS: [usize; 43] = [
    5, 5, 5, 5, 5, 5, 3, 3, 3, 1, 3, 3, 3, 3, 3, 3, 3, 3, 3, 2, 2, 2, 2, 2, 2, 3, 1, 1, 2, 2, 2, 2,
    2, 2, 2, 2, 2, 3, 3, 5, 3, 3, 3,
];

/// The numbers in the groups of a full status, neither scaled nor judged.
fn unpack(mut payload: &[u8]) -> [u32; DIGITS.len()] {
    let mut values = [0; DIGITS.len()];
    for (value, digits) in values.iter_mut().zip(DIGITS) {
        let (number, rest) = payload.split_at(digits.min(payload.len()));
        payload = rest;
        *value = number
            .iter()
            .fold(0, |value, digit| value << 7 | u32::from(*digit));
    }
    values
}

#[cfg(feature = "peers")]
mod mavlink {
    use std::hint::black_box;

    use anyhow::Result;
    use ipc_types::payload::HeroTelemetry;
    use mavlink::dialects::common::MavMessage;
    use mavlink::{MavHeader, MavlinkReader, MavlinkVersion, write_v2_msg};

    use super::FRAMES;
    use crate::mavlink_message::to_message;

    pub fn frames() -> Result<Vec<Vec<u8>>> {
        (1..=FRAMES)
            .map(|index| {
                let sample = HeroTelemetry {
                    source_sequence: index.into(),
                    published_ns: u64::from(index) * 1_000_000,
                    ..crate::stream::telemetry()
                };
                let mut frame = Vec::new();
                write_v2_msg(&mut frame, MavHeader::default(), &to_message(&sample))?;
                Ok(frame)
            })
            .collect()
    }

    pub fn parse(stream: &[u8]) -> usize {
        let mut reader = MavlinkReader::new(stream);
        let mut messages = 0;
        while let Ok(message) = reader.read_message::<MavMessage>(MavlinkVersion::V2) {
            black_box(&message);
            messages += 1;
        }
        messages
    }
}

/// Megabytes a second of one round.
fn measure(case: Case, millis: u64) -> Result<f64> {
    let mut frames = case.parser.frames()?;
    if case.is_corrupted {
        stream::corrupt(&mut frames);
    }
    let stream = frames.concat();
    // What was not parsed would be fast.
    let messages = case.parser.pass(&stream);
    let sound = if case.is_corrupted { 98 } else { 100 };
    ensure!(
        messages * 100 >= frames.len() * sound,
        "{case}: {messages} messages of {}",
        frames.len()
    );
    let begin = Instant::now();
    let mut passes = 0_u32;
    while begin.elapsed() < Duration::from_millis(millis) {
        black_box(case.parser.pass(black_box(&stream)));
        passes += 1;
    }
    let bytes = stream.len() as f64 * f64::from(passes);
    Ok(bytes / begin.elapsed().as_secs_f64() / 1e6)
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let cases: Vec<Case> = [false, true]
        .into_iter()
        .flat_map(|is_corrupted| {
            Parser::ALL.iter().map(move |parser| Case {
                parser: *parser,
                is_corrupted,
            })
        })
        .collect();
    let measured = Measured::take(&cases, args.common.rounds, |case| {
        measure(case, args.millis)
    })?;
    let mut section = Section::new("codec", "The decoder of the serial line");
    section.text(format!(
        "Full status frames of 128 bytes (134 in the extended profile) in slices of {SLICE_LEN}; unless it says *frames only*, \
         all 43 values decoded, scaled to their units and checked. The bare framer finds header and length, adds up and \
         compares, and looks at no value; *and values*: it also puts the seven-bit digits of each together, unscaled. \
         rust-mavlink parses `ODOMETRY` messages of 242 bytes. {} rounds of {} ms each, which take turns.",
        args.common.rounds, args.millis,
    ));
    let of = |case| measured.each(case, |rate| *rate);
    let rows: Vec<_> = cases.iter().map(|case| row(*case, &of(*case))).collect();
    section.table(&["parser", "MB/s", "ns a frame"], &rows);
    goals(&mut section, of);
    section.publish(args.common.out().as_deref())
}

fn row(case: Case, rates: &[f64]) -> Vec<String> {
    let rate = median(rates).unwrap_or_default();
    let len = case
        .parser
        .frames()
        .ok()
        .and_then(|frames| frames.first().map(Vec::len));
    let ns = len.unwrap_or_default() as f64 * 1000.0 / rate;
    vec![case.to_string(), format!("{rate:.0}"), format!("{ns:.0}")]
}

fn goals(section: &mut Section, of: impl Fn(Case) -> Vec<f64>) {
    let case = |parser, is_corrupted| Case {
        parser,
        is_corrupted,
    };
    let mut goal = |ours: Case, theirs: Case, bound| {
        section.goal(
            format!("{ours} / {theirs}, MB/s"),
            bound,
            Ratio::of_rounds(&of(ours), &of(theirs)),
        );
    };
    let classic = Parser::Ours(Profile::Classic);
    #[cfg(feature = "peers")]
    goal(
        case(classic, false),
        case(Parser::Mavlink, false),
        Bound::AtLeast(2.0),
    );
    for (ours, bare) in [
        (classic, Parser::Framer),
        (classic, Parser::Unpacker),
        (Parser::OurFramer, Parser::Framer),
    ] {
        goal(case(ours, false), case(bare, false), Bound::AtLeast(0.6));
    }
    for profile in Profile::ALL {
        let ours = Parser::Ours(profile);
        goal(case(ours, true), case(ours, false), Bound::AtLeast(0.9));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_parser_finds_every_sound_message() {
        for parser in Parser::ALL {
            let stream = parser.frames().unwrap().concat();
            assert_eq!(parser.pass(&stream), FRAMES as usize);
        }
    }

    #[test]
    fn the_digits_are_those_of_a_full_status() {
        let frame = stream::frame(7, true);
        // Header, mask, flags and checksum are no groups.
        let payload = &frame.as_bytes()[5..127];
        assert_eq!(DIGITS.iter().sum::<usize>(), payload.len());
        let values = unpack(payload);
        assert_eq!(values[0], 7);
        assert_eq!(values[9], 4, "the quality of the fix");
    }

    #[test]
    fn corrupted_frames_are_few_and_cost_no_others() {
        for parser in Parser::ALL {
            let mut frames = parser.frames().unwrap();
            stream::corrupt(&mut frames);
            let messages = parser.pass(&frames.concat());
            // One in a hundred, and a neighbour where a header was made or broken; some the checksum misses.
            let least = FRAMES as usize * 98 / 100;
            assert!((least..=FRAMES as usize).contains(&messages), "{messages}");
        }
    }
}
