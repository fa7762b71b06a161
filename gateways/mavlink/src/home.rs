//! [`Home`]: where the flight began, or what an operator has set as home.
//!
//! | home | on the ground | in the air | an operator sets it |
//! |---|---|---|---|
//! | unknown, first heard | → ground | → first heard, once | → operator |
//! | ground | follows | → take-off | → operator |
//! | take-off | → ground | stays | → operator |
//! | operator | stays | stays | → operator |
//!
//! [`KeptHome`] outlives the gateway: that of a take-off until the helicopter lands, that of an operator as long as the bridge lives.

use ipc_types::MonotonicNs;
use ipc_types::payload::WaypointPosition;

/// See the module's documentation. Altitudes have telemetry's zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Home {
    /// No position has come yet.
    #[default]
    Unknown,
    /// Where the helicopter was when it was first heard, in the air: for display only.
    FirstHeard(WaypointPosition),
    /// Where it stands.
    Ground(WaypointPosition),
    /// Where it took off.
    TakeOff(WaypointPosition),
    /// What an operator has set.
    Operator(WaypointPosition),
}

impl Home {
    /// A position has come.
    pub fn follow(&mut self, position: WaypointPosition, is_flying: bool) {
        *self = match (*self, is_flying) {
            (Home::Operator(set), _) => Home::Operator(set),
            (_, false) => Home::Ground(position),
            (Home::Unknown, true) => Home::FirstHeard(position),
            (Home::Ground(ground), true) => Home::TakeOff(ground),
            (known, true) => known,
        };
    }

    /// What is shown.
    pub fn shown(&self) -> Option<WaypointPosition> {
        match *self {
            Home::Unknown => None,
            Home::FirstHeard(position) => Some(position),
            _ => self.known(),
        }
    }

    /// What a helicopter may return to, and what heights are relative to.
    pub fn known(&self) -> Option<WaypointPosition> {
        match *self {
            Home::Unknown | Home::FirstHeard(_) => None,
            Home::Ground(position) | Home::TakeOff(position) | Home::Operator(position) => {
                Some(position)
            }
        }
    }
}

/// Longest file of a home that is kept.
pub const MAX_HOME_BYTES: usize = 512;

/// How the file of a home begins, and its version.
const HEAD: [&str; 2] = ["ril-home", "1"];

/// A home that is kept over restarts of the gateway.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeptHome {
    /// Where it is.
    pub position: WaypointPosition,
    /// On which ground, by telemetry's altitude, the flight began that it belongs to; `None` if an operator has set it, for all flights.
    pub ground_altitude_m: Option<f64>,
}

impl KeptHome {
    /// The file: one line. `bridge` numbers the run of the bridge that it belongs to.
    pub fn encode(&self, bridge: u64) -> String {
        let WaypointPosition {
            latitude_deg,
            longitude_deg,
            altitude_m,
        } = self.position;
        let ground = match self.ground_altitude_m {
            Some(ground_altitude_m) => ground_altitude_m.to_string(),
            None => "operator".to_owned(),
        };
        let [head, version] = HEAD;
        format!("{head} {version} {bridge} {latitude_deg} {longitude_deg} {altitude_m} {ground}\n")
    }

    /// The home of a file; `None` if it belongs to another run of the bridge, or none is kept.
    ///
    /// # Errors
    ///
    /// Why it is no file of a home, as a clause.
    pub fn decode(bytes: &[u8], bridge: u64) -> Result<Option<KeptHome>, String> {
        let text = str::from_utf8(bytes).map_err(|_| "it is no text".to_owned())?;
        let words: Vec<&str> = text.split_whitespace().collect();
        let number = |word: &str| {
            let number = word.parse().ok().filter(|number: &f64| number.is_finite());
            number.ok_or_else(|| format!("`{word}` is no number"))
        };
        let rest = match words.as_slice() {
            [] => return Ok(None),
            [head, version, rest @ ..] if [*head, *version] == HEAD => rest,
            [head, ..] if *head == HEAD[0] => return Err("it is of another version".to_owned()),
            _ => return Err("it is no home".to_owned()),
        };
        let [run, latitude, longitude, altitude, ground] = rest else {
            return Err("it is cut short".to_owned());
        };
        let position = WaypointPosition {
            latitude_deg: number(latitude)?,
            longitude_deg: number(longitude)?,
            altitude_m: number(altitude)?,
        };
        if position.latitude_deg.abs() > 90.0 || position.longitude_deg.abs() > 180.0 {
            return Err("that is no place".to_owned());
        }
        let ground_altitude_m = match *ground {
            "operator" => None,
            ground => Some(number(ground)?),
        };
        let kept = KeptHome {
            position,
            ground_altitude_m,
        };
        Ok((*run == bridge.to_string()).then_some(kept))
    }
}

/// What of home is on the disk, and what an earlier gateway has left there.
#[derive(Clone, Debug, Default)]
pub struct HomeKeeper {
    /// What is kept.
    pub kept: Option<KeptHome>,
    /// When it was.
    pub at: Option<MonotonicNs>,
    /// What was kept of a flight before this gateway began; nothing has said yet whether that flight goes on.
    pub before: Option<KeptHome>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kept_home_is_read_again_and_what_is_none_is_refused() {
        let position = WaypointPosition {
            latitude_deg: -37.411_200_1,
            longitude_deg: -6.001,
            altitude_m: 1e-9,
        };
        for ground_altitude_m in [None, Some(-30.001)] {
            let kept = KeptHome {
                position,
                ground_altitude_m,
            };
            let text = kept.encode(u64::MAX);
            assert!(text.len() < MAX_HOME_BYTES);
            let read = |bridge| KeptHome::decode(text.as_bytes(), bridge);
            assert_eq!(read(u64::MAX), Ok(Some(kept)));
            assert_eq!(read(7), Ok(None), "the bridge has begun anew");
            for length in 1..text.len() - 9 {
                let cut = KeptHome::decode(&text.as_bytes()[..length], u64::MAX);
                assert!(cut.is_err(), "{length}");
            }
        }
        assert_eq!(KeptHome::decode(b"", 7), Ok(None));
        for wrong in [
            "ril-home 2 7 1 2 3 4",
            "ril-home 1 7 NaN 2 3 4",
            "ril-home 1 7 91 2 3 4",
            "ril-home 1 7 1 181 3 4",
            "ril-home 1 7 1 2 inf 4",
            "ril-home 1 7 1 2 3 pilot",
            "ril-home 1 7 1 2 3 4 5",
            "RILM",
            "\u{1f681}",
        ] {
            assert!(KeptHome::decode(wrong.as_bytes(), 7).is_err(), "{wrong}");
        }
        assert!(KeptHome::decode(&[0xff], 7).is_err());
    }

    #[test]
    fn each_state_and_each_event() {
        let at = |latitude_deg| WaypointPosition {
            latitude_deg,
            longitude_deg: 0.0,
            altitude_m: 0.0,
        };
        let (old, new) = (at(1.0), at(2.0));
        // Before, after a position on the ground, after one in the air.
        let table = [
            (Home::Unknown, Home::Ground(new), Home::FirstHeard(new)),
            (
                Home::FirstHeard(old),
                Home::Ground(new),
                Home::FirstHeard(old),
            ),
            (Home::Ground(old), Home::Ground(new), Home::TakeOff(old)),
            (Home::TakeOff(old), Home::Ground(new), Home::TakeOff(old)),
            (
                Home::Operator(old),
                Home::Operator(old),
                Home::Operator(old),
            ),
        ];
        for (before, on_ground, in_air) in table {
            for (is_flying, expected) in [(false, on_ground), (true, in_air)] {
                let mut home = before;
                home.follow(new, is_flying);
                assert_eq!(home, expected, "{before:?}, flying: {is_flying}");
            }
        }
        assert_eq!(Home::FirstHeard(old).known(), None);
        assert_eq!(Home::FirstHeard(old).shown(), Some(old));
    }
}
