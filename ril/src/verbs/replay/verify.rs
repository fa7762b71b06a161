//! `ril replay FILE --verify` and `--against`: no shared memory, no clock but for the time that it took.
//!
//! `ril replay FILE --keep`: the inputs of a flight as a file that every later version drives its cores with.

#[cfg(test)]
mod tests;

use std::fmt;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

use ipc_types::{MonotonicNs, RobotId};
use operator::render::fields::Meaning;
use operator::render::words::{count, shell_word};
use operator::render::{note, print};
use recording::play::{anchor_of, key_of};
use recording::read::{RecordFile, messages};
use replay::{Comparison, Difference, JournalVerdict, Keeper, Kept, Verifier};
use runtime::duration::DurationText;
use runtime::exit::{ExitCode, Failure, OrFail};
use serde::Serialize;

use super::journals::{first_robot, first_samples, kept_flight, open, piece, refuse_kept};
use super::options::ReplayArgs;
use crate::new_file::new_file;

/// `ril replay FILE --verify`
///
/// # Errors
///
/// Code 2 when the file cannot be read, is no recording or has no journal; 8 when something differs or could not be
/// verified; 78 when a configuration is wrong.
pub(super) fn verify(args: &ReplayArgs) -> Result<(), Failure> {
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
    let driven = match kept_flight(&args.file)? {
        Some(kept) => {
            let taken = verifier.take_kept(&kept);
            taken.map_err(|error| refuse_kept(&args.file, &error))?;
            Driven::default()
        }
        None => {
            let record = open(&args.file)?;
            let robot = first_robot(&record, &args.file)?;
            verifier = verifier.since(first_samples(&record, robot));
            drive(&record, robot, &mut verifier)
        }
    };
    let verdict = verifier.finish();
    let name = args.file.display().to_string();
    let of = Of {
        file: &name,
        against: args.against.is_some() || args.against_status.is_some(),
        start: driven.start.unwrap_or_else(|| beginning(&verdict)),
        recorded: driven.recorded,
        took: MonotonicNs::now().since(began),
    };
    let verification = Verification::new(&verdict, &of);
    print(&verification, args.json)?;
    match verification.trouble() {
        None => Ok(()),
        Some(text) => Err(Failure::new(verification.exit_code(), text).with_next_step(
            "`ril replay FILE --from TIME` plays the flight from shortly before that time on",
        )),
    }
}

/// When the cores were driven first, by the clock of then.
fn beginning(verdict: &Comparison) -> MonotonicNs {
    let journals = [&verdict.bridge, &verdict.status];
    let spans = journals.into_iter().flat_map(|journal| &journal.spans);
    spans.map(|span| span.from).min().unwrap_or_default()
}

/// What was found on the way; nothing of it is in a kept flight.
#[derive(Default)]
struct Driven {
    /// When the recording begins, by the clock of then.
    start: Option<MonotonicNs>,
    /// Samples of bridge and status in the file.
    recorded: [u64; 2],
}

/// Gives the journals to the verifier.
fn drive(record: &RecordFile, robot: RobotId, verifier: &mut Verifier) -> Driven {
    let anchor = anchor_of(record);
    let mut first_ns = None;
    let mut recorded = [0; 2];
    for message in messages(record) {
        match message {
            Ok(message) => {
                first_ns.get_or_insert(message.log_time_ns);
                if let Some((key, sample)) = piece(&message, robot) {
                    verifier.take(key, sample);
                }
                let of = key_of(message.topic()).filter(|(of, _)| *of == robot);
                let is = |samples: &str| u64::from(of.is_some_and(|(_, key)| key == samples));
                recorded[0] += is("dsp_telemetry");
                recorded[1] += is("hero_telemetry");
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
    let start = Some(MonotonicNs(ahead_ns.unwrap_or_default()));
    Driven { start, recorded }
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
    bridge: JournalFigures,
    status: JournalFigures,
}

/// Of one journal.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct JournalFigures {
    inputs: u64,
    samples: u64,
    /// Of these, samples of before the first one in the file.
    samples_before: u64,
    /// Samples in the file, the compared ones among them; 0 if it has the journals alone.
    samples_recorded: u64,
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
    /// Samples of bridge and status in the file.
    pub recorded: [u64; 2],
    /// How long the verification took.
    pub took: Duration,
}

impl Verification {
    /// What came of it.
    pub fn new(verdict: &Comparison, of: &Of<'_>) -> Verification {
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
            bridge: JournalFigures::new(&verdict.bridge, of.start, of.recorded[0]),
            status: JournalFigures::new(&verdict.status, of.start, of.recorded[1]),
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
        let sum = |of: fn(&JournalFigures) -> u64| journals.into_iter().map(of).sum::<u64>();
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

impl JournalFigures {
    fn new(verdict: &JournalVerdict, start: MonotonicNs, recorded: u64) -> JournalFigures {
        let differences = verdict.differences.iter();
        JournalFigures {
            inputs: verdict.inputs,
            samples: verdict.samples,
            samples_before: verdict.samples_before,
            samples_recorded: recorded,
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

impl JournalFigures {
    /// Whether the file has samples that were not compared: before the first snapshot, after a loss, and at the end, of
    /// which the journal comes later than the samples.
    fn is_part(&self) -> bool {
        self.samples_recorded > self.of_file()
    }

    /// Samples that are the same, of those in the file.
    fn of_file(&self) -> u64 {
        self.samples.saturating_sub(self.samples_before)
    }

    /// Samples that are the same, of those that the file has.
    fn covered(&self) -> String {
        match self.is_part() {
            true => format!(
                "{} of {}",
                self.of_file(),
                count(self.samples_recorded, "sample")
            ),
            false => count(self.samples, "sample"),
        }
    }
}

impl Differing {
    fn new(difference: &Difference, start: MonotonicNs) -> Differing {
        let meaning = Meaning::of_key(&difference.topic);
        // A code has a name, which says more than its number.
        let in_words = |text: &String| {
            let name = text.parse().ok();
            let name = name.and_then(|code| meaning.name_of(&difference.field, code));
            name.unwrap_or_else(|| text.clone())
        };
        Differing {
            at_s: difference.at.since(start).as_secs_f64(),
            monotonic_ns: difference.at.0,
            topic: difference.topic.clone(),
            field: difference.field.clone(),
            recorded: in_words(&difference.recorded),
            replayed: in_words(&difference.replayed),
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
        let is_part = [&self.bridge, &self.status]
            .map(JournalFigures::is_part)
            .contains(&true);
        let result = match (self.verified, self.first_difference.is_some()) {
            (true, _) if is_part => "the same, bit for bit, as far as the journals reach",
            (true, _) => "the same, bit for bit",
            (false, true) => "DIFFERENT",
            (false, false) => "NOT VERIFIED",
        };
        writeln!(f, "replay      {result}")?;
        let took = Duration::from_secs_f64(self.took_s.max(1e-6));
        writeln!(
            f,
            "flight      {}, replayed in {}: {:.0} times as fast",
            DurationText(Duration::from_secs_f64(self.flight_s)),
            DurationText(Duration::from_millis(took.as_millis() as u64)),
            self.flight_s / took.as_secs_f64()
        )?;
        for (title, journal) in [("bridge", &self.bridge), ("status", &self.status)] {
            writeln!(f, "{title:<12}{journal}")?;
            // The answers of the DSP stay as recorded, so with another configuration only the first difference is sure.
            let shown = if self.against { 1 } else { MAX_SHOWN };
            for differing in journal.differences.iter().take(shown) {
                writeln!(f, "            {differing}")?;
            }
            match journal.difference_count.saturating_sub(shown as u64) {
                0 => {}
                more if self.against => {
                    writeln!(f, "            and {more} more, which may be a consequence")?;
                }
                more => writeln!(f, "            and {more} more")?,
            }
        }
        Ok(())
    }
}

impl fmt::Display for JournalFigures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.snapshots + self.inputs + self.foreign_snapshots == 0 {
            return f.write_str("no journal");
        }
        write!(
            f,
            "{}; the same: {}, {}, {}, {} sent",
            count(self.inputs, "input"),
            self.covered(),
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

/// `ril replay FILE --keep FOLDER`: a kept flight of the same name there.
///
/// # Errors
///
/// Code 2 when the file cannot be read, is no recording or has no journal, or the new one is there already or cannot be
/// written; 8 when the cores of this version say something else than what was recorded.
pub(super) fn keep(args: &ReplayArgs, folder: &Path) -> Result<(), Failure> {
    if kept_flight(&args.file)?.is_some() {
        let text = format!("{} is a kept flight already", args.file.display());
        return Err(Failure::usage(text).with_next_step("copy the file"));
    }
    let kept = read(args)?
        .finish()
        .map_err(|error| refuse_kept(&args.file, &error))?;
    verify_kept(&args.file, &kept.file)?;
    let path = place(&args.file, folder)?;
    fs::create_dir_all(folder).or_fail_with(
        ExitCode::Internal,
        format!("{} cannot be made", folder.display()),
    )?;
    let next_step = "remove it, or name another folder with --keep";
    new_file(&path, next_step, |to| Ok(to.write_all(&kept.file)?))?;
    if args.common.settings.quiet == 0 {
        say(&path, &kept);
    }
    Ok(())
}

fn read(args: &ReplayArgs) -> Result<Keeper, Failure> {
    let record = open(&args.file)?;
    let robot = first_robot(&record, &args.file)?;
    let mut keeper = Keeper::default();
    for message in messages(&record) {
        match message {
            Ok(message) => {
                if let Some((key, sample)) = piece(&message, robot) {
                    keeper.take(key, sample);
                }
            }
            Err(error) => tracing::warn!(%error, "the file is damaged"),
        }
    }
    Ok(keeper)
}

/// A test that fails from the first day is none.
fn verify_kept(file: &Path, kept: &[u8]) -> Result<(), Failure> {
    let began = MonotonicNs::now();
    let mut verifier = Verifier::new();
    verifier
        .take_kept(kept)
        .map_err(|error| refuse_kept(file, &error))?;
    let name = file.display().to_string();
    let of = Of {
        file: &name,
        against: false,
        start: MonotonicNs(0),
        recorded: [0; 2],
        took: MonotonicNs::now().since(began),
    };
    let verification = Verification::new(&verifier.finish(), &of);
    match verification.trouble() {
        None => Ok(()),
        Some(text) => Err(Failure::new(verification.exit_code(), text)
            .context(format!("{name} is not kept"))
            .with_next_step("`ril replay FILE --verify` lists what differs")),
    }
}

fn place(file: &Path, folder: &Path) -> Result<PathBuf, Failure> {
    let stem = file
        .file_stem()
        .ok_or_else(|| Failure::usage(format!("{} is no file", file.display())))?;
    let mut name = stem.to_owned();
    name.push(".kept");
    Ok(folder.join(name))
}

fn say(path: &Path, kept: &Kept) {
    let word = shell_word(&path.to_string_lossy());
    let kilobytes = kept.file.len().div_ceil(1000);
    let bound = match kept.is_from_the_start {
        true => "from the start of the processes",
        false => {
            "from a snapshot, which this version alone reads, because the recording began later than the processes"
        }
    };
    note(format_args!(
        "{} has the inputs of the flight {bound}, {kilobytes} kB; `ril replay {word} --verify` verifies it",
        path.display(),
    ));
}
