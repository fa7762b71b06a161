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
use crate::faults::Script;
use crate::plug::{Plug, PlugError};
use crate::shell;
use crate::simulator::Simulator;

/// Simulates the flight-control DSP and the helicopter behind a pseudo-terminal.
///
/// Prints the path of the serial port when it is there. With --faults, things go wrong on purpose.
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

    /// Script of what goes wrong on purpose: a seed and timed faults
    ///
    /// A TOML file with `seed` and any number of `[[fault]]` tables, each with a `kind`, its times in simulated seconds
    /// since the start, and what the kind needs. On bytes: flip_bits, drop_bytes, duplicate_bytes, insert_bytes,
    /// delay_bytes, split_bytes, burst, stall, outage. On messages: drop, repeat, late, reorder. In the DSP:
    /// raise_error, reboot, stop_status, hang, clock_jump, change_mask. To the helicopter: pilot_takes_over, battery_low,
    /// fuel_low, gps_altitude_drift, lose_fix. Of the serial port: hang_up.
    ///
    /// The annotated example dsp-sim/faults.toml shows each of them. The same seed repeats the same faults; it is told at
    /// the start, and what was done at the end.
    #[arg(long, value_name = "FILE", verbatim_doc_comment)]
    pub faults: Option<PathBuf>,
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
/// The configuration or the script of faults is wrong (exit code 78), the link cannot be made (2), or there is no
/// pseudo-terminal (1); the failure says what to do.
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
    let mut setup = config.setup();
    setup.faults = args.faults.as_deref().map(load_faults).transpose()?;
    if args.common.check_config {
        return Ok(());
    }
    // Before anything that must be left in order.
    let termination = Termination::install().or_fail(ExitCode::Internal)?;
    let mut plug = Plug::new(&args.link()).map_err(|error| match error {
        PlugError::Pty(error) => Failure::internal(error),
        PlugError::Link(error) => Failure::usage(error),
    })?;
    let mut simulator = Simulator::new(setup);
    tell_link(plug.link()).map_err(Failure::output)?;
    let supervisor = Notifier::from_env();
    supervisor.ready();
    tracing::info!(
        link = %plug.link().display(),
        baud_rate = config.line.baud_rate,
        profile = config.line.profile.name(),
        seed = config.noise.seed,
        speed = args.speed,
        "ready"
    );
    let outcome = shell::run(
        &mut simulator,
        &mut plug,
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
    if let Some(done) = simulator.faults() {
        tracing::info!(%done, "faults on purpose");
    }
    Ok(())
}

/// Reads a script of faults, and tells what repeats it.
fn load_faults(file: &Path) -> Result<Script, Failure> {
    let script = config::load::<Script>(Some(file), file)?.value;
    tracing::info!(
        file = %file.display(),
        seed = script.seed,
        faults = script.faults.len(),
        "faults on purpose"
    );
    Ok(script)
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
    fn the_help_names_every_kind_of_fault() {
        use crate::faults::Kind;
        use clap::CommandFactory;
        let help = Args::command().render_long_help().to_string();
        for kind in Kind::ALL {
            assert!(
                help.contains(kind.name()),
                "{} is not in {help}",
                kind.name()
            );
        }
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
