//! The arguments of `ril wait`.

use std::time::Duration;

use clap::Args;
use runtime::args::CommonArgs;

use super::EXIT_CODES;
use super::value::duration;
use crate::wait::condition::Condition;

/// `ril wait`
///
/// A condition is `up` (the link to the DSP is up), `landed`, `flying`, `hovering` (in the air, without a movement and slower
/// than 0.5 m/s), or a field of the robot's telemetry, an operator (>, >=, <, <=, =, !=) and a value with or without its unit,
/// such as "altitude>20m" or "supply.battery_v<=22.5". Short names: altitude (m, with the zero of telemetry and `ril goto`), speed
/// (m/s over ground), climb (m/s), battery (V), fuel (%), heading (deg), fix (quality of the GPS fix), height (m over ground, by
/// sonar). An angle may be named with _deg instead of _rad.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
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
