//! The arguments of `ril demo`.

use std::num::NonZeroU32;
use std::path::PathBuf;

use operator::options::EXIT_CODES;

/// Options of `ril demo`.
#[derive(clap::Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct DemoArgs {
    /// Which robot to be: an integer greater than 0
    #[arg(long, value_name = "N", env = "RIL_ROBOT", default_value = "1")]
    pub robot: NonZeroU32,

    /// Fly so many robots at once, from 3 to 50, whatever `--robot` says, each with a relay to one station, which
    /// orders; with two outages, a robot that dies and one that is replaced. Needs `ril-relay`
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(3..=50))]
    pub robots: Option<u32>,

    /// Print one JSON object on a line
    #[arg(long)]
    pub json: bool,

    /// Run the simulator's clock so many times faster
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = speed)]
    pub speed: f64,

    /// Where log, record and the outputs of the processes go and stay; made if it is not there [default: a folder that
    /// is removed at the end]
    #[arg(long, value_name = "FOLDER")]
    pub folder: Option<PathBuf>,
}

fn speed(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(speed) if (0.1..=20.0).contains(&speed) => Ok(speed),
        _ => Err("the speed is a number from 0.1 to 20".to_owned()),
    }
}
