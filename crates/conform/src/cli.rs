//! `ril conform`: plays the PC against a DSP and says which sentences of docs/protocol.md it keeps.
//!
//! What is sent and judged is the rest of this crate's. Here are the command line, what it allows, and the operator's
//! confirmation.

use std::io::{self, BufRead, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use bridge::config::SerialConfig;
use bridge::shell::serial::SerialPort;
use clap::{Args, ValueEnum};
use dsp_protocol::{DecodeError, Profile, Sequence};
use operator::options::{EXIT_CODES, duration, read_text};
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::output::standard_error;
use runtime::signal::Termination;

use crate::permitted::{CONFIRMATION, RotorDisconnected};
use crate::replay::{Dialogue, Replay};
use crate::report::{Ended, hex};
use crate::run::{Settings, left_out};
use crate::shell::shown::{list, print_report, say_plan, write_vectors};
use crate::shell::{Played, Resetter, play, serve};
use crate::table::chosen;
use crate::wire::Setup;

/// `ril conform`
///
/// The DSP must be on the bench: the helicopter stands, and no bridge uses the port. By default nothing is sent that
/// can move a rotor. The ports that it writes get the values back that they had.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct ConformArgs {
    /// Serial port that leads to the DSP
    #[arg(long, value_name = "DEV", required_unless_present = "list")]
    pub port: Option<PathBuf>,

    /// Bits per second
    #[arg(long, value_name = "BAUD", default_value_t = 115_200, value_parser = clap::value_parser!(u32).range(1_200..=4_000_000))]
    pub baud_rate: u32,

    /// Which profile the DSP speaks
    #[arg(long, value_name = "PROFILE", default_value = "classic")]
    pub profile: ProfileArg,

    /// Check only sentences whose name, such as 8.2-ack-time, begins so, or those of a section, such as 8.3; may be
    /// repeated
    #[arg(long, value_name = "NAME")]
    pub only: Vec<String>,

    /// List the checks, what each sends and expects, and send nothing
    #[arg(long)]
    pub list: bool,

    /// Allow what can move a rotor: following, take-off, waypoints, landing, trims, rotor speed, gains. Asks for a
    /// confirmation
    #[arg(long)]
    pub rotor_disconnected: bool,

    /// Command that resets the DSP, run by a shell, for the checks of its boot
    #[arg(long, value_name = "COMMAND", conflicts_with = "reset_by_hand")]
    pub reset_command: Option<String>,

    /// Ask for a reset of the DSP by hand, for the checks of its boot
    #[arg(long)]
    pub reset_by_hand: bool,

    /// How late this computer may see a byte, such as 50ms: added to every limit of time
    #[arg(long, value_name = "DURATION", default_value = "25ms", value_parser = duration)]
    pub slack: Duration,

    /// The line damages bytes: repeat a check that fails, and count no damaged frame as a fault
    #[arg(long)]
    pub lossy: bool,

    /// Play the lines of the PC of a dialogue, such as --vectors writes, and print what the DSP says to them
    #[arg(long, value_name = "FILE", conflicts_with_all = ["only", "list", "vectors", "lossy", "json", "reset_command", "reset_by_hand"])]
    pub replay: Option<PathBuf>,

    /// Write the dialogue of each sentence that is broken into this folder, as a file that can be replayed
    #[arg(long, value_name = "DIR")]
    pub vectors: Option<PathBuf>,

    /// Print one JSON object; with --list one for each check
    #[arg(long)]
    pub json: bool,
}

/// A profile on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ProfileArg {
    /// Checksum of 7 bits
    Classic,
    /// Numbers and a CRC
    Extended,
}

impl From<ProfileArg> for Profile {
    fn from(profile: ProfileArg) -> Profile {
        match profile {
            ProfileArg::Classic => Profile::Classic,
            ProfileArg::Extended => Profile::Extended,
        }
    }
}

/// `ril conform`
///
/// # Errors
///
/// Code 8 when a sentence is broken, 4 when the DSP answers nothing, 5 when the helicopter flies or what was typed is
/// not the confirmation, 6 when the port cannot be opened or is lost, 7 when a signal ends the run, 2 when no check has
/// the name.
pub fn conform(args: &ConformArgs) -> Result<(), Failure> {
    if let (Some(file), Some(port)) = (&args.replay, &args.port) {
        return replay(file, port, args);
    }
    let profile = Profile::from(args.profile);
    let checks = chosen(profile, &args.only);
    if checks.is_empty() {
        let text = format!(
            "no check of the {} profile begins with {}",
            profile.name(),
            args.only.join(", ")
        );
        return Err(Failure::usage(text).with_next_step("`ril conform --list` lists them"));
    }
    if args.list {
        return list(&checks, args.json);
    }
    let Some(port) = &args.port else {
        return Err(Failure::usage("--port is missing"));
    };
    let mut settings = Settings {
        setup: Setup {
            profile,
            baud: args.baud_rate.try_into().ok(),
            slack: args.slack,
            // Not 0: a DSP must take any.
            first_number: Sequence::new(std::process::id() as u8),
            is_lossy: args.lossy,
        },
        can_reset: args.reset_by_hand || args.reset_command.is_some(),
        proof: None,
        only: args.only.clone(),
    };
    // Before signals are taken: Ctrl+C at the question ends the command at once.
    if args.rotor_disconnected {
        say_plan(port, args.baud_rate, profile, &checks, |_| None);
        settings.proof = Some(confirm()?);
    } else {
        say_plan(port, args.baud_rate, profile, &checks, |check| {
            left_out(check, &settings)
        });
    }
    let termination = Termination::install().or_fail(ExitCode::Internal)?;
    let serial = open(port, args.baud_rate)?;
    let resetter = match &args.reset_command {
        Some(command) => Resetter::Command(command.clone()),
        None => Resetter::ByHand,
    };
    let played = play(settings, &serial, &termination, &resetter)?;
    let vectors = match &args.vectors {
        Some(folder) => write_vectors(folder, &played.report)?,
        None => Vec::new(),
    };
    print_report(port, args.baud_rate, &played.report, &vectors, args.json)?;
    verdict(&played, &vectors, args)
}

/// Plays a dialogue, in the profile that it names.
fn replay(file: &Path, port: &Path, args: &ConformArgs) -> Result<(), Failure> {
    let dialogue = Dialogue::parse(&read_text(file)?).map_err(|error| {
        let text = format!("{}:{}: {}", file.display(), error.line, error.what);
        Failure::usage(text)
    })?;
    let profile = dialogue.profile;
    let setup = Setup {
        profile,
        baud: args.baud_rate.try_into().ok(),
        slack: args.slack,
        first_number: Sequence::FIRST,
        is_lossy: false,
    };
    let proof = match args.rotor_disconnected {
        true => Some(confirm()?),
        false => None,
    };
    let termination = Termination::install().or_fail(ExitCode::Internal)?;
    let serial = open(port, args.baud_rate)?;
    let mut replay = Replay::new(dialogue, setup, proof.is_some());
    let interrupted = serve(&mut replay, &serial, &termination, |_, _| Ok(()))?;
    if let Some(ended) = replay.ended_early() {
        return Err(ended_early(ended, profile));
    }
    let name = profile.name();
    let mut text = format!("dsp profile = {name}\npc profile = {name}\n\n");
    for line in replay.lines() {
        text += &line.to_string();
        text.push('\n');
    }
    io::stdout()
        .lock()
        .write_all(text.as_bytes())
        .map_err(Failure::output)?;
    if replay.was_refused() {
        let text = "the next line of the dialogue can move a rotor: it was not sent";
        return Err(Failure::new(ExitCode::Refused, text)
            .with_next_step("disconnect the rotor, and add --rotor-disconnected"));
    }
    match interrupted {
        Some(signal) => {
            let text = format!("signal {signal} ended the dialogue");
            Err(Failure::new(ExitCode::OutcomeUnknown, text))
        }
        None => Ok(()),
    }
}

/// Why nothing was judged or played.
fn ended_early(ended: &Ended, profile: Profile) -> Failure {
    let (code, text, step) = match ended {
        Ended::Silent => (
            ExitCode::Timeout,
            "the DSP sends nothing".to_owned(),
            "is it switched on, are cable, --baud-rate and --profile right? A DSP that computes the check field wrongly (sections 2 and 11) takes no command, and so sends nothing",
        ),
        Ended::Garbled(rejected) => (
            ExitCode::Timeout,
            format!(
                "the DSP sends no frame that the PC accepts: {}, in {}",
                rejected.describe(profile).replace('_', " "),
                hex(&rejected.bytes)
            ),
            match rejected.error {
                DecodeError::Checksum => {
                    "compare these bytes with section 2, in the extended profile with section 11"
                }
                DecodeError::OtherProfile => "name the profile of the DSP with --profile",
                _ => "is --baud-rate right, and --profile?",
            },
        ),
        Ended::NoStatus => (
            ExitCode::Refused,
            "the DSP sends no status, so whether the helicopter flies is unknown: it was left alone"
                .to_owned(),
            "let the DSP send a status (section 8.3), or disconnect the rotor and add --rotor-disconnected",
        ),
        Ended::Flies => (
            ExitCode::Refused,
            "the DSP says that the helicopter flies, takes off or lands: it was left alone"
                .to_owned(),
            "land; if it stands, the DSP's flag or ports 10121 and 10122 are wrong (section 8.5)",
        ),
    };
    Failure::new(code, text).with_next_step(step)
}

/// How the command ends.
fn verdict(played: &Played, vectors: &[PathBuf], args: &ConformArgs) -> Result<(), Failure> {
    if let Some(signal) = played.interrupted_by {
        let text = format!(
            "signal {signal} ended the run after {} checks",
            played.report.checks.len()
        );
        return Err(Failure::new(ExitCode::OutcomeUnknown, text)
            .with_next_step("the DSP is not as it was found: reset it, and run the checks again"));
    }
    if let Some(ended) = &played.report.ended_early {
        return Err(ended_early(ended, played.report.profile));
    }
    let totals = played.report.totals();
    if totals.broken > 0 {
        let text = format!(
            "the DSP breaks {} sentences of docs/protocol.md",
            totals.broken
        );
        let step = match vectors.is_empty() && args.vectors.is_none() {
            true => "--vectors DIR writes the dialogue of each",
            false => "replay the dialogues that were written",
        };
        return Err(Failure::new(ExitCode::NotInOrder, text).with_next_step(step));
    }
    if totals.kept == 0 {
        let text = "no sentence could be judged";
        return Err(
            Failure::new(ExitCode::NotInOrder, text).with_next_step("the reasons are in the table")
        );
    }
    Ok(())
}

/// Asks for the confirmation that no rotor can turn.
fn confirm() -> Result<RotorDisconnected, Failure> {
    // Standard error may be closed; what is typed counts all the same.
    standard_error().print(format!(
        "\nThe DSP will be ordered to take off, to fly to waypoints and to land.\nDisconnect the rotor, then type \"{CONFIRMATION}\": "
    ));
    let mut typed = String::new();
    io::stdin()
        .lock()
        .read_line(&mut typed)
        .map_err(Failure::internal)?;
    RotorDisconnected::confirmed_by(&typed).ok_or_else(|| {
        Failure::new(ExitCode::Refused, "not confirmed: nothing was sent").with_next_step(
            "type the sentence as it stands there, or leave --rotor-disconnected out",
        )
    })
}

fn open(port: &Path, baud_rate: u32) -> Result<SerialPort, Failure> {
    let config = SerialConfig {
        port: port.to_owned(),
        baud_rate,
        ..SerialConfig::default()
    };
    SerialPort::open(&config).or_fail(ExitCode::LinkDown)
}
