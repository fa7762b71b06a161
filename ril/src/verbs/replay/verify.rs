//! `ril replay FILE --verify`, `--against` and `--keep`: no shared memory, no clock but for the time that it took.

use std::fmt;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use ipc_types::schema::CDR_HEADER;
use ipc_types::{MonotonicNs, RobotId};
use recording::play::{anchor_of, key_of};
use recording::read::{Bytes, Message, ReadError, extract, messages};
use replay::{Difference, JournalVerdict, Verdict, Verifier};
use runtime::duration::Shown;
use runtime::exit::{ExitCode, Failure, OrFail};
use serde::Serialize;

use super::options::ReplayArgs;
use crate::render::json_line;
use crate::render::words::{count, shell_word};

/// Topics of which verification needs every message.
const JOURNALS: [&str; 2] = ["bridge/journal", "status/journal"];

/// `ril replay FILE --verify`
///
/// # Errors
///
/// Code 2 when the file cannot be read, is no recording or has no journal; 8 when something differs or could not be verified; 78 when
/// a configuration is wrong.
pub(super) fn verify(args: &ReplayArgs) -> Result<(), Failure> {
    let bytes = open(&args.file)?;
    let mut verifier = Verifier::new();
    if let Some(config) = &args.against {
        let config = runtime::config::load::<bridge::BridgeConfig>(Some(config), config)?;
        verifier = verifier.against(config.value);
    }
    if let Some(config) = &args.against_status {
        let config = runtime::config::load::<status::config::Config>(Some(config), config)?;
        verifier = verifier.against_status(config.value);
    }
    let began = MonotonicNs::now();
    let start = drive(&bytes, &args.file, &mut verifier)?;
    let verdict = verifier.finish();
    let name = args.file.display().to_string();
    let of = Of {
        file: &name,
        against: args.against.is_some() || args.against_status.is_some(),
        start,
        took: MonotonicNs::now().since(began),
    };
    let verification = Verification::new(&verdict, &of);
    let mut out = io::stdout().lock();
    match args.json {
        true => json_line(&mut out, &verification)?,
        false => write!(out, "{verification}").map_err(Failure::output)?,
    }
    out.flush().map_err(Failure::output)?;
    match verification.trouble() {
        None => Ok(()),
        Some(text) => Err(Failure::new(verification.exit_code(), text).with_next_step(
            "`ril replay FILE --from TIME` plays the flight from shortly before that time on",
        )),
    }
}

/// `ril replay FILE --keep FOLDER`: the journals alone, and what the file says of the flight, as a file of the same name there.
///
/// # Errors
///
/// Code 2 when the file cannot be read, is no recording or has no journal, or the new one is there already; 1 when it cannot be written.
pub(super) fn keep(args: &ReplayArgs, folder: &Path) -> Result<(), Failure> {
    let bytes = open(&args.file)?;
    let mut kept = Vec::new();
    let robot = first_robot(&bytes, &args.file)?;
    extract(&bytes, &mut kept, |message| {
        journal(message, robot).is_some()
    })
    .or_fail(ExitCode::Internal)?;
    let path = place(&args.file, folder)?;
    fs::create_dir_all(folder).or_fail_with(
        ExitCode::Internal,
        format!("{} cannot be made", folder.display()),
    )?;
    let written = File::create_new(&path).and_then(|mut file| {
        file.write_all(&kept)?;
        file.sync_all()
    });
    if let Err(error) = written {
        let text = format!("{} cannot be written: {error}", path.display());
        return Err(match error.kind() {
            io::ErrorKind::AlreadyExists => {
                Failure::usage(text).with_next_step("remove it, or name another folder")
            }
            _ => Failure::internal(text),
        });
    }
    if args.common.quiet == 0 {
        let _ = writeln!(
            io::stderr(),
            "{} has the journals of the flight, {} kB; `ril replay {} --verify` verifies them",
            path.display(),
            kept.len().div_ceil(1000),
            shell_word(&path.to_string_lossy())
        );
    }
    Ok(())
}

fn place(file: &Path, folder: &Path) -> Result<PathBuf, Failure> {
    let name = file
        .file_name()
        .ok_or_else(|| Failure::usage(format!("{} is no file", file.display())))?;
    Ok(folder.join(name))
}

fn open(file: &Path) -> Result<Bytes, Failure> {
    Bytes::open(file).or_fail_with(
        ExitCode::Usage,
        format!("{} cannot be read", file.display()),
    )
}

/// Gives the journals to the verifier. Returns when the recording begins, by the clock of then.
fn drive(bytes: &[u8], file: &Path, verifier: &mut Verifier) -> Result<MonotonicNs, Failure> {
    let robot = first_robot(bytes, file)?;
    let anchor = anchor_of(bytes);
    let mut first_ns = None;
    for message in messages(bytes) {
        match message {
            Ok(message) => {
                first_ns.get_or_insert(message.log_time_ns);
                if let Some((key, sample)) = journal(&message, robot) {
                    verifier.take(key, sample);
                }
            }
            // What is missing shows in the journal's numbers.
            Err(error) => tracing::warn!(%error, "the file is damaged"),
        }
    }
    let ahead_ns = anchor.zip(first_ns).map(|(anchor, first_ns)| {
        let after_ns = first_ns.saturating_sub(anchor.unix_ns);
        let before_ns = anchor.unix_ns.saturating_sub(first_ns);
        anchor
            .monotonic
            .0
            .saturating_add(after_ns)
            .saturating_sub(before_ns)
    });
    Ok(MonotonicNs(ahead_ns.unwrap_or_default()))
}

/// The robot of the first piece of a journal.
fn first_robot(bytes: &[u8], file: &Path) -> Result<RobotId, Failure> {
    for message in messages(bytes) {
        match message {
            Ok(message) => {
                if let Some((robot, key)) = key_of(message.topic)
                    && JOURNALS.contains(&key)
                {
                    return Ok(robot);
                }
            }
            Err(ReadError::NotMcap) => {
                let text = format!("{}: {}", file.display(), ReadError::NotMcap);
                return Err(Failure::usage(text));
            }
            Err(_) => {}
        }
    }
    let text = format!(
        "{} has no journal, so nothing can be verified",
        file.display()
    );
    Err(Failure::usage(text)
        .with_next_step("record with `ril record`: bridge and status then publish their journals"))
}

/// Key and sample of a message that is a piece of this robot's journals.
fn journal<'a>(message: &Message<'a>, robot: RobotId) -> Option<(&'a str, &'a [u8])> {
    let (of, key) = key_of(message.topic)?;
    let sample = message.data.strip_prefix(&CDR_HEADER)?;
    (of == robot && JOURNALS.contains(&key)).then_some((key, sample))
}

/// Name of the JSON object's layout.
pub const SCHEMA: &str = "ril.Verification.v1";

/// Differences that the text lists at most; JSON has as many as the verifier lists.
const MAX_SHOWN: usize = 10;

/// What came of a verification.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verification {
    schema: &'static str,
    file: String,
    /// Whether it was driven with another configuration than the recorded one.
    against: bool,
    /// Whether everything that could be read is the same.
    verified: bool,
    /// How long the journals are, s.
    flight_s: f64,
    /// How long the verification took, s.
    took_s: f64,
    /// The first difference of both.
    first_difference: Option<Differing>,
    bridge: Journal,
    status: Journal,
}

/// Of one journal.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Journal {
    inputs: u64,
    samples: u64,
    states: u64,
    reports: u64,
    bytes_sent: u64,
    snapshots: u64,
    /// Where the journal does not go on: pieces were lost, or a process or a recorder began again.
    breaks: u64,
    pieces_lost: u64,
    damaged: u64,
    /// Snapshots of another version of the RIL.
    foreign_snapshots: u64,
    difference_count: u64,
    differences: Vec<Differing>,
}

/// A difference.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Differing {
    /// Since the first message of the recording, s.
    at_s: f64,
    /// By the clock of the machine that recorded.
    monotonic_ns: u64,
    topic: String,
    field: String,
    recorded: String,
    replayed: String,
}

/// What is known beside the verdict.
#[derive(Clone, Copy, Debug)]
pub struct Of<'a> {
    /// Name of the file.
    pub file: &'a str,
    /// Whether it was driven with another configuration.
    pub against: bool,
    /// When the recording begins, by the clock of the machine that recorded.
    pub start: MonotonicNs,
    /// How long the verification took.
    pub took: Duration,
}

impl Verification {
    /// What came of it.
    pub fn new(verdict: &Verdict, of: &Of<'_>) -> Verification {
        let differing = |difference: &Difference| Differing::new(difference, of.start);
        Verification {
            schema: SCHEMA,
            file: of.file.to_owned(),
            against: of.against,
            verified: verdict.is_verified(),
            flight_s: length(&verdict.bridge)
                .max(length(&verdict.status))
                .as_secs_f64(),
            took_s: of.took.as_secs_f64(),
            first_difference: verdict.difference().map(differing),
            bridge: Journal::new(&verdict.bridge, of.start),
            status: Journal::new(&verdict.status, of.start),
        }
    }

    /// How the command ends: 0, or 8 when something differs or could not be verified.
    pub fn exit_code(&self) -> ExitCode {
        match self.verified {
            true => ExitCode::Ok,
            false => ExitCode::NotInOrder,
        }
    }

    /// Why the command ends with another code than 0, in one line; `None` if all is verified.
    pub fn trouble(&self) -> Option<String> {
        if self.verified {
            return None;
        }
        let journals = [&self.bridge, &self.status];
        let sum = |of: fn(&Journal) -> u64| journals.into_iter().map(of).sum::<u64>();
        let differences = sum(|journal| journal.difference_count);
        if let Some(first) = &self.first_difference {
            let what = match self.against {
                true => "with this configuration, the flight would have been another",
                false => "the replay differs from the recording",
            };
            let others = match differences {
                1 => String::new(),
                more => format!(" ({} in all)", count(more, "difference")),
            };
            return Some(format!("{what}: {first}{others}"));
        }
        let foreign = sum(|journal| journal.foreign_snapshots);
        if foreign > 0 {
            return Some(format!(
                "{} of another version of the RIL: verify with the version that recorded",
                count(foreign, "snapshot")
            ));
        }
        let damaged = sum(|journal| journal.damaged);
        Some(match damaged {
            0 => "no snapshot of a core is in the journal, so nothing could be verified".to_owned(),
            _ => format!("{} of the journal cannot be read", count(damaged, "record")),
        })
    }
}

impl Journal {
    fn new(verdict: &JournalVerdict, start: MonotonicNs) -> Journal {
        let differences = verdict.differences.iter();
        Journal {
            inputs: verdict.inputs,
            samples: verdict.samples,
            states: verdict.states,
            reports: verdict.reports,
            bytes_sent: verdict.bytes_sent,
            snapshots: verdict.snapshots,
            breaks: verdict.break_count,
            pieces_lost: verdict.pieces_lost,
            damaged: verdict.damaged,
            foreign_snapshots: verdict.foreign,
            difference_count: verdict.difference_count,
            differences: differences.map(|one| Differing::new(one, start)).collect(),
        }
    }
}

impl Differing {
    fn new(difference: &Difference, start: MonotonicNs) -> Differing {
        Differing {
            at_s: difference.at.since(start).as_secs_f64(),
            monotonic_ns: difference.at.0,
            topic: difference.topic.clone(),
            field: difference.field.clone(),
            recorded: difference.recorded.clone(),
            replayed: difference.replayed.clone(),
        }
    }
}

/// How long a journal was driven.
fn length(journal: &JournalVerdict) -> Duration {
    journal
        .spans
        .iter()
        .map(|span| span.to.since(span.from))
        .sum()
}

impl fmt::Display for Differing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "at {:.6} s, {}: {} was {} and is {}",
            self.at_s, self.topic, self.field, self.recorded, self.replayed
        )
    }
}

impl fmt::Display for Verification {
    /// Several lines, each with its end.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let result = match (self.verified, self.first_difference.is_some()) {
            (true, _) => "the same, bit for bit",
            (false, true) => "DIFFERENT",
            (false, false) => "NOT VERIFIED",
        };
        writeln!(f, "replay      {result}")?;
        let took = Duration::from_secs_f64(self.took_s.max(1e-6));
        writeln!(
            f,
            "flight      {}, replayed in {}: {:.0} times as fast",
            Shown(Duration::from_secs_f64(self.flight_s)),
            Shown(Duration::from_millis(took.as_millis() as u64)),
            self.flight_s / took.as_secs_f64()
        )?;
        for (title, journal) in [("bridge", &self.bridge), ("status", &self.status)] {
            writeln!(f, "{title:<12}{journal}")?;
            for differing in journal.differences.iter().take(MAX_SHOWN) {
                writeln!(f, "            {differing}")?;
            }
            if journal.difference_count > MAX_SHOWN as u64 {
                let more = journal.difference_count - MAX_SHOWN as u64;
                writeln!(f, "            and {more} more")?;
            }
        }
        Ok(())
    }
}

impl fmt::Display for Journal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.snapshots + self.inputs + self.foreign_snapshots == 0 {
            return f.write_str("no journal");
        }
        write!(
            f,
            "{}; the same: {}, {}, {}, {} sent",
            count(self.inputs, "input"),
            count(self.samples, "sample"),
            count(self.states, "state"),
            count(self.reports, "report"),
            count(self.bytes_sent, "byte")
        )?;
        if self.breaks > 0 {
            write!(
                f,
                "; {}, {} lost",
                count(self.breaks, "break"),
                count(self.pieces_lost, "piece")
            )?;
        }
        Ok(())
    }
}
