//! The command line, for the binary `dsp-sim` and for the command `ril sim`.

use std::io::Write;
use std::path::{Path, PathBuf};

use dsp_protocol::Profile;
use runtime::args::CommonArgs;
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::notify::Notifier;
use runtime::signal::Termination;
use runtime::{config, logging};

use crate::config::{Config, DEFAULT_FILE, parse_profile};
use crate::pty::{Link, Pty};
use crate::shell;
use crate::simulator::Simulator;

/// Simulates the flight-control DSP and the helicopter behind a pseudo-terminal.
///
/// Prints the path of the serial port when it is there.
#[derive(Clone, Debug, clap::Parser)]
#[command(name = "dsp-sim", version)]
pub struct Args {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// Where the symbolic link to the port is made; a link that is there is replaced [default: /tmp/hero-dsp-ROBOT]
    #[arg(long, value_name = "PATH")]
    pub link: Option<PathBuf>,

    /// How many times faster than the real clock the simulated one runs, line included: 0.01 … 100
    #[arg(long, value_name = "FACTOR", default_value = "1", value_parser = speed)]
    pub speed: f64,

    /// Seed of wind and noise, instead of `noise.seed` of the configuration
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,

    /// What the DSP speaks, `classic` or `extended`, instead of `line.profile` of the configuration
    #[arg(long, value_name = "NAME", value_parser = parse_profile)]
    pub profile: Option<Profile>,
}

impl Args {
    /// Where the link will be.
    pub fn link(&self) -> PathBuf {
        let default = || format!("/tmp/hero-dsp-{}", self.common.robot).into();
        self.link.clone().unwrap_or_else(default)
    }
}

/// Runs the simulator in the foreground until SIGINT or SIGTERM; then the link is removed.
///
/// # Errors
/// The configuration is wrong (exit code 78), the link cannot be made (2), or there is no pseudo-terminal (1); the
/// failure says what to do.
pub fn run(args: Args) -> Result<(), Failure> {
    logging::init(args.common.verbosity())?;
    let file = args.common.config.as_deref();
    let loaded = config::load::<Config>(file, Path::new(DEFAULT_FILE))?;
    let mut config = loaded.value;
    if let Some(seed) = args.seed {
        config.noise.seed = seed;
    }
    if let Some(profile) = args.profile {
        config.line.profile = profile;
    }
    tracing::debug!(file = ?loaded.file, ?config, "configuration");
    if args.common.check_config {
        return Ok(());
    }
    // Before anything that must be left in order.
    let termination = Termination::install().or_fail(ExitCode::Internal)?;
    let mut pty = Pty::open().or_fail(ExitCode::Internal)?;
    let link = Link::create(&args.link(), pty.path()).or_fail(ExitCode::Usage)?;
    let mut simulator = Simulator::new(config.setup());
    tell_link(link.path()).map_err(Failure::output)?;
    let supervisor = Notifier::from_env();
    supervisor.ready();
    tracing::info!(
        link = %link.path().display(),
        port = %pty.path().display(),
        baud_rate = config.line.baud_rate,
        profile = config.line.profile.name(),
        seed = config.noise.seed,
        speed = args.speed,
        "ready"
    );
    let outcome = shell::run(
        &mut simulator,
        &mut pty,
        args.speed,
        &termination,
        &supervisor,
    );
    supervisor.stopping();
    let summary = outcome.or_fail_with(ExitCode::Internal, "the simulator cannot go on")?;
    tracing::info!(
        received_bytes = summary.received,
        sent_bytes = summary.sent,
        waypoints = simulator.helicopter().arrived(),
        phase = ?simulator.helicopter().phase(),
        simulated = ?simulator.now(),
        "ended"
    );
    Ok(())
}

/// One line for whoever started this process: the port is there.
fn tell_link(link: &Path) -> std::io::Result<()> {
    let mut output = std::io::stdout().lock();
    writeln!(output, "{}", link.display())?;
    output.flush()
}

fn speed(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(speed) if (0.01..=100.0).contains(&speed) => Ok(speed),
        _ => Err("a speed is a factor from 0.01 to 100".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[test]
    fn two_robots_have_two_links_unless_told_otherwise() {
        let args = |args: &[&str]| Args::try_parse_from([&["dsp-sim"], args].concat()).unwrap();
        assert_eq!(args(&["--robot", "7"]).link(), Path::new("/tmp/hero-dsp-7"));
        assert_eq!(args(&["--link", "port"]).link(), Path::new("port"));
        assert_eq!(args(&["--speed", "20"]).speed, 20.0);
    }

    #[test]
    fn a_profile_is_named() {
        let profile = |name: &str| {
            let argument = format!("--profile={name}");
            Args::try_parse_from(["dsp-sim", &argument]).map(|args| args.profile)
        };
        assert_eq!(profile("extended").unwrap(), Some(Profile::Extended));
        assert_eq!(profile("classic").unwrap(), Some(Profile::Classic));
        assert_eq!(profile("both").unwrap_err().exit_code(), 2);
    }

    #[test]
    fn a_speed_that_makes_no_sense_is_a_usage_error() {
        for speed in ["0", "-1", "nan", "inf", "fast", "101"] {
            let argument = format!("--speed={speed}");
            let error = Args::try_parse_from(["dsp-sim", &argument]).unwrap_err();
            assert_eq!(error.exit_code(), 2, "{speed}");
        }
    }
}
