//! Altitudes and waypoints of the command line: telemetry altitudes such as `20`, `20m` and `60ft`, and heights above take-off such as
//! `+20m`.

use super::number;

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

/// One word of `ril goto`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GotoWord {
    /// `LAT,LON,ALT`
    Target(Target),
    /// `LAT`, `LON` or `ALT`.
    Single {
        /// As a coordinate, if the word is one.
        coordinate: Option<f64>,
        /// As an altitude.
        altitude: Height,
    },
}

/// Reads a length in metres: a number, and `m` or `ft` behind it, without a space.
fn metres(what: &str, text: &str) -> Result<f64, String> {
    let (digits, unit_m) = match (text.strip_suffix("ft"), text.strip_suffix('m')) {
        (Some(digits), _) => (digits, FOOT_M),
        (None, Some(digits)) => (digits, 1.0),
        (None, None) => (text, 1.0),
    };
    number(what, digits.trim_end(), f64::MAX).map(|value| value * unit_m)
}

/// Reads a telemetry altitude such as `20`, `20m` or `60ft`, or a height above take-off such as `+20m`.
pub(crate) fn height(text: &str) -> Result<Height, String> {
    match text.trim().strip_prefix('+') {
        Some(rest) if rest.starts_with(['+', '-']) => {
            Err(format!("the altitude `{text}` has two signs"))
        }
        Some(rest) => metres("altitude", rest).map(Height::AboveTakeOff),
        None => metres("altitude", text.trim()).map(Height::Telemetry),
    }
}

/// Reads the height of a take-off, which is above take-off with and without a plus sign. Its upper limit is the DSP's, which the
/// bridge knows.
pub(crate) fn take_off_height(text: &str) -> Result<f64, String> {
    match height(text)?.from(0.0) {
        metres if metres > 0.0 => Ok(metres),
        _ => Err("the height of a take-off is greater than 0".to_owned()),
    }
}

/// Reads `LAT,LON,ALT`.
pub(crate) fn target(text: &str) -> Result<Target, String> {
    const EXPECTED: &str = "a waypoint is LAT,LON,ALT, such as 37.41,-6.01,20m";
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let [latitude, longitude, altitude] = parts[..] else {
        return Err(format!(
            "{} numbers, three are needed: {EXPECTED}",
            parts.len()
        ));
    };
    Ok(Target {
        latitude_deg: number("latitude", latitude, 90.0)?,
        longitude_deg: number("longitude", longitude, 180.0)?,
        altitude: height(altitude)?,
    })
}

/// Reads one word of `ril goto`.
pub(crate) fn goto_word(text: &str) -> Result<GotoWord, String> {
    if text.contains(',') {
        return target(text).map(GotoWord::Target);
    }
    Ok(GotoWord::Single {
        coordinate: text.trim().parse().ok().filter(|value: &f64| value.is_finite()),
        altitude: height(text).map_err(|_| {
            format!("`{text}` is neither LAT,LON,ALT nor a number: a waypoint is 37.41,-6.01,20m or 37.41 -6.01 20m")
        })?,
    })
}

/// The waypoints of all words: each of them one, or three of them together.
pub(crate) fn targets(words: &[GotoWord]) -> Result<Vec<Target>, String> {
    let whole = words.iter().map(|word| match word {
        GotoWord::Target(target) => Some(*target),
        GotoWord::Single { .. } => None,
    });
    if let Some(targets) = whole.collect() {
        return Ok(targets);
    }
    let [
        GotoWord::Single {
            coordinate: Some(latitude_deg),
            ..
        },
        GotoWord::Single {
            coordinate: Some(longitude_deg),
            ..
        },
        GotoWord::Single { altitude, .. },
    ] = *words
    else {
        return Err(
            "give each waypoint as LAT,LON,ALT without spaces, or one waypoint as LAT LON ALT, such as 37.41 -6.01 20m"
                .to_owned(),
        );
    };
    let in_range = |what: &str, value: f64, limit| number(what, &value.to_string(), limit);
    Ok(vec![Target {
        latitude_deg: in_range("latitude", latitude_deg, 90.0)?,
        longitude_deg: in_range("longitude", longitude_deg, 180.0)?,
        altitude,
    }])
}

/// Reads the waypoints of a file: one `LAT,LON,ALT` a line, `#` begins a comment.
///
/// # Errors
///
/// The first line that is wrong, with its number and the reason; also when there is no waypoint at all.
pub fn waypoints(text: &str) -> Result<Vec<Target>, String> {
    let mut waypoints = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if !line.is_empty() {
            let read = target(line).map_err(|reason| format!("line {}: {reason}", index + 1));
            waypoints.push(read?);
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
            ("", "`` is not a number"),
            ("m", "`` is not a number"),
            ("20km", "`20k` is not a number"),
            ("20mm", "`20m` is not a number"),
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
    fn one_waypoint_may_be_three_words() {
        let parse = |words: &[&str]| -> Result<Vec<Target>, String> {
            let words: Result<Vec<_>, _> = words.iter().map(|word| goto_word(word)).collect();
            targets(&words?)
        };
        let expected = Target {
            latitude_deg: -37.5,
            longitude_deg: -6.25,
            altitude: Height::AboveTakeOff(3.0),
        };
        assert_eq!(parse(&["-37.5", "-6.25", "+3m"]), Ok(vec![expected]));
        assert_eq!(parse(&["-37.5,-6.25,+3m"]), Ok(vec![expected]));
        for (words, expected) in [
            (&["37", "-6"][..], "LAT LON ALT"),
            (&["37", "-6", "20", "37"], "LAT LON ALT"),
            (&["37,-6,20", "37"], "LAT LON ALT"),
            (&["37m", "-6", "20"], "LAT LON ALT"),
            (&["97", "-6", "20"], "the latitude 97 is out of range"),
            (&["37", "-186", "20"], "the longitude -186 is out of range"),
            (&["north", "-6", "20"], "`north` is neither"),
        ] {
            let error = parse(words).unwrap_err();
            assert!(error.contains(expected), "{words:?}: {error}");
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
            ("37,-6\n", "line 1: 2 numbers, three are needed"),
            ("# nothing\n", "there is no waypoint"),
            ("", "there is no waypoint"),
        ] {
            let error = waypoints(text).unwrap_err();
            assert!(error.contains(expected), "{text:?}: {error}");
        }
    }
}
