//! `ril log report`: a log as a page in one file.

mod collector;
mod curves;
mod events;
mod module;
mod record;
mod requests;
#[cfg(test)]
mod tests;
mod words;

use std::fs::{self, File, Permissions};
use std::io::{self, Write};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

use operator::render::print_as;
use operator::robot::chart::{Chart, FenceFile, of_files};
use operator::session::configuration;
use recording::read::{RecordFile, RecordSummary, summary_of};
use runtime::exit::Failure;
use serde::Serialize;
use view::page::Weight;
use view::report::FlightReport;
use view::report::flight::Table;

use self::collector::Collector;
use super::files::{LogEnd, LogFile, MAX_NAMED, OF_SAMPLES, OrFailUsage as _, chosen_file};
use super::options::LogReportArgs;
use super::recording::{LogEntry, LogFormat};
use super::row::UtcSource;
use super::summary::{Summarizer, Summary};

/// Name of the JSON object's layout.
const SCHEMA: &str = "ril.LogReport.v1";

/// What was written, for programs.
#[derive(Serialize)]
struct ReportObject {
    schema: &'static str,
    /// The log.
    file: String,
    /// The page.
    output: String,
    samples: u64,
    duration_s: f64,
    events: usize,
    alarms: usize,
}

/// A log that was read to its end.
struct Read {
    flight: FlightReport,
    summary: Summary,
    end: LogEnd,
}

/// `ril log report`
///
/// # Errors
///
/// Code 2 when a file cannot be read or written or is no log, 8 when a part of the log is damaged, after the report was
/// written; 78 when a configuration is wrong.
pub(super) fn report(args: &LogReportArgs) -> Result<(), Failure> {
    configuration(&args.place.common)?;
    let chart = of_files(args.bridge.as_deref(), args.plan.as_deref())?;
    let file = chosen_file(args.file.as_ref(), &args.place, OF_SAMPLES)?;
    let log = file.path().to_owned();
    let output = match &args.output {
        Some(output) => output.clone(),
        None => output_of(&log),
    };
    refuse_the_log_itself(&log, &output)?;
    let read = read(file, chart, args.bridge.is_none())?;
    let page = view::report::page(&read.flight);
    replace(&output, page.as_bytes())?;
    print_result(args, &log, &output, &read, page.len())?;
    read.end.verdict()
}

/// The report of the log at `path`, an HTML page, as it is without any option.
///
/// # Errors
///
/// Code 2 when the file cannot be read or is no log.
pub fn report_page(path: &Path) -> Result<String, Failure> {
    let file = LogFile::open(path, OF_SAMPLES)?;
    let read = read(file, of_files(None, None)?, true)?;
    Ok(view::report::page(&read.flight))
}

/// The page of a log that is named after it, in the working directory.
fn output_of(log: &Path) -> PathBuf {
    let stem = log.file_stem().unwrap_or(log.as_os_str());
    let mut name = stem.to_owned();
    name.push(".html");
    PathBuf::from(name)
}

/// A page in place of the log would be the end of the log.
fn refuse_the_log_itself(log: &Path, output: &Path) -> Result<(), Failure> {
    let id = |path: &Path| fs::metadata(path).ok().map(|file| (file.dev(), file.ino()));
    if id(output).is_some_and(|output| Some(output) == id(log)) {
        return Err(Failure::usage(format!(
            "--output {}: that is the log itself; name another file",
            output.display()
        )));
    }
    Ok(())
}

/// A record of `ril record`, which has more than the samples of the DSP.
struct OpenRecording {
    file: RecordFile,
    summary: RecordSummary,
}

impl OpenRecording {
    /// The record at `path`. No message is read.
    fn open(path: &Path) -> Result<OpenRecording, Failure> {
        let file = RecordFile::open(path).or_fail_usage(path)?;
        // A damaged summary is no reason for no report: the samples are read without it.
        let summary = summary_of(&file).unwrap_or_default();
        Ok(OpenRecording { file, summary })
    }

    /// The fence that the bridge had, by the configuration in the record.
    fn fence(&self) -> Option<Chart> {
        let files = &self.summary.attachments;
        let named = |name: &str| files.iter().rev().find(|file| file.name == name);
        // What it ran with, whatever the file said when it was read.
        let file = named("bridge.running.toml");
        let file = file.or_else(|| named(bridge::cli::DEFAULT_CONFIG_FILE))?;
        let text = std::str::from_utf8(&file.data).ok()?;
        let fence = runtime::config::parse::<FenceFile>(text, &file.name).ok()?;
        Some(Chart::new(&fence.fence, &[]))
    }
}

/// Reads the log to its end, or as far as it can be read. `finds_fence`: the fence is that of the record, if it has
/// one.
fn read(mut file: LogFile, mut chart: Chart, finds_fence: bool) -> Result<Read, Failure> {
    let record = match file.format {
        LogFormat::Mcap => Some(OpenRecording::open(file.path())?),
        LogFormat::Tsv => None,
    };
    if let Some(fence) = record.as_ref().and_then(OpenRecording::fence)
        && finds_fence
    {
        chart = Chart {
            path: chart.path,
            ..fence
        };
    }
    let (name, robot, created) = (file.name(), file.robot(), file.created_unix_s());
    file.begin()?;
    let columns = file.recording.columns().to_vec();
    let source = UtcSource::of(&columns, created);
    let mut summarizer = Summarizer::new(name, robot, &columns, source);
    let mut collector = Collector::default();
    let mut start_unix_ns = match source {
        UtcSource::FileName(created_ns) => Some(created_ns),
        UtcSource::Column | UtcSource::Nowhere => None,
    };
    let end = file.read(|entry, damaged| {
        match entry {
            LogEntry::Row(row) => {
                start_unix_ns = start_unix_ns.or(row.unix_ns);
                summarizer.row(&row);
                collector.sample(row.sample);
            }
            LogEntry::Damaged(damage) => {
                summarizer.damage(&damage);
                if damaged <= MAX_NAMED {
                    collector.damage(&damage.to_string());
                }
            }
        }
        Ok(())
    })?;
    let summary = summarizer.finish(end.unfinished_bytes);
    if let Some(record) = &record {
        record::take(&mut collector, &record.file, start_unix_ns);
    }
    let mut flight = collector.finish(words::title(&summary), &chart);
    flight.start_unix_ns = start_unix_ns;
    flight.lead = words::lead(&summary);
    flight.summary = words::sentences(&summary);
    flight.facts = words::facts(&summary);
    flight.metadata = match &record {
        Some(record) => record::tables(&record.summary),
        None => vec![Table {
            title: "The log".to_owned(),
            rows: words::log(&summary, &columns),
        }],
    };
    Ok(Read {
        flight,
        summary,
        end,
    })
}

/// Writes a file as a whole, in place of an earlier one.
fn replace(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    if path.exists() && !path.is_file() {
        let name = path.display();
        return Err(Failure::usage(format!("{name}: it is no regular file")));
    }
    let folder = super::files::folder_of(path);
    let write = || -> io::Result<File> {
        let mut new = tempfile::Builder::new()
            .prefix(".ril-report-")
            // The process' umask applies to these permissions.
            .permissions(Permissions::from_mode(0o666))
            .tempfile_in(&folder)?;
        new.write_all(bytes)?;
        Ok(new.persist(path)?)
    };
    write().map(drop).map_err(|error| unwritten(path, &error))
}

fn unwritten(path: &Path, error: &io::Error) -> Failure {
    Failure::usage(format!("{} cannot be written: {error}", path.display()))
        .with_next_step("name another place with --output")
}

/// Says what was written.
fn print_result(
    args: &LogReportArgs,
    log: &Path,
    output: &Path,
    read: &Read,
    bytes: usize,
) -> Result<(), Failure> {
    let flight = &read.flight;
    let alarms = flight
        .events
        .iter()
        .filter(|event| event.weight == Weight::Alarm);
    let alarms = alarms.count();
    let name = |path: &Path| path.display().to_string();
    let object = ReportObject {
        schema: SCHEMA,
        file: name(log),
        output: name(output),
        samples: read.summary.rows,
        duration_s: flight.duration_s,
        events: flight.events.len(),
        alarms,
    };
    let text = format_args!(
        "{}: {} kB, {} events, {alarms} alarms; open it in a browser\n",
        object.output,
        bytes.div_ceil(1000),
        object.events
    );
    print_as(args.json, &object, text)
}
