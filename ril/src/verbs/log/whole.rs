//! `ril log check`, `recover` and `export`: what of a flight record is complete, a whole file of a damaged one, and a
//! part of one.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::time::Duration;

use operator::render::words::{count, shell_word};
use operator::render::{print, print_as};
use operator::session::configuration;
use operator::topic_name::key_of;
use recording::name_of;
use recording::read::{self, ReadError, RecordFile, Recovered};
use runtime::exit::{ExitCode, Failure};
use serde::Serialize;
use status::log::file_name::FileKind;

use super::check::FileCheck;
use super::files::{OrFailUsage, last_flight, open};
use super::options::{LogExportArgs, LogFileArgs, LogRecoverArgs};
use crate::new_file::new_file;

/// How a file of a record that was made whole ends, behind the name of the damaged one. No log and no recording gives
/// such a name, so that none removes the file to make room.
const RECOVERED: &str = "recovered.mcap";

/// How the name of a file ends that is a part of a record, behind the record's name.
const PART: &str = "part.mcap";

/// `ril log check`
///
/// # Errors
///
/// Code 2 when the file cannot be read or is no record, 8 when it is not complete.
pub(super) fn check(args: &LogFileArgs) -> Result<(), Failure> {
    configuration(&args.place.common)?;
    let path = match &args.file {
        Some(path) => path.clone(),
        None => last_flight(&args.place, Some(FileKind::Mcap))?,
    };
    let name = path.display().to_string();
    let check = FileCheck::new(name.clone(), read::check(&record(&path)?));
    print(&check, args.json)?;
    if check.is_in_order() {
        return Ok(());
    }
    let (text, next_step) = match check.complete {
        false if !check.unsupported.is_empty() => {
            let reason = check.unsupported.join("; ");
            (not_read(&name, &reason), WRITE_ANEW.to_owned())
        }
        false if check.messages == 0 => (
            format!("{name} is not complete, and no message can be read"),
            KEEP.to_owned(),
        ),
        false => (
            format!("{name} is not complete: everything that can be read was counted"),
            format!(
                "`ril log recover {}` makes a whole file of that",
                shell_word(&name)
            ),
        ),
        true => (
            format!(
                "{name} lacks {} of which it says nothing",
                count(check.unexplained, "message")
            ),
            "report this, with the file".to_owned(),
        ),
    };
    Err(Failure::new(ExitCode::NotInOrder, text).with_next_step(next_step))
}

/// What to do about a file of which a part was not read.
const WRITE_ANEW: &str = "keep the file; write it anew with the program that it is from, in smaller chunks, not \
    compressed or with zstd or lz4";

/// What to do about a file of which nothing can be read.
const KEEP: &str = "keep the file: it may still be read by other means";

/// Of the file `name`, of which a part was not read for that reason.
fn not_read(name: &str, reason: &str) -> String {
    format!("{name} was not read as a whole: {reason}")
}

/// A record that was written anew, for programs.
#[derive(Serialize)]
struct WrittenObject {
    schema: &'static str,
    /// The record, which stays as it is.
    file: String,
    /// The new one.
    output: String,
    messages: u64,
    /// What was wrong.
    errors: Vec<String>,
}

/// `ril log recover`
///
/// # Errors
///
/// Code 2 when the file cannot be read or is no record, or when the new one is there already or cannot be written; 8
/// when no message can be read, and there is no new file, or when a part of the file is not supported.
pub(super) fn recover(args: &LogRecoverArgs) -> Result<(), Failure> {
    write(args, RECOVERED, "ril.LogRecovered.v1", |record, to| {
        read::recover(record, to)
    })
}

/// `ril log export`
///
/// # Errors
///
/// As [`recover`]; code 2 also when there is no such message.
pub(super) fn export(args: &LogExportArgs) -> Result<(), Failure> {
    write(&args.file, PART, "ril.LogExported.v1", |record, to| {
        let summary = read::summary_of(record).unwrap_or_default();
        // The times of a damaged file are those of its messages.
        let first = summary.first_ns.or_else(|| read::check(record).first_ns);
        let start_ns = first.unwrap_or_default();
        let ns = |since: Duration| u64::try_from(since.as_nanos()).unwrap_or(u64::MAX);
        let from_ns = start_ns.saturating_add(args.from.map_or(0, ns));
        let to_ns = args
            .to
            .map_or(u64::MAX, |to| start_ns.saturating_add(ns(to)));
        read::extract(record, to, |message| {
            let is_wanted = |name: &String| is_topic(message.topic(), name);
            (from_ns..=to_ns).contains(&message.log_time_ns)
                && (args.topics.is_empty() || args.topics.iter().any(is_wanted))
        })
    })
}

/// Whether `topic` is called `name`: as in the file, without the robot, or as in `ril echo`.
fn is_topic(topic: &str, name: &str) -> bool {
    let without_robot = || topic.split_once('/')?.1.split_once('/');
    let wanted = name_of(key_of(name.trim_start_matches('/')));
    topic == name || without_robot().is_some_and(|(_, rest)| rest == wanted)
}

fn write(
    args: &LogRecoverArgs,
    ending: &str,
    schema: &'static str,
    write: impl FnOnce(&RecordFile, &mut BufWriter<File>) -> Result<Recovered, ReadError>,
) -> Result<(), Failure> {
    configuration(&args.common)?;
    let record = record(&args.file)?;
    let output = args.output.clone();
    let output = output.unwrap_or_else(|| args.file.with_extension(ending));
    let written = new_file(
        &output,
        "remove it, or name another file with --output",
        |to| write(&record, to),
    )?;
    let file = args.file.display().to_string();
    let errors: Vec<_> = written.errors.iter().map(ToString::to_string).collect();
    let unsupported = written.errors.iter().find(|error| error.is_unsupported());
    let unsupported = unsupported.map(|error| {
        let text = not_read(&file, &error.to_string());
        Failure::new(ExitCode::NotInOrder, text).with_next_step(WRITE_ANEW)
    });
    if written.messages == 0 {
        // It would look like what the old one had.
        let _ = std::fs::remove_file(&output);
        if let Some(failure) = unsupported {
            return Err(failure);
        }
        if ending == RECOVERED {
            let mut text = format!("no message of {file} can be read");
            errors
                .first()
                .inspect(|error| text += &format!(": {error}"));
            return Err(Failure::new(ExitCode::NotInOrder, text).with_next_step(KEEP));
        }
        let text = format!("{file}: no message of these topics lies in this time");
        let next_step = format!(
            "`ril log check {}` shows its topics and times",
            shell_word(&file)
        );
        return Err(Failure::usage(text).with_next_step(next_step));
    }
    if !args.json {
        for error in &errors {
            tracing::info!("{file}: {error}");
        }
    }
    let object = WrittenObject {
        schema,
        file,
        output: output.display().to_string(),
        messages: written.messages,
        errors,
    };
    let messages = count(written.messages, "message");
    let text = format_args!("{}: {messages}\n", output.display());
    print_as(args.json, &object, text)?;
    unsupported.map_or(Ok(()), Err)
}

/// The record at `path`.
fn record(path: &Path) -> Result<RecordFile, Failure> {
    // Says why it cannot be read, and refuses what is no regular file.
    open(path)?;
    let record = RecordFile::open(path).or_fail_usage(path)?;
    if record.is_empty() {
        let name = path.display();
        return Err(Failure::usage(format!(
            "{name}: it is empty; the recorder ended before it wrote anything"
        )));
    }
    let first = read::messages(&record).next();
    match matches!(first, Some(Err(ReadError::NotMcap))) {
        false => Ok(record),
        true => Err(Failure::usage(format!(
            "{}: it is no flight record in the format MCAP; `ril log summary` reads logs of status",
            path.display()
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recovered_file_lies_beside_the_damaged_one_and_belongs_to_no_recording() {
        for ending in [RECOVERED, PART] {
            let output = Path::new("log/hero1_2026-11-22T11-54-43Z.mcap").with_extension(ending);
            let name = output.file_name().unwrap().to_str().unwrap();
            assert!(name.ends_with(&format!("43Z.{ending}")), "{name}");
            assert_eq!(status::log::file_name::recognize(name), None);
        }
    }

    #[test]
    fn a_topic_is_named_as_in_the_file_or_without_the_robot() {
        let topic = "/robot1/hero/telemetry";
        for (name, expected) in [
            (topic, true),
            ("hero/telemetry", true),
            ("/hero/telemetry", true),
            ("hero_telemetry", true),
            ("hero", true),
            ("dsp", false),
            ("telemetry", false),
            ("/robot2/hero/telemetry", false),
        ] {
            assert_eq!(is_topic(topic, name), expected, "{name}");
        }
    }
}
