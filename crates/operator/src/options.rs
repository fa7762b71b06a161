//! Options that several verbs take, and how their values are read: times; telemetry altitudes such as `20`, `20m` and
//! `60ft`, heights above take-off such as `+20m`, and waypoints. What only one verb takes is beside it.

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use std::time::Duration;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use ipc_types::code::SenderLost;
use ipc_types::lease::LEASES_MS;
use ipc_types::payload::MovementData;
use runtime::args::CommonArgs;
use runtime::duration::{self, DurationText};
use runtime::exit::Failure;

use crate::config::{MAX_DEADLINE_MS, MAX_TIMEOUT_S, MIN_TIMEOUT_S};

/// Longest file of waypoints or of a message definition: more than twenty times the longest path that the bridge takes.
const MAX_TEXT_BYTES: u64 = 1 << 20;

/// What each exit code means, for the end of the help.
pub const EXIT_CODES: &str = "\
Exit codes:
   0  done
   1  internal error
   2  usage error
   3  the process that should answer does not run
   4  no answer in time, or the DSP did not acknowledge
   5  refused, or ended early; the reason is printed
   6  the link to the DSP, or the relay's link to the robot, is down
   7  the outcome cannot be known
   8  something is not in order; the findings are printed
  78  the configuration is wrong";

/// What every command takes that shows the newest samples of a robot.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct SampleArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// How long to wait for a sample, such as 5s or 200ms [default: 2s, or ril.toml]
    #[arg(long, value_name = "DURATION", env = "RIL_TIMEOUT", value_parser = duration)]
    pub timeout: Option<Duration>,

    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}

/// What every command takes that asks the bridge for something.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct AskArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// How long to wait for the bridge's first answer, such as 5s or 200ms [default: 2s, or ril.toml]
    #[arg(long, value_name = "DURATION", env = "RIL_TIMEOUT", value_parser = duration)]
    pub timeout: Option<Duration>,

    /// Until how long after its issue the order may begin, such as 500ms; 0s leaves it to the bridge
    #[arg(long, value_name = "DURATION", env = "RIL_DEADLINE", value_parser = deadline_ms)]
    pub deadline: Option<u32>,

    /// Print each report as a JSON object on a line
    #[arg(long)]
    pub json: bool,
}

/// What every command takes whose request goes on for a while.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct RequestArgs {
    /// What every request takes.
    #[command(flatten)]
    pub ask: AskArgs,

    /// Return on acceptance; do not wait for completion
    #[arg(long)]
    pub no_wait: bool,
}

/// What every command takes that orders a path.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct SenderArgs {
    /// What becomes of the path when this command ends before it, also by SIGKILL: continue, hold or land [default:
    /// hold, or bridge.toml; continue with --no-wait]
    #[arg(long, value_name = "ACTION", value_parser = sender_lost())]
    pub sender_lost: Option<SenderLost>,

    /// Let the helicopter hover when this command ends before the path, whatever bridge.toml says: --sender-lost hold
    #[arg(long, conflicts_with = "sender_lost")]
    pub hold_on_exit: bool,

    /// Renew the path, at least as often as this, such as 2s: when this command hangs, or is stopped, for so long, the
    /// helicopter hovers
    #[arg(long, value_name = "DURATION", value_parser = lease_ms)]
    pub lease: Option<u32>,
}

impl SenderArgs {
    /// What becomes of the path without its sender; `None` if the bridge's configuration says it.
    pub fn action(&self) -> Option<SenderLost> {
        let hold = self.hold_on_exit.then_some(SenderLost::Hold);
        self.sender_lost.or(hold)
    }

    /// `request` of a path with what becomes of that.
    pub fn complete(&self, request: MovementData) -> MovementData {
        MovementData {
            sender_lost: self.action().map_or(0, SenderLost::code),
            lease_ms: self.lease.unwrap_or_default(),
            ..request
        }
    }

    /// The arguments of a command that does not wait for the end of its path: the path goes on without it.
    ///
    /// # Errors
    ///
    /// Code 2 when it should follow its path.
    pub fn unfollowed(&self) -> Result<SenderArgs, Failure> {
        match (self.action(), self.lease) {
            (None | Some(SenderLost::Continue), None) => Ok(SenderArgs {
                sender_lost: Some(SenderLost::Continue),
                ..SenderArgs::default()
            }),
            _ => Err(Failure::usage(
                "with --no-wait the command ends before its path: leave out --sender-lost, --hold-on-exit and --lease",
            )),
        }
    }
}

fn sender_lost() -> impl TypedValueParser<Value = SenderLost> {
    let names = SenderLost::ALL.map(SenderLost::name);
    PossibleValuesParser::new(names).try_map(|name| {
        let mut all = SenderLost::ALL.into_iter();
        all.find(|action| action.name() == name).ok_or("no action")
    })
}

/// Reads a lease, in whole ms.
fn lease_ms(text: &str) -> Result<u32, String> {
    let bounds = [*LEASES_MS.start(), *LEASES_MS.end()];
    let bounds = bounds.map(|ms| Duration::from_millis(ms.into()));
    Ok(within(duration::parse(text)?, bounds)?.as_millis() as u32)
}

/// Whether JSON is asked for, which holds for an error of the command line as well.
pub fn wants_json(args: &[OsString]) -> bool {
    let mut options = args.iter().take_while(|arg| *arg != "--");
    options.any(|arg| arg == "--json")
}

/// The text of a file that a person writes; `-` is standard input.
///
/// # Errors
///
/// Code 2 when it cannot be read, is no text, or is longer than `MAX_TEXT_BYTES`.
pub fn read_text(path: &Path) -> Result<String, Failure> {
    let name = path.display();
    let mut text = String::new();
    let read = if path == Path::new("-") {
        bounded(io::stdin().lock()).read_to_string(&mut text)
    } else {
        File::open(path).and_then(|file| bounded(file).read_to_string(&mut text))
    };
    read.map_err(|error| Failure::usage(format!("{name}: cannot be read: {error}")))?;
    match text.len() as u64 > MAX_TEXT_BYTES {
        true => Err(Failure::usage(format!(
            "{name}: longer than {MAX_TEXT_BYTES} bytes"
        ))),
        false => Ok(text),
    }
}

/// One byte more than allowed shows that there are too many.
fn bounded<R: Read>(source: R) -> io::Take<R> {
    source.take(MAX_TEXT_BYTES + 1)
}

/// Reads a finite number of at most `limit`, either way.
pub fn number(what: &str, text: &str, limit: f64) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if !number.is_finite() => Err(format!("the {what} `{text}` is not finite")),
        Ok(number) if number.abs() > limit => Err(format!(
            "the {what} {text} is out of range: it must be from -{limit} to {limit}"
        )),
        Ok(number) => Ok(number),
        Err(_) => match with_point(text) {
            Some(fixed) => Err(format!(
                "the {what} `{text}` has a decimal comma: write {fixed}"
            )),
            None => Err(format!("the {what} `{text}` is not a number")),
        },
    }
}

/// What `text` is with a decimal point, if it is a number with a decimal comma.
pub fn with_point(text: &str) -> Option<String> {
    let fixed = text.replacen(',', ".", 1);
    let is_number = fixed.parse::<f64>().is_ok_and(f64::is_finite);
    (fixed != text && is_number).then_some(fixed)
}

/// Reads how long something may take or is to go on, such as `5s` or `1m30s`.
pub fn duration(text: &str) -> Result<Duration, String> {
    let bounds = [MIN_TIMEOUT_S, MAX_TIMEOUT_S].map(Duration::from_secs_f64);
    within(duration::parse(text)?, bounds)
}

/// Reads until how long after its issue an order may begin, in whole ms; `0s` leaves it to the bridge.
pub fn deadline_ms(text: &str) -> Result<u32, String> {
    let longest = Duration::from_millis(MAX_DEADLINE_MS.into());
    let deadline = within(duration::parse(text)?, [Duration::ZERO, longest])?;
    match u32::try_from(deadline.as_millis()) {
        Ok(ms) if Duration::from_millis(ms.into()) == deadline => Ok(ms),
        _ => Err("a deadline is a whole number of milliseconds".to_owned()),
    }
}

/// `duration`, if it is from the first to the second bound.
fn within(duration: Duration, [least, most]: [Duration; 2]) -> Result<Duration, String> {
    match (least..=most).contains(&duration) {
        true => Ok(duration),
        false => Err(format!(
            "{} is out of range: it must be from {} to {}",
            DurationText(duration),
            DurationText(least),
            DurationText(most)
        )),
    }
}

/// Metres in a foot, exactly.
const FOOT_M: f64 = 0.3048;

/// An altitude as the operator gives it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Height {
    /// Telemetry altitude, m.
    Telemetry(f64),
    /// Height above take-off, m, from a plus sign in front.
    AboveTakeOff(f64),
}

impl Height {
    /// The telemetry altitude, m, when that of the ground of the take-off is `ground_m`.
    pub fn from(self, ground_m: f64) -> f64 {
        match self {
            Height::Telemetry(metres) => metres,
            Height::AboveTakeOff(metres) => ground_m + metres,
        }
    }
}

/// A waypoint of `ril goto`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Degrees to the north.
    pub latitude_deg: f64,
    /// Degrees to the east.
    pub longitude_deg: f64,
    /// How high.
    pub altitude: Height,
}

/// Reads a length in metres: a number, and `m` or `ft` behind it, without a space.
fn metres(what: &str, text: &str) -> Result<f64, String> {
    let (digits, unit_m) = match (text.strip_suffix("ft"), text.strip_suffix('m')) {
        (Some(digits), _) => (digits, FOOT_M),
        (None, Some(digits)) => (digits, 1.0),
        (None, None) => (text, 1.0),
    };
    let digits = digits.trim_end();
    match number(what, digits, f64::MAX) {
        Err(_) if digits.parse::<f64>().is_err() && with_point(digits).is_none() => Err(format!(
            "the {what} `{text}` is not a number of m or ft, such as 20m or 60ft"
        )),
        read => read.map(|value| value * unit_m),
    }
}

/// Reads a telemetry altitude such as `20`, `20m` or `60ft`, or a height above take-off such as `+20m`.
pub fn height(text: &str) -> Result<Height, String> {
    match text.trim().strip_prefix('+') {
        Some(rest) if rest.starts_with(['+', '-']) => {
            Err(format!("the altitude `{text}` has two signs"))
        }
        Some(rest) => metres("altitude", rest).map(Height::AboveTakeOff),
        None => metres("altitude", text.trim()).map(Height::Telemetry),
    }
}

/// Reads the height of a take-off, which is above take-off with and without a plus sign. Its upper limit is the DSP's,
/// which the bridge knows.
pub fn take_off_height(text: &str) -> Result<f64, String> {
    match height(text)?.from(0.0) {
        metres if metres > 0.0 => Ok(metres),
        _ => Err("the height of a take-off is greater than 0".to_owned()),
    }
}

/// A waypoint that is said by how far it is from the one before, the first by how far it is from the helicopter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// Metres to the north.
    pub north_m: f64,
    /// Metres to the east.
    pub east_m: f64,
    /// Metres up.
    pub up_m: f64,
}

/// The waypoints of a command.
#[derive(Clone, Debug, PartialEq)]
pub enum Targets {
    /// By their positions.
    At(Vec<Target>),
    /// By moves.
    By(Vec<Move>),
}

/// Longest move, m: what the geofence can judge as one leg.
const MAX_MOVE_M: f64 = 100_000.0;

/// What a waypoint looks like.
const EXPECTED: &str = "a waypoint is LAT,LON,ALT, such as 37.41,-6.01,20m";

/// The numbers of a text, apart by commas, spaces or both; a unit may stand behind a space.
fn numbers(text: &str) -> Result<Vec<String>, String> {
    let mut numbers: Vec<String> = Vec::new();
    for part in text.trim_end().trim_end_matches(',').split(',') {
        if part.trim().is_empty() {
            return Err(format!("a number is missing in `{text}`: {EXPECTED}"));
        }
        for word in part.split_whitespace() {
            match (word, numbers.last_mut()) {
                ("m" | "ft", Some(number)) => number.push_str(word),
                _ => numbers.push(word.to_owned()),
            }
        }
    }
    Ok(numbers)
}

/// Reads the three numbers of a waypoint.
fn target(numbers: &[String]) -> Result<Target, String> {
    let [latitude, longitude, altitude] = numbers else {
        return Err(not_in_threes(numbers.len()));
    };
    let swapped = || {
        let north = number("longitude", latitude, 180.0);
        let east = number("latitude", longitude, 90.0);
        match north.and(east) {
            Ok(_) => "; are latitude and longitude swapped?",
            Err(_) => "",
        }
    };
    Ok(Target {
        latitude_deg: number("latitude", latitude, 90.0).map_err(|reason| reason + swapped())?,
        longitude_deg: number("longitude", longitude, 180.0)?,
        altitude: height(altitude)?,
    })
}

/// The waypoints of the words of a command line. None without words: they come from a file.
pub fn targets(words: &[String]) -> Result<Targets, String> {
    if words.is_empty() {
        return Ok(Targets::At(Vec::new()));
    }
    if let Some(moves) = moves(words)? {
        return Ok(Targets::By(moves));
    }
    if let Some((word, fixed)) = decimal_comma(words) {
        return Err(format!("`{word}` has a decimal comma: write {fixed}"));
    }
    let numbers = numbers(&words.join(" "))?;
    match numbers.len() % 3 {
        0 => numbers
            .chunks(3)
            .map(target)
            .collect::<Result<_, _>>()
            .map(Targets::At),
        _ => Err(not_in_threes(numbers.len())),
    }
}

/// The first number with a decimal comma, where three words are a waypoint and each is a number, most of them with a
/// comma and none with a point.
fn decimal_comma(words: &[String]) -> Option<(&str, String)> {
    let bare = |word: &str| word.trim_end_matches(['m', 'f', 't']).to_owned();
    let is_number = |word: &String| {
        let bare = bare(word);
        !bare.contains('.') && (with_point(&bare).is_some() || bare.parse::<f64>().is_ok())
    };
    let fixed = |word: &String| with_point(&bare(word));
    let are_numbers = words.len().is_multiple_of(3) && words.iter().all(is_number);
    let commas = words.iter().filter(|word| word.contains(',')).count();
    let first = words
        .iter()
        .find_map(|word| Some((word.as_str(), fixed(word)?)))?;
    (are_numbers && commas * 2 > words.len()).then_some(first)
}

/// Whether the numbers of one waypoint are a move: each has its sign, and what could be a position too has units.
///
/// # Errors
///
/// They could be either.
fn is_move(numbers: &[&str]) -> Result<bool, String> {
    let (Some(first), Some(second)) = (numbers.first(), numbers.get(1)) else {
        return Ok(false);
    };
    let has_sign = |number: &&str| number.starts_with(['+', '-']);
    let has_unit = |number: &str| number.ends_with('m') || number.ends_with("ft");
    if numbers.len() > 3 || !numbers.iter().all(has_sign) {
        return Ok(false);
    }
    let has_plus = first.starts_with('+') || second.starts_with('+');
    match (numbers.len(), has_unit(first) && has_unit(second)) {
        (_, true) => Ok(true),
        (2, _) if has_plus => Ok(true),
        // A position with its height above take-off.
        (3, _) if !first.starts_with('+') => Ok(false),
        _ => Err(format!(
            "`{}` is a position or a move: write a move with units, such as +50m,-20m or +50m,-20m,+5m, and a position without a plus \
             sign before the latitude and with an altitude",
            numbers.join(",")
        )),
    }
}

/// The moves of the words of a command line; `None` if they are positions.
fn moves(words: &[String]) -> Result<Option<Vec<Move>>, String> {
    let text = words.join(" ").replace(", ", ",");
    let mut groups: Vec<Vec<&str>> = text
        .split_whitespace()
        .map(|group| group.trim_end_matches(',').split(',').collect())
        .collect();
    if groups.iter().all(|group| group.len() == 1) {
        groups = vec![groups.concat()];
    }
    let are_moves: Vec<bool> = groups
        .iter()
        .map(|group| is_move(group))
        .collect::<Result<_, _>>()?;
    if !are_moves.contains(&true) {
        return Ok(None);
    }
    if are_moves.contains(&false) {
        return Err("a path has positions or moves, and not both".to_owned());
    }
    let move_of = |group: Vec<&str>| {
        let along = |place: usize, what: &str| match group.get(place) {
            Some(text) => metres(what, text).and_then(|metres| {
                let is_short = metres.abs() <= MAX_MOVE_M;
                is_short.then_some(metres).ok_or_else(|| {
                    format!("the {what} {text} is out of range: at most {MAX_MOVE_M} m")
                })
            }),
            None => Ok(0.0),
        };
        Ok(Move {
            north_m: along(0, "way north")?,
            east_m: along(1, "way east")?,
            up_m: along(2, "way up")?,
        })
    };
    groups
        .into_iter()
        .map(move_of)
        .collect::<Result<_, _>>()
        .map(Some)
}

fn not_in_threes(count: usize) -> String {
    let numbers = crate::render::words::count(count, "number");
    format!("{numbers}, each waypoint needs three: {EXPECTED}")
}

/// Reads the waypoints of a file: one `LAT,LON,ALT` a line, `#` begins a comment.
///
/// # Errors
///
/// The first line that is wrong, with its number and the reason; also when there is no waypoint at all.
pub fn waypoints(text: &str) -> Result<Vec<Target>, String> {
    let mut waypoints = Vec::new();
    // Editors on Windows begin a file with a byte order mark.
    let text = text.trim_start_matches('\u{feff}');
    // Every system's ends of lines.
    let text = text.replace("\r\n", "\n").replace('\r', "\n");
    for (index, line) in text.lines().enumerate() {
        let words = line
            .split('#')
            .next()
            .unwrap_or_default()
            .split_whitespace();
        let words: Vec<String> = words.map(str::to_owned).collect();
        let wrong = |reason: &str| format!("line {}: {reason}", index + 1);
        match targets(&words).map_err(|reason| wrong(&reason))? {
            Targets::By(_) => return Err(wrong("a move; a file has positions alone")),
            Targets::At(targets) if targets.len() > 1 => {
                return Err(wrong(&not_in_threes(3 * targets.len())));
            }
            Targets::At(targets) => waypoints.extend(targets),
        }
    }
    match waypoints.is_empty() {
        true => Err("there is no waypoint".to_owned()),
        false => Ok(waypoints),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_units_and_bounds() {
        assert_eq!(duration("1m30s"), Ok(Duration::from_secs(90)));
        assert_eq!(duration("10ms"), Ok(Duration::from_millis(10)));
        for (text, expected) in [
            ("5", "`5` has no unit: write 5s"),
            ("9ms", "9ms is out of range: it must be from 10ms to 24h"),
            ("24h1s", "24h1s is out of range"),
        ] {
            let error = duration(text).unwrap_err();
            assert!(error.contains(expected), "{text}: {error}");
        }
        assert_eq!(deadline_ms("0s"), Ok(0));
        assert_eq!(deadline_ms("1.5s"), Ok(1_500));
        for (text, expected) in [
            ("50", "write 50s or 50ms"),
            ("0.5ms", "whole number of milliseconds"),
            ("25h", "from 0s to 24h"),
        ] {
            let error = deadline_ms(text).unwrap_err();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }

    #[test]
    fn altitudes_have_units_and_may_be_relative() {
        for (text, expected) in [
            ("20", Height::Telemetry(20.0)),
            ("20m", Height::Telemetry(20.0)),
            ("20 m", Height::Telemetry(20.0)),
            ("100ft", Height::Telemetry(30.48)),
            ("-5m", Height::Telemetry(-5.0)),
            ("+20m", Height::AboveTakeOff(20.0)),
            ("+100ft", Height::AboveTakeOff(30.48)),
        ] {
            assert_eq!(height(text), Ok(expected), "{text}");
        }
        for (text, expected) in [
            ("", "`` is not a number of m or ft"),
            ("m", "`m` is not a number"),
            ("20km", "`20km` is not a number of m or ft, such as 20m"),
            ("20mm", "`20mm` is not a number"),
            ("10,5", "`10,5` has a decimal comma: write 10.5"),
            ("+10,5m", "`10,5` has a decimal comma: write 10.5"),
            ("+-20m", "two signs"),
            ("++2", "two signs"),
            ("infm", "not finite"),
        ] {
            let error = height(text).unwrap_err();
            assert!(error.contains(expected), "{text}: {error}");
        }
        assert_eq!(Height::AboveTakeOff(20.0).from(12.5), 32.5);
        assert_eq!(Height::Telemetry(20.0).from(12.5), 20.0);
        assert!(take_off_height("0ft").is_err());
    }

    #[test]
    fn a_file_of_waypoints_that_an_editor_on_windows_saved_is_the_same_file() {
        let plain = waypoints("# home\n37.4112,-6.0010,25\n37.4113 -6.0010 26\n").unwrap();
        let windows = "\u{feff}# home\r\n37.4112,-6.0010,25\r\n37.4113 -6.0010 26\r\n";
        assert_eq!(waypoints(windows), Ok(plain));
        let first = waypoints("\u{feff}37.4112,-6.0010,25\r\n").unwrap();
        assert_eq!(first[0].latitude_deg, 37.4112);
    }

    #[test]
    fn a_line_of_a_file_is_read_as_a_command_line_is() {
        let first = "37.411,-6.001,20";
        for text in [
            "37.411 -6.001 20\r# a gate\r37.412,-6.001,20 # the last\r",
            "\u{feff}37.411, -6.001, 20\r\n\r\n37.412,-6.001,20",
        ] {
            assert_eq!(waypoints(text).map(|read| read.len()), Ok(2), "{text:?}");
        }
        for (line, expected) in [
            ("+50m,-20m", "line 2: a move"),
            ("+50,-20,+5", "line 2: `+50,-20,+5` is a position or a move"),
            ("37,411 -6,001 20", "line 2: `37,411` has a decimal comma"),
            (
                "37.4,-6.0,20 37.5,-6.0,20",
                "line 2: 6 numbers, each waypoint",
            ),
        ] {
            let error = waypoints(&format!("{first}\r{line}\r")).unwrap_err();
            assert!(error.starts_with(expected), "{line}: {error}");
        }
    }

    #[test]
    fn waypoints_are_three_numbers_each_apart_by_commas_or_spaces() {
        let parse = |words: &[&str]| {
            let words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
            targets(&words)
        };
        let first = Target {
            latitude_deg: -37.5,
            longitude_deg: -6.25,
            altitude: Height::AboveTakeOff(3.0),
        };
        let second = Target {
            altitude: Height::Telemetry(20.0),
            ..first
        };
        for words in [
            &["-37.5", "-6.25", "+3m"][..],
            &["-37.5,-6.25,+3m"],
            &["-37.5,", "-6.25,", "+3m"],
            &["-37.5, -6.25, +3 m"],
            &["-37.5,", "-6.25,", "+3", "m,"],
        ] {
            assert_eq!(parse(words), Ok(Targets::At(vec![first])), "{words:?}");
        }
        for words in [
            &["-37.5,-6.25,+3m", "-37.5,-6.25,20"][..],
            &["-37.5", "-6.25", "+3", "-37.5", "-6.25", "20"],
            &["-37.5,", "-6.25,", "+3,", "-37.5,", "-6.25,", "20"],
        ] {
            let both = Targets::At(vec![first, second]);
            assert_eq!(parse(words), Ok(both), "{words:?}");
        }
        assert_eq!(parse(&[]), Ok(Targets::At(vec![])), "they come from a file");
        for (words, expected) in [
            (&["37"][..], "1 number, each waypoint needs three"),
            (&["37", "-6"], "2 numbers, each waypoint needs three"),
            (
                &["37", "-6", "20", "37"],
                "4 numbers, each waypoint needs three",
            ),
            (&["37,,20"], "a number is missing in `37,,20`"),
            (&[""], "a number is missing"),
            (&["37m", "-6", "20"], "the latitude `37m` is not a number"),
            (
                &["37,4112", "-6,0010", "25"],
                "`37,4112` has a decimal comma: write 37.4112",
            ),
            (
                &["37,4112", "-6,0010", "25,5m"],
                "`37,4112` has a decimal comma: write 37.4112",
            ),
            (&["97", "-96", "20"], "from -90 to 90"),
            (
                &["-106.5", "37.2", "20"],
                "from -90 to 90; are latitude and longitude swapped?",
            ),
            (&["37", "-186", "20"], "the longitude -186 is out of range"),
            (&["north", "-6", "20"], "the latitude `north` is not"),
        ] {
            let error = parse(words).unwrap_err();
            assert!(error.contains(expected), "{words:?}: {error}");
        }
        assert!(!parse(&["97", "-96", "20"]).unwrap_err().contains("swapped"));
    }

    #[test]
    fn moves_have_signs_and_what_could_be_a_position_too_is_refused() {
        let parse = |words: &[&str]| {
            let words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
            targets(&words)
        };
        let by = |north_m, east_m, up_m| Move {
            north_m,
            east_m,
            up_m,
        };
        for (words, expected) in [
            (&["+50,-20"][..], vec![by(50.0, -20.0, 0.0)]),
            (&["+50,", "-20"], vec![by(50.0, -20.0, 0.0)]),
            (&["+50", "-20"], vec![by(50.0, -20.0, 0.0)]),
            (&[" -50,+20"], vec![by(-50.0, 20.0, 0.0)]),
            (&["-50m,-20m"], vec![by(-50.0, -20.0, 0.0)]),
            (&["+50m,-20m,+10ft"], vec![by(50.0, -20.0, 3.048)]),
            (
                &["+5,+0", "+0,+5"],
                vec![by(5.0, 0.0, 0.0), by(0.0, 5.0, 0.0)],
            ),
        ] {
            assert_eq!(parse(words), Ok(Targets::By(expected)), "{words:?}");
        }
        for (words, expected) in [
            (&["-37.5,-6.25"][..], "is a position or a move"),
            (&["+37.41,-6.01,+20"], "is a position or a move"),
            (
                &["+5,+5", "37.41,-6.01,20"],
                "positions or moves, and not both",
            ),
            (&["+5,+x"], "the way east `+x` is not a number"),
            (&["+200000,+0"], "out of range"),
        ] {
            let error = parse(words).unwrap_err();
            assert!(error.contains(expected), "{words:?}: {error}");
        }
        for words in [&["-37.5,-6.25,+3m"][..], &["+37.41,-6.01,20"]] {
            assert!(matches!(parse(words), Ok(Targets::At(_))), "{words:?}");
        }
    }

    #[test]
    fn a_file_has_a_waypoint_a_line_and_comments() {
        let text = "# a square\n37,-6,20\n\n  -37.5 , .5,+1e1 # the corner\n";
        let read = waypoints(text).unwrap();
        let altitudes: Vec<Height> = read.iter().map(|waypoint| waypoint.altitude).collect();
        assert_eq!(
            altitudes,
            [Height::Telemetry(20.0), Height::AboveTakeOff(10.0)]
        );
        for (text, expected) in [
            (
                "37,-6,20\n\n91,0,0\n",
                "line 3: the latitude 91 is out of range",
            ),
            ("37,-6\n", "line 1: 2 numbers, each waypoint"),
            ("37,-6,20 38,-6,20\n", "line 1: 6 numbers, each waypoint"),
            ("# nothing\n", "there is no waypoint"),
            ("", "there is no waypoint"),
        ] {
            let error = waypoints(text).unwrap_err();
            assert!(error.contains(expected), "{text:?}: {error}");
        }
    }
}
