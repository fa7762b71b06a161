//! `codec`: how fast the decoder of the serial line takes full status frames.

use std::fmt;
use std::hint::black_box;
use std::time::{Duration, Instant};

use anyhow::{Result, ensure};
use dsp_protocol::{Decoded, Decoder, Downlink, Profile, StatusMask, checksum};
use measure::median;

use super::Common;
use crate::measured::{Measured, Ratio, Round};
use crate::report::{Bound, Section};
use crate::stream;

/// Frames of one pass: 256 kB, which lie in the second cache as bytes do that have just been read.
const FRAMES: u32 = 2000;

/// Bytes of one slice: those of one read of the bridge.
const SLICE_LEN: usize = 4096;

/// The quantity that is measured.
const RATE: &str = "MB/s";

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
    /// The least that finds and checks frames, and unpacks every value.
    Bare,
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
        f.write_str(match self.parser {
            Parser::Ours(Profile::Classic) => "RIL, classic",
            Parser::Ours(Profile::Extended) => "RIL, extended",
            Parser::Bare => "bare framer with checksum and values",
            #[cfg(feature = "peers")]
            Parser::Mavlink => "rust-mavlink, ODOMETRY",
        })?;
        match self.is_corrupted {
            true => f.write_str(", 1 % corrupted"),
            false => Ok(()),
        }
    }
}

impl Parser {
    const ALL: &[Parser] = &[
        Parser::Ours(Profile::Classic),
        Parser::Ours(Profile::Extended),
        Parser::Bare,
        #[cfg(feature = "peers")]
        Parser::Mavlink,
    ];

    fn frames(self) -> Result<Vec<Vec<u8>>> {
        match self {
            Parser::Ours(profile) => Ok(stream::frames(profile, FRAMES)),
            Parser::Bare => Ok(stream::frames(Profile::Classic, FRAMES)),
            #[cfg(feature = "peers")]
            Parser::Mavlink => mavlink::frames(),
        }
    }

    /// Parses `stream` once and says how many messages that gave.
    fn pass(self, stream: &[u8]) -> usize {
        match self {
            Parser::Ours(profile) => decode(profile, stream),
            Parser::Bare => unpack_all(stream),
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

/// The least that can be done: find the header, read the length from the mask, add up, compare, put the digits
/// together. No look for headers within a frame, no judgement of its values, no frame that is cut by the end of a
/// slice.
fn unpack_all(stream: &[u8]) -> usize {
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
            black_box(unpack(&frame[5..len - 1]));
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
    use mavlink::dialects::common::MavMessage;
    use mavlink::{MavHeader, MavlinkReader, MavlinkVersion, write_v2_msg};

    use super::FRAMES;
    use crate::peers::Mark;
    use crate::peers::network::odometry;

    pub fn frames() -> Result<Vec<Vec<u8>>> {
        let frame = |index: u32| {
            let mut sample = crate::stream::telemetry();
            let mark = Mark {
                index: index.into(),
                sent_ns: u64::from(index) * 1_000_000,
            };
            mark.stamp(&mut sample);
            let mut frame = Vec::new();
            write_v2_msg(&mut frame, MavHeader::default(), &odometry(&sample))?;
            Ok(frame)
        };
        (1..=FRAMES).map(frame).collect()
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
fn measure(case: Case, millis: u64) -> Result<Round> {
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
    let mut round = Round::default();
    round.add_figure("", RATE, bytes / begin.elapsed().as_secs_f64() / 1e6);
    Ok(round)
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let of = |is_corrupted| {
        Parser::ALL.iter().map(move |&parser| Case {
            parser,
            is_corrupted,
        })
    };
    let cases: Vec<Case> = of(false).chain(of(true)).collect();
    let measured = Measured::take(&cases, args.common.rounds, |case| {
        measure(case, args.millis)
    })?;
    let mut section = Section::new("codec", "The decoder of the serial line");
    section.text(format!(
        "Full status frames of 128 bytes (134 in the extended profile) in slices of {SLICE_LEN}; all 43 values decoded, scaled to \
         their units and checked. The bare framer finds header and length, adds up and compares, and puts the seven-bit digits of \
         each value together, unscaled and unchecked. rust-mavlink parses `ODOMETRY` messages of 242 bytes. {} rounds of {} ms each, \
         which take turns.",
        args.common.rounds, args.millis,
    ));
    let of = |case| measured.figures(case, "", RATE);
    let row = |case: &Case| {
        let rate = median(&of(*case)).unwrap_or_default();
        let frames = case.parser.frames()?;
        let ns = frames.first().map_or(0, Vec::len) as f64 * 1000.0 / rate;
        Ok(vec![
            case.to_string(),
            format!("{rate:.0}"),
            format!("{ns:.0}"),
        ])
    };
    let rows = cases.iter().map(row).collect::<Result<Vec<_>>>()?;
    section.table(&["parser", RATE, "ns a frame"], &rows);
    goals(&mut section, of);
    section.publish(args.common.out().as_deref())
}

fn goals(section: &mut Section, of: impl Fn(Case) -> Vec<f64>) {
    let case = |parser, is_corrupted| Case {
        parser,
        is_corrupted,
    };
    let mut goal = |ours: Case, theirs: Case, least| {
        section.goal(
            format!("{ours} / {theirs}, {RATE}"),
            Bound::AtLeast(least),
            Ratio::of_rounds(&of(ours), &of(theirs)),
        );
    };
    let classic = case(Parser::Ours(Profile::Classic), false);
    #[cfg(feature = "peers")]
    goal(classic, case(Parser::Mavlink, false), 2.0);
    goal(classic, case(Parser::Bare, false), 0.6);
    for profile in Profile::ALL {
        let ours = Parser::Ours(profile);
        goal(case(ours, true), case(ours, false), 0.9);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_parser_finds_every_sound_message_and_a_corrupted_one_costs_no_others() {
        for parser in Parser::ALL {
            let mut frames = parser.frames().unwrap();
            assert_eq!(parser.pass(&frames.concat()), FRAMES as usize);
            stream::corrupt(&mut frames);
            let messages = parser.pass(&frames.concat());
            // One in a hundred, and a neighbour where a header was made or broken; some the checksum misses.
            let least = FRAMES as usize * 98 / 100;
            assert!((least..=FRAMES as usize).contains(&messages), "{messages}");
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
}
