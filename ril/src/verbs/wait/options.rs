//! The arguments of `ril wait`.

use std::time::Duration;

use clap::Args;
use runtime::args::CommonArgs;

use super::condition::Condition;
use crate::cli::exit_codes::EXIT_CODES;
use crate::cli::value::duration;

/// What a condition is, for the end of the help.
const CONDITIONS: &str = "\
Conditions:
  up               the link to the DSP is up
  landed, flying   the helicopter is on the ground, or in the air
  hovering         in the air, without a movement, slower than 0.5 m/s
  FIELD OP VALUE   a number of the robot's telemetry (`ril topic info hero`);
                   OP is >, >=, <, <=, = or !=; quote it: \"altitude>20m\"
  Short names of fields, and their units:
    altitude m (telemetry altitude, as in `ril goto`), height m (sonar),
    speed m/s (over ground), climb m/s, battery V, fuel %, heading deg, fix
  An angle may be named in degrees: geodetic.latitude_deg";

/// `ril wait`
///
/// Several conditions must be fulfilled at the same time. A sample that is older than 1 s fulfils nothing.
#[derive(Args, Clone, Debug)]
#[command(after_help = format!("{CONDITIONS}\n\n{EXIT_CODES}"))]
pub struct WaitArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// What to wait for; when it is repeated, for all at the same time
    #[arg(long = "for", value_name = "CONDITION", required = true, value_parser = Condition::parse)]
    pub conditions: Vec<Condition>,

    /// How long to wait at most
    #[arg(long, value_name = "DURATION", default_value = "30s", value_parser = duration)]
    pub timeout: Duration,

    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}
