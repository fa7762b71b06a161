//! [`Home`]: where the helicopter stands, and in the air where it took off, as the bridge says; or what an operator has
//! set as home.
//!
//! [`KeptHome`], an operator's, outlives the gateway as long as the bridge lives.

use ipc_types::MonotonicNs;
use ipc_types::payload::WaypointPosition;

/// Where the helicopter's home is. Altitudes have telemetry's zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Home {
    /// The bridge has not seen the helicopter on the ground.
    #[default]
    Unknown,
    /// Where it stands, or took off.
    Ground(WaypointPosition),
    /// What an operator has set.
    Operator(WaypointPosition),
}

impl Home {
    /// The bridge says where home is, or that it does not know.
    pub fn follow(&mut self, home: Option<WaypointPosition>) {
        if !matches!(self, Home::Operator(_)) {
            *self = home.map_or(Home::Unknown, Home::Ground);
        }
    }

    /// What a helicopter may return to, and what heights are relative to.
    pub fn known(&self) -> Option<WaypointPosition> {
        match *self {
            Home::Unknown => None,
            Home::Ground(position) | Home::Operator(position) => Some(position),
        }
    }
}

/// Longest file of a home that is kept.
pub const MAX_HOME_BYTES: usize = 512;

/// How the file of a home begins, and its version.
const HEAD: [&str; 2] = ["ril-home", "1"];

/// A home of an operator that is kept over restarts of the gateway.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeptHome {
    /// Where it is.
    pub position: WaypointPosition,
}

impl KeptHome {
    /// The file: one line. `bridge` numbers the run of the bridge that it belongs to.
    pub fn encode(&self, bridge: u64) -> String {
        let WaypointPosition {
            latitude_deg,
            longitude_deg,
            altitude_m,
        } = self.position;
        let [head, version] = HEAD;
        format!("{head} {version} {bridge} {latitude_deg} {longitude_deg} {altitude_m}\n")
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
        let [run, latitude, longitude, altitude] = rest else {
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
        let kept = KeptHome { position };
        Ok((*run == bridge.to_string()).then_some(kept))
    }
}

/// What of home is on the disk.
#[derive(Clone, Debug, Default)]
pub struct HomeKeeper {
    /// What is kept.
    pub kept: Option<KeptHome>,
    /// When it was.
    pub at: Option<MonotonicNs>,
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
        let kept = KeptHome { position };
        let text = kept.encode(u64::MAX);
        assert!(text.len() < MAX_HOME_BYTES);
        let read = |bridge| KeptHome::decode(text.as_bytes(), bridge);
        assert_eq!(read(u64::MAX), Ok(Some(kept)));
        assert_eq!(read(7), Ok(None), "the bridge has begun anew");
        let end = text.rfind(' ').unwrap();
        for length in 1..end {
            let cut = KeptHome::decode(&text.as_bytes()[..length], u64::MAX);
            assert!(cut.is_err(), "{length}");
        }
        assert_eq!(KeptHome::decode(b"", 7), Ok(None));
        for wrong in [
            "ril-home 2 7 1 2 3",
            "ril-home 1 7 NaN 2 3",
            "ril-home 1 7 91 2 3",
            "ril-home 1 7 1 181 3",
            "ril-home 1 7 1 2 inf",
            "ril-home 1 7 1 2 pilot",
            "ril-home 1 7 1 2 3 4",
            "RILM",
            "\u{1f681}",
        ] {
            assert!(KeptHome::decode(wrong.as_bytes(), 7).is_err(), "{wrong}");
        }
        assert!(KeptHome::decode(&[0xff], 7).is_err());
    }

    #[test]
    fn home_is_the_bridges_until_an_operator_sets_it() {
        let at = |latitude_deg| WaypointPosition {
            latitude_deg,
            longitude_deg: 0.0,
            altitude_m: 0.0,
        };
        let mut home = Home::default();
        for (said, expected) in [
            (None, Home::Unknown),
            (Some(at(1.0)), Home::Ground(at(1.0))),
            (Some(at(2.0)), Home::Ground(at(2.0))),
            // The bridge was started again in the air.
            (None, Home::Unknown),
        ] {
            home.follow(said);
            assert_eq!(home, expected);
        }
        home = Home::Operator(at(3.0));
        home.follow(Some(at(4.0)));
        assert_eq!(home.known(), Some(at(3.0)));
    }
}
