//! `ril log list`: the files of logs, as a table or as objects.

use std::io::{self, BufWriter, Write};

use operator::render::words::duration_with_tenths;
use operator::render::{json_line, note};
use operator::session::configuration;
use runtime::exit::Failure;
use runtime::plain::plain_name;
use serde::Serialize;
use status::log::clock::IsoTime;

use super::files::{self, FoundLog, folders};
use super::options::LogListArgs;

/// Name of the layout of a file in a list.
const SCHEMA: &str = "ril.LogFile.v1";

/// One file of a list, for programs.
#[derive(Serialize)]
struct FileObject<'a> {
    schema: &'static str,
    file: String,
    robot: u32,
    /// Name of the log; empty when it has none.
    log: &'a str,
    /// When the file was created, UTC, as its name says.
    start_utc: String,
    /// From the first row to the last; `None` if there is no row, or the file cannot be read.
    duration_s: Option<f64>,
    size_bytes: u64,
    /// Why its rows cannot be read.
    trouble: Option<String>,
}

impl<'a> FileObject<'a> {
    fn new(file: &'a FoundLog) -> FileObject<'a> {
        let seconds = file.duration_s();
        FileObject {
            schema: SCHEMA,
            file: file.path.display().to_string(),
            robot: file.robot(),
            log: file.series.name(),
            start_utc: start(file),
            size_bytes: file.size_bytes,
            trouble: seconds
                .as_ref()
                .err()
                .map(|failure| failure.chain().join(": ")),
            duration_s: seconds.ok().flatten(),
        }
    }

    /// A row of the table.
    fn row(&self) -> [String; 5] {
        let duration = match (self.duration_s, &self.trouble) {
            (Some(seconds), _) => duration_with_tenths(seconds),
            (None, None) => "no row".to_owned(),
            (None, Some(_)) => "damaged".to_owned(),
        };
        [
            self.start_utc.clone(),
            duration,
            size(self.size_bytes),
            self.robot.to_string(),
            plain_name(&self.file).into_owned(),
        ]
    }
}

/// `ril log list`
///
/// # Errors
///
/// Code 2 when a folder cannot be read.
pub(super) fn list(args: &LogListArgs) -> Result<(), Failure> {
    configuration(&args.place.common)?;
    let folders = folders(&args.place)?;
    let mut found = files::find(&folders)?;
    if args.place.common.robot.is_some() {
        found.retain(|file| file.robot() == args.place.common.robot().get());
    }
    let mut out = BufWriter::new(io::stdout().lock());
    if found.is_empty() {
        note(format_args!(
            "no log in {}: `[[log]]` of status.toml and `ril record` make some, and --dir names another folder",
            files::names(&folders)
        ));
    } else if !args.json {
        let titles = ["START (UTC)", "DURATION", "SIZE", "ROBOT", "FILE"];
        writeln!(out, "{}", line(titles)).map_err(Failure::output)?;
    }
    for file in &found {
        let object = FileObject::new(file);
        if args.json {
            json_line(&mut out, &object)?;
        } else {
            let row = object.row();
            writeln!(out, "{}", line(row.each_ref().map(String::as_str)))
                .map_err(Failure::output)?;
        }
    }
    out.flush().map_err(Failure::output)
}

/// The name of a file in the folder `log` has 33 characters: with it a line has 80.
fn line([start, duration, size, robot, file]: [&str; 5]) -> String {
    format!("{start:<20} {duration:>8} {size:>9} {robot:>5} {file}")
}

/// When the file was created, to the second.
fn start(file: &FoundLog) -> String {
    let unix_ns = file.created_unix_s().saturating_mul(1_000_000_000);
    let time = IsoTime::from_unix_ns(unix_ns).to_string();
    time.split('.').next().unwrap_or_default().to_owned() + "Z"
}

fn size(bytes: u64) -> String {
    const KIB: f64 = 1024.0;
    let bytes = bytes as f64;
    if bytes < KIB {
        format!("{bytes} B")
    } else if bytes < KIB * KIB {
        format!("{:.1} KiB", bytes / KIB)
    } else {
        format!("{:.1} MiB", bytes / KIB / KIB)
    }
}
