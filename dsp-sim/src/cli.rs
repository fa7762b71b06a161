//! The command line, for the binary `dsp-sim` and for the command `ril run sim`.

use std::num::NonZeroU32;
use std::path::{Path, PathBuf};

use dsp_protocol::Profile;
use runtime::args::CommonArgs;
use runtime::config::resulting::{Resulting, given, value_of};
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::notify::Notifier;
use runtime::output::standard_output;
use runtime::signal::Termination;
use runtime::{config, logging};

use crate::config::{Config, DEFAULT_FILE, parse_profile};
use crate::faults::Script;
use crate::port::VirtualPort;
use crate::pty::{PtyError, PtyPort};
use crate::serial_port::SerialPort;
use crate::shell;
use crate::simulator::{Setup, Simulator};

/// Simulate the flight-control DSP and the helicopter behind a pseudo-terminal or a serial port
///
/// Prints the path of the port when it is open. With --faults, things go wrong on purpose.
#[derive(Clone, Debug, clap::Parser)]
#[command(name = "dsp-sim", version)]
pub struct SimArgs {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,

    /// Where the symbolic link to the port is made; a link that is there is replaced [default: /tmp/hero-dsp-ROBOT]
    #[arg(long, value_name = "PATH")]
    pub link: Option<PathBuf>,

    /// Stand in for the DSP at a real serial port, such as /dev/ttyUSB1, instead of a pseudo-terminal
    ///
    /// The port is held exclusively, raw, 8N1. When it is unplugged, the simulator waits for its return.
    #[arg(long, value_name = "DEVICE", conflicts_with_all = ["link", "speed"])]
    pub port: Option<PathBuf>,

    /// Speed of the serial link, bits per second, instead of `serial.baud_rate` of the configuration
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(50..=4_000_000))]
    pub baud_rate: Option<u32>,

    /// How many times faster than the real clock the simulated one runs, serial link included: 0.01 … 100
    #[arg(long, value_name = "FACTOR", default_value = "1", value_parser = speed)]
    pub speed: f64,

    /// Seed of wind and noise, instead of `noise.seed` of the configuration
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,

    /// Frames of the DSP, `classic` or `extended`, instead of `serial.profile` of the configuration
    #[arg(long, value_name = "NAME", value_parser = parse_profile)]
    pub profile: Option<Profile>,

    /// Script of what goes wrong on purpose: a seed and timed faults
    ///
    /// A TOML file with `seed` and any number of `[[fault]]` tables, each with a `kind`, its times in simulated
    /// seconds since the start, and what the kind needs. On bytes: flip_bits, drop_bytes, duplicate_bytes,
    /// insert_bytes, delay_bytes, split_bytes, burst, stall, outage. On messages: drop, repeat, late, reorder. In the
    /// DSP: raise_error, reboot, stop_status, hang, clock_jump, change_mask. To the helicopter: pilot_takes_over,
    /// battery_low, fuel_low, gps_altitude_drift, lose_fix. Of the serial port: hang_up.
    ///
    /// The annotated example dsp-sim/faults.toml shows each of them. The same seed repeats the same faults; it is
    /// logged at the start, and what was done at the end.
    #[arg(long, value_name = "FILE", verbatim_doc_comment)]
    pub faults: Option<PathBuf>,
}

impl SimArgs {
    /// Where the link will be.
    pub fn link(&self) -> PathBuf {
        let default = || format!("/tmp/hero-dsp-{}", self.common.robot()).into();
        self.link.clone().unwrap_or_else(default)
    }
}

/// What the simulator would run with. A script of faults is read too, and must be right.
///
/// # Errors
///
/// Exit code 78 when the configuration or the script is wrong.
pub fn check_config(args: &SimArgs) -> Result<Resulting, Failure> {
    let (file, default) = (
        args.common.settings.config.as_deref(),
        Path::new(DEFAULT_FILE),
    );
    let mut resulting = Resulting::load::<Config>(file, default, include_str!("../dsp-sim.toml"))?;
    if let Some(faults) = &args.faults {
        config::load::<Script>(Some(faults), faults)?;
    }
    for (option, key) in [
        ("--seed", "noise.seed"),
        ("--profile", "serial.profile"),
        ("--baud-rate", "serial.baud_rate"),
    ] {
        let given = given(option, "").map(|(text, origin)| (value_of(&text), origin));
        resulting = resulting.with(key, given);
    }
    Ok(resulting)
}

/// Runs the simulator in the foreground until SIGINT or SIGTERM; then the link is removed.
///
/// # Errors
/// The configuration or the script of faults is wrong (exit code 78), the link cannot be made (2), or there is no
/// pseudo-terminal (1); the failure names the next step.
pub fn run(args: SimArgs) -> Result<(), Failure> {
    if args.common.settings.check_config {
        return check_config(&args)?.print();
    }
    logging::init(args.common.verbosity())?;
    let file = args.common.settings.config.as_deref();
    let loaded = config::load::<Config>(file, Path::new(DEFAULT_FILE))?;
    let mut config = loaded.value;
    if let Some(seed) = args.seed {
        config.noise.seed = seed;
    }
    if let Some(profile) = args.profile {
        config.serial.profile = profile;
    }
    if let Some(baud_rate) = args.baud_rate {
        config.serial.baud_rate = baud_rate;
    }
    tracing::debug!(file = ?loaded.file, ?config, "configuration");
    let mut setup = config.setup();
    if args.port.is_some() {
        pace_for_a_real_port(&mut setup);
    }
    setup.faults = args.faults.as_deref().map(load_faults).transpose()?;
    // Before anything that must be left in order.
    let termination = Termination::install().or_fail(ExitCode::Internal)?;
    let (path, mut port) = open_port(&args, config.serial.baud_rate)?;
    let mut simulator = Simulator::new(setup);
    // For the starting process: the port is open.
    standard_output().print(format!("{}\n", path.display()));
    let supervisor = Notifier::from_env();
    supervisor.ready();
    tracing::info!(
        port = %path.display(),
        baud_rate = config.serial.baud_rate,
        profile = config.serial.profile.name(),
        seed = config.noise.seed,
        speed = args.speed,
        "ready"
    );
    let outcome = shell::run(
        &mut simulator,
        port.as_mut(),
        args.speed,
        &termination,
        &supervisor,
    );
    drop(port);
    supervisor.stopping();
    let summary = outcome.or_fail_with(ExitCode::Internal, "the simulator cannot go on")?;
    tracing::info!(
        received_bytes = summary.received,
        sent_bytes = summary.sent,
        waypoints_taken = simulator.dsp().counters().waypoints,
        waypoints_reached = simulator.helicopter().arrived(),
        phase = ?simulator.helicopter().phase(),
        simulated = ?simulator.now(),
        "ended"
    );
    if let Some(done) = simulator.faults() {
        tracing::info!(%done, "faults on purpose");
    }
    Ok(())
}

/// The real link paces what comes from the PC. What goes to the PC leaves the DSP a little slower than the port sends
/// it, so that nothing piles up in the port's queue, however far the two clocks are apart: 2 %, as much as 8N1
/// tolerates.
fn pace_for_a_real_port(setup: &mut Setup) {
    setup.receives_at_once = true;
    let slower = |baud: NonZeroU32| NonZeroU32::new(baud.get() / 50 * 49);
    setup.baud = setup.baud.and_then(|baud| slower(baud).or(Some(baud)));
}

/// Reads a script of faults, and logs the seed that repeats it.
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

/// Opens the serial port or the pseudo-terminal, and returns the path by which the operator knows it.
fn open_port(args: &SimArgs, baud_rate: u32) -> Result<(PathBuf, Box<dyn VirtualPort>), Failure> {
    if let Some(path) = &args.port {
        if baud_rate == 0 {
            return Err(Failure::usage(
                "--port needs a speed: name it with --baud-rate",
            ));
        }
        let port = SerialPort::open(path, baud_rate).map_err(Failure::usage)?;
        return Ok((path.clone(), Box::new(port)));
    }
    let port = PtyPort::new(&args.link()).map_err(|error| match error {
        PtyError::Terminal { .. } => Failure::internal(error),
        PtyError::Occupied(_) | PtyError::Taken { .. } | PtyError::Link { .. } => {
            Failure::usage(error)
        }
    })?;
    Ok((port.link().to_owned(), Box::new(port)))
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
    fn two_robots_have_two_links_unless_reported_otherwise() {
        let args = |args: &[&str]| SimArgs::try_parse_from([&["dsp-sim"], args].concat()).unwrap();
        assert_eq!(args(&["--robot", "7"]).link(), Path::new("/tmp/hero-dsp-7"));
        assert_eq!(args(&["--link", "port"]).link(), Path::new("port"));
        assert_eq!(args(&["--speed", "20"]).speed, 20.0);
    }

    #[test]
    fn a_profile_is_named() {
        let profile = |name: &str| {
            let argument = format!("--profile={name}");
            SimArgs::try_parse_from(["dsp-sim", &argument]).map(|args| args.profile)
        };
        assert_eq!(profile("extended").unwrap(), Some(Profile::Extended));
        assert_eq!(profile("classic").unwrap(), Some(Profile::Classic));
        assert_eq!(profile("both").unwrap_err().exit_code(), 2);
    }

    #[test]
    fn the_help_names_every_kind_of_fault() {
        use crate::faults::FaultKind;
        use clap::CommandFactory;
        let help = SimArgs::command().render_long_help().to_string();
        for &kind in FaultKind::ALL {
            assert!(
                help.contains(kind.name()),
                "{} is not in {help}",
                kind.name()
            );
        }
    }

    #[test]
    fn a_real_port_has_neither_link_nor_another_clock_and_needs_a_speed() {
        for arguments in [["--link", "dsp"], ["--speed", "2"]] {
            let arguments = [&["dsp-sim", "--port", "/dev/ttyS0"], &arguments[..]].concat();
            let error = SimArgs::try_parse_from(arguments).unwrap_err();
            assert_eq!(error.exit_code(), 2);
        }
        let args = SimArgs::try_parse_from(["dsp-sim", "--port", "/dev/null"]).unwrap();
        for baud_rate in [0, 9_600] {
            let failure = open_port(&args, baud_rate).err().unwrap();
            assert_eq!(failure.code(), ExitCode::Usage);
        }
    }

    #[test]
    fn a_real_port_sends_more_slowly_than_it_could_and_receives_at_once() {
        let mut setup = Setup::default();
        pace_for_a_real_port(&mut setup);
        assert!(setup.receives_at_once);
        assert_eq!(setup.baud.map(NonZeroU32::get), Some(112_896));
    }

    #[test]
    fn a_speed_that_makes_no_sense_is_a_usage_error() {
        for speed in ["0", "-1", "nan", "inf", "fast", "101"] {
            let argument = format!("--speed={speed}");
            let error = SimArgs::try_parse_from(["dsp-sim", &argument]).unwrap_err();
            assert_eq!(error.exit_code(), 2, "{speed}");
        }
    }
}
