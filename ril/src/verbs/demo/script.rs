//! The script of a demonstration: the operator's commands, the paths that they fly, and what the processes are
//! configured with.

use std::fs;
use std::path::Path;

use dsp_protocol::Waypoint;
use operator::robot::geo::{Place, moved};
use runtime::exit::{ExitCode, Failure, OrFail};

/// A command of the operator: the name of its output, and its words behind `ril`.
pub(super) type ScriptCommand = (&'static str, &'static [&'static str]);

/// The operator's commands.
pub(super) const SCRIPT: [ScriptCommand; 6] = [
    ("start", &["start"]),
    ("takeoff", &["takeoff", "5m"]),
    ("square", &["goto", "--file", PATHS[0].0]),
    ("second-path", &["goto", "--file", PATHS[1].0]),
    ("land", &["land"]),
    ("stop", &["stop"]),
];

/// A command as the operator would type it.
pub(super) fn line((_, words): ScriptCommand) -> String {
    format!("ril {}", words.join(" "))
}

/// The paths, each a file of waypoints: east, north and up of the place of take-off, m. The first is a square with one
/// corner at the start, so that it ends where it began.
const PATHS: [(&str, &[[f64; 3]]); 2] = [
    (
        "square.txt",
        &[
            [0.0, 8.0, 6.0],
            [8.0, 8.0, 7.0],
            [8.0, 0.0, 6.0],
            [0.0, 0.0, 5.0],
        ],
    ),
    ("second-path.txt", &[[-4.0, 3.0, 5.0], [-3.0, -2.0, 4.0]]),
];

/// The waypoints of each path around `home`.
pub(super) fn waypoints_of(home: &Waypoint) -> [Vec<Waypoint>; 2] {
    let place = Place {
        latitude_deg: home.latitude_deg,
        longitude_deg: home.longitude_deg,
    };
    let waypoint = |[east_m, north_m, up_m]: &[f64; 3]| {
        let to = moved(place, *east_m, *north_m).unwrap_or(place);
        Waypoint {
            latitude_deg: to.latitude_deg,
            longitude_deg: to.longitude_deg,
            altitude_m: home.altitude_m + up_m,
        }
    };
    PATHS.map(|(_, offsets)| offsets.iter().map(waypoint).collect())
}

/// Writes the paths to where the operator's commands find them.
pub(super) fn write_paths(folder: &Path, paths: &[Vec<Waypoint>; 2]) -> Result<(), Failure> {
    for ((file, _), path) in PATHS.iter().zip(paths) {
        let lines = path.iter().map(|place| {
            let (latitude, longitude) = (place.latitude_deg, place.longitude_deg);
            format!("{latitude:.9},{longitude:.9},{:.3}\n", place.altitude_m)
        });
        let written = fs::write(folder.join(file), lines.collect::<String>());
        written.or_fail(ExitCode::Internal)?;
    }
    Ok(())
}

/// The bridge of the demonstration: a brisk helicopter, and an acceptance radius that fits its speed. A machine that is
/// busy with something else may stop the bridge or the simulator for seconds, which must not end the flight that it
/// shows.
pub(super) const BRIDGE_CONFIG: &str = "\
[link]
pc_timeout_ms = 60000
ack_timeout_ms = 2000
silent_after_ms = 10000

[parameters]
cruise_speed_mps = 8.0
climb_speed_mps = 4.0
acceptance_radius_m = 1.0

[arrival]
latitude_deg = 0.00002
longitude_deg = 0.00002
altitude_m = 1.5
";

/// Status with a log of everything.
pub(super) fn status_config(folder: &Path) -> String {
    let groups: Vec<String> = ipc_types::TelemetryGroup::ALL
        .iter()
        .map(|group| format!("\"{group}\""))
        .collect();
    format!(
        // A few megabytes, however full the disk is.
        "[[log]]\ndirectory = {:?}\nmin_free_mib = 0\ngroups = [{}]\n",
        folder,
        groups.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_path_ends_above_the_place_of_take_off() {
        let home = Waypoint {
            latitude_deg: 37.0,
            longitude_deg: -6.0,
            altitude_m: 10.0,
        };
        let [first, second] = waypoints_of(&home);
        assert_eq!((first.len(), second.len()), (4, 2));
        let above = Waypoint {
            altitude_m: 15.0,
            ..home
        };
        assert_eq!(first[3], above);
    }
}
