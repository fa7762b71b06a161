//! The arguments of `ril replay`.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use operator::options::EXIT_CODES;
use recording::play::SPEEDS;
use runtime::args::CommonArgs;

/// Options of playing, which verification has no use for.
const PLAYING: [&str; 4] = ["speed", "from", "to", "is_looped"];

/// `ril replay`
///
/// Consumers cannot distinguish the replay from a robot, but for `safety.reserved` of module_state, which is 1. It has
/// shared memory of its own, /dev/shm/hrUID, unless RIL_IPC_ROOT names another one; a robot that lives there is never
/// replaced. Requests are refused. On a terminal: space pauses, `.` or the right arrow plays the next message, q ends.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct ReplayArgs {
    /// Recording of a flight (MCAP)
    #[arg(value_name = "FILE")]
    pub file: PathBuf,

    /// What every process takes. The robot is the one that was recorded, unless it is named here.
    #[command(flatten)]
    pub common: CommonArgs,

    /// How many times as fast as it was flown, from 0.01 to 100
    #[arg(long, value_name = "FACTOR", default_value = "1", value_parser = speed)]
    pub speed: f64,

    /// Begin so long after the first message, such as 1m30s
    #[arg(long, value_name = "DURATION", default_value = "0s", value_parser = runtime::duration::parse)]
    pub from: Duration,

    /// End so long after the first message [default: at the last one]
    #[arg(long, value_name = "DURATION", value_parser = runtime::duration::parse)]
    pub to: Option<Duration>,

    /// Begin again at the end, until a key or a signal
    #[arg(long = "loop")]
    pub is_looped: bool,

    /// Play nothing: drive the code of bridge and status with the inputs of the flight, and compare all that they say,
    /// bit for bit
    #[arg(long, conflicts_with_all = PLAYING)]
    pub verify: bool,

    /// As --verify, with another configuration of the bridge: what it would have done
    #[arg(long, value_name = "CONFIG", conflicts_with_all = PLAYING)]
    pub against: Option<PathBuf>,

    /// As --verify, with another configuration of status
    #[arg(long, value_name = "CONFIG", conflicts_with_all = PLAYING)]
    pub against_status: Option<PathBuf>,

    /// Play nothing: write the inputs of the flight, which are a test of every later version, as NAME.kept in this
    /// folder
    #[arg(long, value_name = "FOLDER", conflicts_with_all = PLAYING, conflicts_with_all = ["verify", "against", "against_status"])]
    pub keep: Option<PathBuf>,

    /// Print requests as they pass, and the end, as JSON objects, one a line; with --verify, the result as one
    #[arg(long)]
    pub json: bool,
}

impl ReplayArgs {
    /// Whether it is to be verified, and not played.
    pub fn verifies(&self) -> bool {
        self.verify || self.against.is_some() || self.against_status.is_some()
    }
}

/// Reads a speed.
fn speed(text: &str) -> Result<f64, String> {
    let number = text.strip_suffix('x').unwrap_or(text);
    match number.parse::<f64>() {
        Ok(speed) if SPEEDS.contains(&speed) => Ok(speed),
        Ok(_) => Err(format!(
            "the speed {text} is out of range: it must be from {} to {}",
            SPEEDS.start(),
            SPEEDS.end()
        )),
        Err(_) => Err(format!("`{text}` is no speed, such as 10 or 0.5")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_speed_is_a_factor_within_bounds() {
        for (text, expected) in [("1", 1.0), ("10x", 10.0), ("0.01", 0.01), ("100", 100.0)] {
            assert_eq!(speed(text), Ok(expected));
        }
        for text in ["0", "-1", "101", "NaN", "inf"] {
            assert!(speed(text).unwrap_err().contains("out of range"), "{text}");
        }
        for text in ["", "fast", "x"] {
            assert!(speed(text).unwrap_err().contains("is no speed"), "{text}");
        }
    }
}
