//! `ril log …`: what status and `ril record` wrote. It needs no process and joins no shared memory.
//!
//! `files` finds and opens files, `list` lists them, `tail` follows one, `report` makes a page of one, `whole` checks
//! and recovers records. `recording` reads their entries: its `LogFormat` is the one place to add another format. `row`
//! and `summary` are pure values that take entries.

mod check;
mod files;
mod list;
pub mod options;
mod recording;
mod report;
mod row;
mod summary;
mod tail;
#[cfg(test)]
mod tests;
mod whole;

use std::io::{self, BufWriter};

use operator::render::print;
use operator::session::configuration;
use runtime::exit::Failure;
use status::log::groups::LogGroups;

use self::files::{MAX_NAMED, OF_SAMPLES, chosen_file};
use self::options::{LogArgs, LogCommand, LogCsvArgs, LogFileArgs};
use self::recording::LogEntry;
pub use self::report::report_page;
use self::row::{Chosen, UTC, UtcSource, UtcTimes};
use self::summary::Summarizer;

/// `ril log …`
///
/// # Errors
///
/// Code 2 when a file or folder cannot be read or is no log, 8 when a part of a log is damaged, after all that could be
/// read.
pub fn log(args: &LogArgs) -> Result<(), Failure> {
    match &args.command {
        LogCommand::List(args) => list::list(args),
        LogCommand::Summary(args) => summary(args),
        LogCommand::Report(args) => report::report(args),
        LogCommand::Tail(args) => tail::tail(args),
        LogCommand::Csv(args) => csv(args),
        LogCommand::Check(args) => whole::check(args),
        LogCommand::Recover(args) => whole::recover(args),
        LogCommand::Export(args) => whole::export(args),
    }
}

fn summary(args: &LogFileArgs) -> Result<(), Failure> {
    configuration(&args.place.common)?;
    let mut file = chosen_file(args.file.as_ref(), &args.place, OF_SAMPLES)?;
    let (name, robot, created) = (file.name(), file.robot(), file.created_unix_s());
    file.begin()?;
    let columns = file.recording.columns();
    let source = UtcSource::of(columns, created);
    let mut summarizer = Summarizer::new(name, robot, columns, source);
    let end = file.read(|entry, _| {
        match entry {
            LogEntry::Row(row) => summarizer.row(&row),
            LogEntry::Damaged(damage) => summarizer.damage(&damage),
        }
        Ok(())
    })?;
    print(&summarizer.finish(end.unfinished_bytes), args.json)?;
    end.verdict()
}

fn csv(args: &LogCsvArgs) -> Result<(), Failure> {
    configuration(&args.place.common)?;
    let mut file = chosen_file(args.file.as_ref(), &args.place, LogGroups::ALL)?;
    let (name, created) = (file.name(), file.created_unix_s());
    file.begin()?;
    let columns = file.recording.columns().to_vec();
    let chosen = match args.fields.is_empty() {
        true => Chosen::all(&columns),
        false => Chosen::named(&columns, &args.fields)
            .map_err(|reason| Failure::usage(format!("{name}: {reason}")))?,
    };
    let source = UtcSource::of(&columns, created);
    note(source);
    let mut times = UtcTimes::new(source);
    let mut out = ::csv::Writer::from_writer(BufWriter::new(io::stdout().lock()));
    let header = [UTC].into_iter().chain(chosen.names());
    out.write_record(header).map_err(written)?;
    let end = file.read(|entry, damaged| match entry {
        LogEntry::Row(row) => {
            let time = times
                .of(&row)
                .map_or_else(String::new, |time| time.to_string());
            let cells = chosen.cells(&row);
            let record = [time.as_str()].into_iter().chain(cells);
            out.write_record(record).map_err(written)
        }
        LogEntry::Damaged(damage) => {
            if damaged <= MAX_NAMED {
                tracing::warn!("{name}: {damage}");
            }
            Ok(())
        }
    })?;
    out.flush().map_err(Failure::output)?;
    end.verdict()
}

/// Says where times come from when they do not come from the log.
fn note(source: UtcSource) {
    match source {
        UtcSource::Column => {}
        UtcSource::FileName(_) => tracing::warn!(
            "the log has no column `utc`: times count from the file's name, and may be early by as long as status waited for \
             telemetry; set `utc = true` in status.toml"
        ),
        UtcSource::Nowhere => tracing::warn!(
            "times in UTC are not known: the log has no column `utc`, and its file has another name than status gave it"
        ),
    }
}

fn written(error: ::csv::Error) -> Failure {
    match error.into_kind() {
        ::csv::ErrorKind::Io(error) => Failure::output(error),
        other => Failure::internal(format!("CSV cannot be written: {other:?}")),
    }
}
