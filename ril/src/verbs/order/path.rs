//! `ril goto`, `ril rtl`: a path, from positions or moves, with its progress.

use std::path::{Path, PathBuf};

use clap::Args;
use dsp_protocol::Waypoint;
use ipc_types::fresh_request_id;
use ipc_types::payload::{MovementData, WaypointPosition};
use operator::options::{
    Height, Move, RequestArgs, SenderArgs, Target, Targets, height, number, read_text, targets,
    waypoints,
};
use operator::render::messages::Verb;
use operator::request::cruise::{CruiseSpeed, known_mps, speed_mps};
use operator::request::{Conversation, Format, Until, complete};
use operator::robot::geo::{Place, moved};
use operator::robot::position::{ground_altitude_m, newest_state, present_position};
use operator::session::OrderContext;
use runtime::exit::{ExitCode, Failure};

use super::progress::ProgressLine;

/// A climb shorter than this is none: an altitude is not measured better, m.
const MIN_CLIMB_M: f64 = 1.0;

/// `ril goto`
#[derive(Args, Clone, Debug)]
pub struct GotoArgs {
    /// Waypoints, each LAT,LON,ALT or LAT LON ALT: degrees, and a telemetry altitude (20m, 60ft, or 20 for metres) or a
    /// height above take-off (+20m), such as -37.5,-6.25,20m. Or moves, each +NORTH,+EAST or +NORTHm,+EASTm,+UPm:
    /// metres from the helicopter, or from the waypoint before, such as +50,-20
    #[arg(
        required_unless_present = "file",
        value_name = "LAT,LON,ALT",
        allow_negative_numbers = true
    )]
    pub words: Vec<String>,

    /// Read the waypoints from a file, one LAT,LON,ALT a line, no moves; `#` begins a comment, - is standard input
    #[arg(long, value_name = "FILE", conflicts_with = "words")]
    pub file: Option<PathBuf>,

    /// Replace a path that is under way instead of being refused as busy
    #[arg(long)]
    pub preempt: bool,

    /// Fly the path at this speed, m/s; then the DSP has the cruise speed again that it had before
    #[arg(long, value_name = "M/S", conflicts_with = "no_wait", allow_hyphen_values = true, value_parser = speed_mps)]
    pub speed: Option<f64>,

    /// Without this command.
    #[command(flatten)]
    pub sender: SenderArgs,

    /// What every request takes.
    #[command(flatten)]
    pub request: RequestArgs,
}

impl GotoArgs {
    /// The waypoints of the command line.
    ///
    /// # Errors
    ///
    /// Words that are no waypoints together, as a clause.
    pub fn targets(&self) -> Result<Targets, String> {
        targets(&self.words)
    }
}

/// `ril rtl`
///
/// Home is where the helicopter took off, as the bridge has seen it, unless --home names it. A path that is under way
/// is replaced.
#[derive(Args, Clone, Debug)]
pub struct RtlArgs {
    /// How high to fly home at least: a telemetry altitude (40m) or a height above take-off (+30m); the helicopter
    /// climbs to it on the spot, and does not descend [default: as high as it is]
    #[arg(value_name = "ALTITUDE", allow_negative_numbers = true, value_parser = height)]
    pub altitude: Option<Height>,

    /// Where home is, as LAT,LON in degrees
    #[arg(long, value_name = "LAT,LON", allow_hyphen_values = true, value_parser = place)]
    pub home: Option<Place>,

    /// Land at home, instead of hovering there
    #[arg(long, conflicts_with = "no_wait")]
    pub land: bool,

    /// Without this command.
    #[command(flatten)]
    pub sender: SenderArgs,

    /// What every request takes.
    #[command(flatten)]
    pub request: RequestArgs,
}

/// Reads a latitude and a longitude, degrees.
fn place(text: &str) -> Result<Place, String> {
    let both = text
        .split_once(',')
        .ok_or("a place is LAT,LON, such as 37.41,-6.01")?;
    let latitude_deg = number("latitude", both.0.trim(), 90.0)?;
    let longitude_deg = number("longitude", both.1.trim(), 180.0)?;
    Place::new(latitude_deg, longitude_deg).ok_or_else(|| format!("`{text}` is no place"))
}

/// `ril goto`
///
/// # Errors
///
/// As [`stop`](super::stop); code 2 also when the file of waypoints cannot be read or is wrong.
pub fn go_to(args: &GotoArgs) -> Result<(), Failure> {
    let targets = match &args.file {
        Some(file) => Targets::At(read_waypoints(file)?),
        None => args.targets().map_err(Failure::usage)?,
    };
    let asked = OrderContext::of(&args.request.ask)?;
    let waypoints = match &targets {
        Targets::At(targets) => absolute(targets, &asked)?,
        Targets::By(moves) => displaced(moves, &asked)?,
    };
    let path = PathOrder {
        verb: Verb::GoTo,
        preempt: args.preempt,
        sender: args.sender,
    };
    let Some(speed_mps) = args.speed else {
        return path.fly(&waypoints, &asked, &args.request).map(drop);
    };
    let before_mps = known_mps(&asked.session, asked.timeout)?;
    let mut speed = CruiseSpeed::new(
        &asked.session,
        (asked.timeout, asked.deadline_ms),
        Format::of(args.request.ask.json),
        Some(before_mps),
    );
    let flown = speed
        .set(speed_mps, 0)
        .and_then(|()| path.fly(&waypoints, &asked, &args.request));
    speed.restore();
    flown.map(drop)
}

/// `ril rtl`
///
/// # Errors
///
/// As [`stop`](super::stop); code 5 also when home is not known.
pub fn rtl(args: &RtlArgs) -> Result<(), Failure> {
    let asked = OrderContext::of(&args.request.ask)?;
    let present = present_position(&asked.session, asked.timeout)?;
    let home = match args.home {
        Some(home) => home,
        None => known_home(&asked)?,
    };
    let least_m = match args.altitude {
        Some(Height::Telemetry(metres)) => metres,
        Some(above) => above.from(ground_altitude_m(&asked.session, asked.timeout)?),
        None => present.at.altitude_m,
    };
    let waypoints = way_home(&present.at, home, least_m);
    let path = PathOrder {
        verb: Verb::ReturnToHome,
        preempt: true,
        sender: args.sender,
    };
    let flown = path.fly(&waypoints, &asked, &args.request);
    if !args.land {
        return flown.map(drop);
    }
    let home = flown.map_err(without_landing)?;
    let land = MovementData::land(fresh_request_id()).following(home);
    Conversation::open(&asked.session, Verb::Land, asked.timeout)?
        .follow(
            &[complete(land, false, asked.deadline_ms)],
            Until::Final,
            Format::of(args.request.ask.json),
        )
        .map(drop)
        .map_err(not_landed)
}

/// Something newer than the way home moves the helicopter, or holds it.
fn not_landed(failure: Failure) -> Failure {
    match failure.code() {
        ExitCode::Refused => {
            failure.with_next_step("not landed: `ril status` shows what goes on; `ril land`")
        }
        _ => failure,
    }
}

/// The landing is ordered when the path has ended, so a command that ends before has ordered none.
fn without_landing(failure: Failure) -> Failure {
    match failure.code() {
        ExitCode::OutcomeUnknown => failure.with_next_step("not landed: `ril land`"),
        _ => failure,
    }
}

/// Straight up where the helicopter is too low, then straight home.
fn way_home(here: &Waypoint, home: Place, least_m: f64) -> Vec<WaypointPosition> {
    let at = |latitude_deg, longitude_deg| WaypointPosition {
        latitude_deg,
        longitude_deg,
        altitude_m: here.altitude_m.max(least_m),
    };
    let mut way = Vec::new();
    if least_m - here.altitude_m > MIN_CLIMB_M {
        way.push(at(here.latitude_deg, here.longitude_deg));
    }
    way.push(at(home.latitude_deg, home.longitude_deg));
    way
}

/// Home as the bridge says it.
fn known_home(asked: &OrderContext) -> Result<Place, Failure> {
    let state = newest_state(&asked.session, asked.timeout)?;
    let home = state.and_then(|state| state.home());
    let place = home.and_then(|home| Place::new(home.latitude_deg, home.longitude_deg));
    place.ok_or_else(|| {
        let text = "home is not known: the bridge has not seen the helicopter on the ground; nothing was sent";
        Failure::new(ExitCode::Refused, text)
            .with_next_step("name it with --home LAT,LON; `ril hold` makes the helicopter hover")
    })
}

/// A path as a verb orders it.
struct PathOrder {
    verb: Verb,
    preempt: bool,
    sender: SenderArgs,
}

impl PathOrder {
    /// Gives the request that stands for the flight.
    fn fly(
        &self,
        waypoints: &[WaypointPosition],
        asked: &OrderContext,
        args: &RequestArgs,
    ) -> Result<u64, Failure> {
        let sender = match args.no_wait {
            true => self.sender.unfollowed()?,
            false => self.sender,
        };
        let path_id = fresh_request_id();
        let requests: Vec<MovementData> = MovementData::path(path_id, waypoints, fresh_request_id)
            .map(|request| MovementData {
                issued_ns: asked.issued.0,
                ..request
            })
            .map(|request| complete(request, self.preempt, asked.deadline_ms))
            .map(|request| sender.complete(request))
            .collect();
        let json = args.ask.json;
        let mut progress =
            ProgressLine::open(&asked.session, self.verb, path_id, waypoints, !json)?;
        Conversation::open(&asked.session, self.verb, asked.timeout)?
            .without_sender(sender.action())
            .beside(&mut progress)
            .follow(&requests, Until::of(args), Format::of(json))?;
        Ok(requests.last().map_or(0, |last| last.request_id))
    }
}

/// The waypoints with telemetry altitudes. How high the ground of the take-off is, is asked once, and only if it
/// matters.
fn absolute(targets: &[Target], asked: &OrderContext) -> Result<Vec<WaypointPosition>, Failure> {
    let is_relative = |target: &Target| matches!(target.altitude, Height::AboveTakeOff(_));
    let ground_m = match targets.iter().any(is_relative) {
        true => ground_altitude_m(&asked.session, asked.timeout)?,
        false => 0.0,
    };
    let waypoint = |target: &Target| WaypointPosition {
        latitude_deg: target.latitude_deg,
        longitude_deg: target.longitude_deg,
        altitude_m: target.altitude.from(ground_m),
    };
    Ok(targets.iter().map(waypoint).collect())
}

/// The waypoints that moves lead to, the first from where the helicopter is now.
fn displaced(moves: &[Move], asked: &OrderContext) -> Result<Vec<WaypointPosition>, Failure> {
    let here = present_position(&asked.session, asked.timeout)?.at;
    let mut altitude_m = here.altitude_m;
    let mut from = Place::new(here.latitude_deg, here.longitude_deg);
    let mut waypoints = Vec::with_capacity(moves.len());
    for step in moves {
        from = from.and_then(|from| moved(from, step.east_m, step.north_m));
        let Some(place) = from else {
            return Err(Failure::usage("a move leads beyond a pole"));
        };
        altitude_m += step.up_m;
        waypoints.push(WaypointPosition {
            latitude_deg: place.latitude_deg,
            longitude_deg: place.longitude_deg,
            altitude_m,
        });
    }
    Ok(waypoints)
}

/// Reads a file of waypoints; `-` is standard input.
fn read_waypoints(path: &Path) -> Result<Vec<Target>, Failure> {
    let text = read_text(path)?;
    waypoints(&text).map_err(|reason| Failure::usage(format!("{}: {reason}", path.display())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_home_climbs_on_the_spot_and_never_descends_before_it_is_there() {
        let here = Waypoint {
            latitude_deg: 37.0,
            longitude_deg: -6.0,
            altitude_m: 20.0,
        };
        let home = Place::new(37.01, -6.01).unwrap();
        for (least_m, expected) in [
            (40.0, &[(37.0, 40.0), (37.01, 40.0)][..]),
            (20.5, &[(37.01, 20.5)]),
            (5.0, &[(37.01, 20.0)]),
        ] {
            let way = way_home(&here, home, least_m);
            let shown: Vec<(f64, f64)> = way
                .iter()
                .map(|at| (at.latitude_deg, at.altitude_m))
                .collect();
            assert_eq!(shown, expected, "{least_m}");
        }
        assert!(place("37.41").is_err() && place("91,0").is_err());
    }
}
