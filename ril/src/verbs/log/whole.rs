//! `ril log check` and `ril log recover`: what of a flight record is complete, and a whole file of a damaged one.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use recording::read::{self, Bytes, Recovered};
use runtime::exit::{ExitCode, Failure, OrFail};
use serde::Serialize;
use status::log::file_name::FileKind;

use super::files::{OrFailUsage, newest, open};
use super::options::{LogFileArgs, LogRecoverArgs};
use crate::recorded::check::FileCheck;
use crate::render::json_line;
use crate::render::words::{count, shell_word};
use crate::session::configuration;

/// How a file of a record that was made whole ends, behind the name of the damaged one. No log and no recording gives such a
/// name, so that none removes the file to make room.
const RECOVERED: &str = "recovered.mcap";

/// `ril log check`
///
/// # Errors
///
/// Code 2 when the file cannot be read or is no record, 8 when it is not complete.
pub(super) fn check(args: &LogFileArgs) -> Result<(), Failure> {
    if configuration(&args.place.common)?.is_none() {
        return Ok(());
    }
    let path = match &args.file {
        Some(path) => path.clone(),
        None => newest(&args.place, Some(FileKind::Mcap))?,
    };
    let name = path.display().to_string();
    let check = FileCheck::new(name.clone(), read::check(&record(&path)?));
    let mut out = io::stdout().lock();
    match args.json {
        true => json_line(&mut out, &check)?,
        false => write!(out, "{check}").map_err(Failure::output)?,
    }
    if check.is_in_order() {
        return Ok(());
    }
    let (text, next_step) = match check.complete {
        false => (
            format!("{name} is not complete: everything that is in it was counted"),
            format!(
                "`ril log recover {}` makes a whole file of it",
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

/// A record that was made whole, for programs.
#[derive(Serialize)]
struct RecoveredObject {
    schema: &'static str,
    /// The damaged file, which stays as it is.
    file: String,
    /// The whole one.
    output: String,
    messages: u64,
    /// What was wrong.
    errors: Vec<String>,
}

/// `ril log recover`
///
/// # Errors
///
/// Code 2 when the file cannot be read or is no record, or when the new one is there already or cannot be written.
pub(super) fn recover(args: &LogRecoverArgs) -> Result<(), Failure> {
    if configuration(&args.common)?.is_none() {
        return Ok(());
    }
    let bytes = record(&args.file)?;
    let output = match &args.output {
        Some(output) => output.clone(),
        None => beside(&args.file),
    };
    let mut file = BufWriter::new(File::create_new(&output).or_fail_usage(&output)?);
    let recovered = match write_whole(&bytes, &mut file) {
        Ok(recovered) => recovered,
        Err(error) => {
            // A part of a file would look like one that was recovered.
            let _ = fs::remove_file(&output);
            return Err(Failure::usage(error).context(output.display().to_string()));
        }
    };
    let mut out = io::stdout().lock();
    if args.json {
        let object = RecoveredObject {
            schema: "ril.LogRecovered.v1",
            file: args.file.display().to_string(),
            output: output.display().to_string(),
            messages: recovered.messages,
            errors: recovered.errors.iter().map(ToString::to_string).collect(),
        };
        return json_line(&mut out, &object);
    }
    for error in &recovered.errors {
        tracing::info!("{}: {error}", args.file.display());
    }
    let messages = count(recovered.messages, "message");
    writeln!(out, "{}: {messages}", output.display()).map_err(Failure::output)
}

/// Writes all that can be read of `bytes`, onto the disk.
fn write_whole(bytes: &[u8], file: &mut BufWriter<File>) -> Result<Recovered, read::ReadError> {
    let recovered = read::recover(bytes, file)?;
    let written = file.flush().and_then(|()| file.get_ref().sync_all());
    written.map_err(|error| read::ReadError::Io(error.to_string()))?;
    Ok(recovered)
}

/// The bytes of the record at `path`.
fn record(path: &Path) -> Result<Bytes, Failure> {
    // Says why it cannot be read, and refuses what is no regular file.
    open(path)?;
    let bytes = Bytes::open(path).or_fail(ExitCode::Usage);
    let bytes = bytes.map_err(|failure| failure.context(path.display().to_string()))?;
    if bytes.is_empty() {
        let name = path.display();
        return Err(Failure::usage(format!(
            "{name}: it is empty; the recorder ended before it wrote anything"
        )));
    }
    let is_record = read::messages(&bytes).next() != Some(Err(read::ReadError::NotMcap));
    match is_record {
        true => Ok(bytes),
        false => Err(Failure::usage(format!(
            "{}: it is no flight record in the format MCAP; `ril log summary` reads logs of status",
            path.display()
        ))),
    }
}

/// Where the whole file goes when nothing else is said.
fn beside(damaged: &Path) -> PathBuf {
    damaged.with_extension(RECOVERED)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recovered_file_lies_beside_the_damaged_one_and_belongs_to_no_recording() {
        let output = beside(Path::new("log/hero(1)_2026-11-22T11-54-43Z.mcap"));
        assert_eq!(
            output,
            Path::new("log/hero(1)_2026-11-22T11-54-43Z.recovered.mcap")
        );
        let name = output.file_name().unwrap().to_str().unwrap();
        assert_eq!(status::log::file_name::recognize(name), None);
    }
}
