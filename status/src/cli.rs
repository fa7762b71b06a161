//! The command line, for the binary `status` and for the command `ril run status`.

use std::path::Path;

use ipc_types::configuration::ConfigurationText;
use module_kit::SetUp;
use runtime::args::CommonArgs;
use runtime::config::resulting::Resulting;
use runtime::exit::Failure;

use crate::config::{Config, DEFAULT_FILE};
use crate::core::Summary;
use crate::log::event::{LogSummary, WriterEnd, Written};
use crate::shell::Shell;

/// Translate the DSP's raw telemetry into SI units, publish it, and write logs
#[derive(Clone, Debug, clap::Parser)]
#[command(name = "status", version)]
pub struct Args {
    /// What every process takes.
    #[command(flatten)]
    pub common: CommonArgs,
}

/// What the process would run with.
///
/// # Errors
///
/// Exit code 78 when the configuration is wrong.
pub fn check_config(args: &Args) -> Result<Resulting, Failure> {
    let (file, default) = (
        args.common.settings.config.as_deref(),
        Path::new(DEFAULT_FILE),
    );
    let example = include_str!("../status.toml");
    Ok(Resulting::load::<Config>(file, default, example)?)
}

/// Runs the process until SIGINT or SIGTERM.
///
/// # Errors
/// The configuration is wrong (exit code 78), or the process cannot start (1); the failure says what to do.
pub fn run(args: Args) -> Result<(), Failure> {
    if args.common.settings.check_config {
        return check_config(&args)?.print();
    }
    let Some(set_up) = SetUp::<Config>::begin(&args.common, DEFAULT_FILE)? else {
        return Ok(());
    };
    let ipc = set_up.join("status")?;
    let text = check_config(&args)?.annotate(&set_up.config.to_toml());
    let shell = Shell::open(ipc, &set_up.config)?.with_configuration(ConfigurationText::new(text));
    let summary = shell.run(&set_up.termination, &set_up.supervisor)?;
    log_summary(&summary);
    Ok(())
}

/// Logs in one line what the process did, and what became of each log.
fn log_summary(summary: &Summary) {
    let logs: Vec<_> = summary.logs.iter().map(outcome).collect();
    tracing::info!(
        received = summary.received,
        lost = summary.lost,
        published = summary.published,
        logs = ?logs,
        "ended"
    );
}

/// What became of a log, in words; losses only if there are some.
fn outcome(log: &LogSummary) -> String {
    let LogSummary {
        log: name,
        offered,
        refused,
        end,
    } = log;
    let lost = log.lost();
    let unknown = offered.saturating_sub(*refused);
    let mut text = match end {
        WriterEnd::Finished(Written { files: 1, rows, .. }) => {
            format!("{name}: {rows} rows in 1 file")
        }
        WriterEnd::Finished(Written { files, rows, .. }) => {
            format!("{name}: {rows} rows in {files} files")
        }
        WriterEnd::DiskHangs => {
            format!(
                "{name}: the disk does not answer, it is unknown which of {unknown} rows it has"
            )
        }
        WriterEnd::ThreadFailed => {
            format!(
                "{name}: the log's thread failed, it is unknown which of {unknown} rows the disk has"
            )
        }
    };
    if lost > 0 {
        text += &format!(", {lost} rows lost");
    }
    if let WriterEnd::Finished(Written {
        unsynced: rows @ 1..,
        ..
    }) = end
    {
        text += &format!(", {rows} rows perhaps not on the disk");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_outcome_of_a_log_in_words() {
        let summary = |offered, refused, end| LogSummary {
            log: "log/x.tsv".to_owned(),
            offered,
            refused,
            end,
        };
        let written = |files, unsynced| {
            WriterEnd::Finished(Written {
                files,
                rows: 50,
                unsynced,
            })
        };
        #[rustfmt::skip]
        let cases = [
            (summary(50, 0, written(1, 0)), "log/x.tsv: 50 rows in 1 file"),
            (summary(97, 40, written(2, 0)), "log/x.tsv: 50 rows in 2 files, 47 rows lost"),
            (summary(50, 0, written(2, 5)), "log/x.tsv: 50 rows in 2 files, 5 rows perhaps not on the disk"),
            (
                summary(97, 7, WriterEnd::DiskHangs),
                "log/x.tsv: the disk does not answer, it is unknown which of 90 rows it has, 7 rows lost",
            ),
            (
                summary(97, 7, WriterEnd::ThreadFailed),
                "log/x.tsv: the log's thread failed, it is unknown which of 90 rows the disk has, 7 rows lost",
            ),
        ];
        for (summary, expected) in cases {
            assert_eq!(outcome(&summary), expected);
        }
    }
}
