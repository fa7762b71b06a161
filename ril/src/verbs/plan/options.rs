//! The arguments of `ril plan`.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Subcommand, ValueEnum};
use operator::options::{
    AskArgs, EXIT_CODES, Height, SenderArgs, duration, height, number, take_off_height,
};
use plans::model::{Altitude, Reference};
use runtime::args::CommonArgs;

/// `ril plan`
#[derive(Args, Clone, Debug)]
pub struct PlanArgs {
    /// What to do with the plan.
    #[command(subcommand)]
    pub command: PlanCommand,
}

/// `ril plan …`
#[derive(Clone, Debug, Subcommand)]
pub enum PlanCommand {
    /// Check a plan against the helicopter's limits, its geofence, time and fuel; nothing is sent
    Check(PlanCheckArgs),
    /// Show the items of a plan with lengths and times
    Show(PlanShowArgs),
    /// Check a plan, then fly it
    Fly(PlanFlyArgs),
}

/// The plan, and what its file leaves open.
#[derive(Args, Clone, Debug)]
pub struct PlanFileArgs {
    /// QGroundControl .plan, QGC WPL 110, GeoJSON, KML or GPX
    #[arg(value_name = "FILE")]
    pub file: PathBuf,

    /// What altitudes are above when the file does not say
    #[arg(long, value_name = "ZERO")]
    pub altitude_is: Option<ReferenceName>,

    /// Altitude above take-off of items that have none, such as 30m or 100ft
    #[arg(long, value_name = "ALTITUDE", value_parser = missing_altitude)]
    pub altitude: Option<Altitude>,

    /// The point of take-off, with its telemetry altitude [default: where the robot stands, or else the plan's]
    #[arg(long, value_name = "LAT,LON[,ALT]", allow_hyphen_values = true, value_parser = home)]
    pub home: Option<HomeArg>,

    /// Configuration of the bridge, for its limits and geofence [default: bridge.toml, if it is there]
    #[arg(long, value_name = "FILE")]
    pub bridge: Option<PathBuf>,

    /// Take off to this height first, if the plan does not, such as 20m or 60ft
    #[arg(long, value_name = "HEIGHT", value_parser = take_off_height)]
    pub takeoff: Option<f64>,

    /// Begin with this item, as `ril plan show` counts them
    #[arg(long, value_name = "ITEM", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    pub from: u32,
}

/// What an altitude is above.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ReferenceName {
    /// The point of take-off
    TakeOff,
    /// Sea
    Sea,
}

impl ReferenceName {
    /// What the plan calls this reference of altitudes.
    pub fn reference(self) -> Reference {
        match self {
            ReferenceName::TakeOff => Reference::TakeOff,
            ReferenceName::Sea => Reference::Sea,
        }
    }

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            ReferenceName::TakeOff => "take-off",
            ReferenceName::Sea => "sea",
        }
    }
}

/// `--home`
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HomeArg {
    /// Degrees to the north.
    pub latitude_deg: f64,
    /// Degrees to the east.
    pub longitude_deg: f64,
    /// Telemetry altitude, m.
    pub altitude_m: Option<f64>,
}

/// `ril plan check`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct PlanCheckArgs {
    /// The plan.
    #[command(flatten)]
    pub plan: PlanFileArgs,

    /// How to look at it.
    #[command(flatten)]
    pub look: PlanLookArgs,
}

/// What `check` and `show` take.
#[derive(Args, Clone, Debug)]
pub struct PlanLookArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// Do not ask a robot, even if one runs
    #[arg(long)]
    pub offline: bool,

    /// How long to wait for a sample of the robot, such as 5s or 200ms [default: 2s, or ril.toml]
    #[arg(long, value_name = "DURATION", env = "RIL_TIMEOUT", value_parser = duration)]
    pub timeout: Option<Duration>,

    /// Print JSON objects, one a line
    #[arg(long)]
    pub json: bool,
}

/// `ril plan show`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct PlanShowArgs {
    /// The plan.
    #[command(flatten)]
    pub plan: PlanFileArgs,

    /// Write the plan as a QGroundControl .plan to this file, which must not exist
    #[arg(long, value_name = "FILE")]
    pub to: Option<PathBuf>,

    /// How to look at it.
    #[command(flatten)]
    pub look: PlanLookArgs,
}

/// `ril plan fly`
#[derive(Args, Clone, Debug)]
pub struct PlanFlyArgs {
    /// The plan.
    #[command(flatten)]
    pub plan: PlanFileArgs,

    /// Put the plan's own fence into the bridge's configuration, and in force
    #[arg(long)]
    pub fence: bool,

    /// Without this command.
    #[command(flatten)]
    pub sender: SenderArgs,

    /// What every request takes.
    #[command(flatten)]
    pub ask: AskArgs,
}

/// Reads `--altitude`. It is above take-off, so a plus sign changes nothing.
fn missing_altitude(text: &str) -> Result<Altitude, String> {
    height(text).map(|altitude| match altitude {
        Height::Telemetry(metres) | Height::AboveTakeOff(metres) => Altitude::AboveTakeOff(metres),
    })
}

/// Reads `LAT,LON` or `LAT,LON,ALT`.
fn home(text: &str) -> Result<HomeArg, String> {
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let (latitude, longitude, altitude) = match parts[..] {
        [latitude, longitude] => (latitude, longitude, None),
        [latitude, longitude, altitude] => (latitude, longitude, Some(altitude)),
        _ => return Err("home is LAT,LON or LAT,LON,ALT, such as 37.41,-6.01,12m".to_owned()),
    };
    let altitude_m = altitude.map(|text| match height(text)? {
        Height::Telemetry(metres) => Ok(metres),
        Height::AboveTakeOff(_) => {
            Err("the altitude of home is a telemetry altitude; leave out the plus sign".to_owned())
        }
    });
    Ok(HomeArg {
        latitude_deg: number("latitude", latitude, 90.0)?,
        longitude_deg: number("longitude", longitude, 180.0)?,
        altitude_m: altitude_m.transpose()?,
    })
}
