//! [`Verification`]: what came of driving the cores of bridge and status from the journals of a recording, as text and as JSON.

use std::fmt;
use std::time::Duration;

use ipc_types::MonotonicNs;
use replay::{Difference, JournalVerdict, Verdict};
use runtime::duration::Shown;
use runtime::exit::ExitCode;
use serde::Serialize;

use crate::words::count;

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

    /// Why the command ends with another code than 0, in one line; nothing when all is verified.
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
