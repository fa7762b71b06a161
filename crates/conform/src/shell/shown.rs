//! How a run is shown: the plan before it, the table by section, the JSON object, the dialogues as files.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use dsp_protocol::{DspErrorCode, Profile};
use operator::render::json_line;
use runtime::exit::Failure;
use runtime::output::standard_error;
use serde::Serialize;

use crate::check::{Check, How};
use crate::report::{CheckReport, Ended, Report, Side, Verdict, hex};

/// Name of the layout of the JSON object of a run, and of that of a check in the list.
const SCHEMA: &str = "ril.Conform.v1";
const LIST_SCHEMA: &str = "ril.ConformCheck.v1";

#[derive(Serialize)]
struct RunObject<'a> {
    schema: &'static str,
    port: String,
    baud_rate: u32,
    profile: &'static str,
    conforms: bool,
    kept: usize,
    broken: usize,
    not_judged: usize,
    ended_early: Option<&'static str>,
    own_errors: Vec<OwnErrorObject>,
    checks: Vec<SentenceObject<'a>>,
    vectors: Vec<String>,
}

#[derive(Serialize)]
struct OwnErrorObject {
    code: u16,
    text: &'static str,
    count: u32,
}

#[derive(Serialize)]
struct SentenceObject<'a> {
    id: &'a str,
    section: &'a str,
    sentence: &'a str,
    sends: &'a str,
    expects: &'a str,
    verdict: &'static str,
    reason: Option<&'a str>,
    dialogue: Vec<LineObject<'a>>,
}

#[derive(Serialize)]
struct LineObject<'a> {
    at_ms: u64,
    from: &'static str,
    bytes: String,
    text: &'a str,
}

#[derive(Serialize)]
struct ListObject<'a> {
    schema: &'static str,
    id: &'a str,
    section: &'a str,
    sentence: &'a str,
    sends: &'a str,
    expects: &'a str,
    moves_rotor: bool,
    needs_reset: bool,
}

/// Prints the checks.
pub fn list(checks: &[Check], as_json: bool) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    for check in checks {
        if as_json {
            json_line(
                &mut out,
                &ListObject {
                    schema: LIST_SCHEMA,
                    id: &check.id,
                    section: check.section,
                    sentence: &check.sentence,
                    sends: &check.sends,
                    expects: &check.expects,
                    moves_rotor: check.moves_rotor(),
                    needs_reset: check.needs_reset,
                },
            )?;
            continue;
        }
        let needs = match (check.moves_rotor(), check.needs_reset) {
            (true, true) => "  [--rotor-disconnected, a reset]",
            (true, false) => "  [--rotor-disconnected]",
            (false, true) => "  [a reset]",
            (false, false) => "",
        };
        let text = format!(
            "{}{needs}\n  \"{}\"\n  sends:   {}\n  expects: {}\n",
            check.id, check.sentence, check.sends, check.expects
        );
        writeln!(out, "{text}").map_err(Failure::output)?;
    }
    Ok(())
}

/// Says on standard error what will be sent.
pub fn say_plan(
    port: &Path,
    baud_rate: u32,
    profile: Profile,
    checks: &[Check],
    left_out: impl Fn(&Check) -> Option<String>,
) {
    let done: Vec<&Check> = checks
        .iter()
        .filter(|check| left_out(check).is_none())
        .collect();
    let moving = done.iter().filter(|check| check.moves_rotor()).count();
    let watched = done
        .iter()
        .filter(|check| matches!(check.how, How::Watched(_)));
    let mut text = format!(
        "{} at {baud_rate} baud, {} profile: {} checks ({} of them only watch)\n\
         Sent in any case: reads of all ports; activate status transmission, clear errors, invalidate path, following off;\n  \
         writes of 10000, 10001, 10002, 10004, 20000, 20001, 20002, 20121, which get their values back, and of ports that do not\n  \
         exist; damaged reads, writes of 20121 and unknown commands; noise without a header of the PC\n",
        port.display(),
        profile.name(),
        done.len(),
        watched.count(),
    );
    text += &match moving {
        0 => "Not sent: take-off, landing, following on, waypoints, trims, rotor speed, gains\n"
            .to_owned(),
        _ => format!(
            "Sent by {moving} checks: following on, take-off, waypoints, landing; writes of trims, rotor speed and gains\n"
        ),
    };
    if done.len() < checks.len() {
        text += &format!(
            "{} checks are left out; `ril conform --list` says what each sends and needs\n",
            checks.len() - done.len()
        );
    }
    standard_error().print(text);
}

/// Writes the dialogue of each broken sentence; gives the files.
pub fn write_vectors(folder: &Path, report: &Report) -> Result<Vec<PathBuf>, Failure> {
    let failed = |path: &Path, error: io::Error| {
        Failure::internal(format!("{} cannot be written: {error}", path.display()))
    };
    fs::create_dir_all(folder).map_err(|error| failed(folder, error))?;
    let mut files = Vec::new();
    for check in broken(report) {
        let path = folder.join(format!("{}.txt", check.id));
        let text = check.vector(report.profile);
        fs::write(&path, text).map_err(|error| failed(&path, error))?;
        files.push(path);
    }
    Ok(files)
}

fn broken(report: &Report) -> impl Iterator<Item = &CheckReport> {
    let checks = report.checks.iter();
    checks.filter(|check| matches!(check.verdict, Verdict::Broken { .. }))
}

/// Prints what was found.
pub fn print_report(
    port: &Path,
    baud_rate: u32,
    report: &Report,
    vectors: &[PathBuf],
    as_json: bool,
) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    if as_json {
        return json_line(&mut out, &object(port, baud_rate, report, vectors));
    }
    out.write_all(text(report, vectors).as_bytes())
        .map_err(Failure::output)
}

fn object<'a>(
    port: &Path,
    baud_rate: u32,
    report: &'a Report,
    vectors: &[PathBuf],
) -> RunObject<'a> {
    let totals = report.totals();
    let own = report
        .own_errors
        .iter()
        .map(|(code, count)| OwnErrorObject {
            code: *code,
            text: DspErrorCode(*code).text(),
            count: *count,
        });
    RunObject {
        schema: SCHEMA,
        port: port.display().to_string(),
        baud_rate,
        profile: report.profile.name(),
        conforms: report.conforms(),
        kept: totals.kept,
        broken: totals.broken,
        not_judged: totals.not_judged,
        ended_early: report.ended_early.as_ref().map(|ended| match ended {
            Ended::Silent => "silent",
            Ended::Garbled(_) => "garbled",
            Ended::NoStatus => "no-status",
            Ended::Flies => "flies",
        }),
        own_errors: own.collect(),
        checks: report.checks.iter().map(check_object).collect(),
        vectors: vectors
            .iter()
            .map(|path| path.display().to_string())
            .collect(),
    }
}

fn check_object(check: &CheckReport) -> SentenceObject<'_> {
    let lines = check.dialogue.iter().map(|line| LineObject {
        at_ms: u64::try_from(line.at.as_millis()).unwrap_or(u64::MAX),
        from: match line.side {
            Side::Pc => "pc",
            Side::Dsp => "dsp",
        },
        bytes: hex(&line.bytes),
        text: &line.text,
    });
    SentenceObject {
        id: &check.id,
        section: check.section,
        sentence: &check.sentence,
        sends: &check.sends,
        expects: &check.expects,
        verdict: check.verdict.name(),
        reason: check.verdict.text(),
        dialogue: lines.collect(),
    }
}

/// The table by section, what is broken, and why something was not judged.
fn text(report: &Report, vectors: &[PathBuf]) -> String {
    let mut sections: Vec<(&str, [usize; 3])> = Vec::new();
    for check in &report.checks {
        let column = match check.verdict {
            Verdict::Kept => 0,
            Verdict::Broken { .. } => 1,
            Verdict::NotJudged { .. } => 2,
        };
        match sections
            .iter_mut()
            .find(|(section, _)| *section == check.section)
        {
            Some((_, counts)) => counts[column] += 1,
            None => {
                let mut counts = [0; 3];
                counts[column] = 1;
                sections.push((check.section, counts));
            }
        }
    }
    sections.sort_by_key(|(section, _)| number_of(section));
    let mut text = format!(
        "{:<8} {:>6} {:>7} {:>11}\n",
        "section", "kept", "broken", "not judged"
    );
    for (section, [kept, broken, open]) in sections {
        text += &format!("{section:<8} {kept:>6} {broken:>7} {open:>11}\n");
    }
    let totals = report.totals();
    text += &format!(
        "{:<8} {:>6} {:>7} {:>11}\n",
        "all", totals.kept, totals.broken, totals.not_judged
    );
    for check in broken(report) {
        text += &format!(
            "\nbroken: {} (section {})\n  \"{}\"\n  sent:     {}\n  expected: {}\n  found:    {}\n",
            check.id,
            check.section,
            check.sentence,
            check.sends,
            check.expects,
            check.verdict.text().unwrap_or_default()
        );
    }
    text += &not_judged(report);
    for (code, count) in &report.own_errors {
        text += &format!(
            "\nthe DSP reported by itself, {count} times: {}",
            DspErrorCode(*code)
        );
    }
    for path in vectors {
        text += &format!("\nwritten: {}", path.display());
    }
    if report.conforms() {
        text += "\nconforms: every sentence that was judged is kept";
    }
    text.push('\n');
    text
}

/// The reasons why something was not judged, each with its checks.
fn not_judged(report: &Report) -> String {
    let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
    for check in &report.checks {
        let Verdict::NotJudged { why } = &check.verdict else {
            continue;
        };
        match reasons.iter_mut().find(|(reason, _)| *reason == why) {
            Some((_, checks)) => checks.push(&check.id),
            None => reasons.push((why, vec![&check.id])),
        }
    }
    let mut text = String::new();
    for (why, checks) in reasons {
        text += &match checks[..] {
            [one] => format!("\nnot judged: {one}: {why}"),
            [first, .., last] => format!(
                "\nnot judged: {} checks, {first} … {last}: {why}",
                checks.len()
            ),
            [] => String::new(),
        };
    }
    text
}

/// A section as numbers, for the order of the table.
fn number_of(section: &str) -> Vec<u32> {
    let parts = section.split('.');
    parts.map(|part| part.parse().unwrap_or(0)).collect()
}
