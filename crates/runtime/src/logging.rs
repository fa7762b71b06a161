//! Diagnostics: `tracing` to standard error, so that standard output carries data alone. [`LogLines`] has the same
//! lines for a recorder. A layer of `tracing` each puts the lines that the filter lets pass into a bounded queue, from
//! whatever thread they come, and never waits: a line that finds no room is counted. What becomes of the queue to
//! standard error: [`output`]. While no reader wants the lines, one costs [`LogLines`] the check of a flag.

use std::io::Write;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;

use rustix::time::{ClockId, clock_gettime};
use tracing::level_filters::LevelFilter;
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::fmt::FormatFields;
use tracing_subscriber::fmt::format::{DefaultFields, Writer};
use tracing_subscriber::layer::{Context, Layer, SubscriberExt};
use tracing_subscriber::{EnvFilter, fmt};

use crate::exit::{ExitCode, Failure};
use crate::output::{self, LossyQueue, Output};
use crate::plain::plain;

/// The environment variable that chooses what is logged, in the syntax of `tracing_subscriber::EnvFilter`, such as
/// `info,bridge=trace`. `-v` and `-q` rule over it.
pub const LOG_VARIABLE: &str = "RIL_LOG";

/// How much is logged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verbosity {
    /// What `RIL_LOG` says; without it, info and above.
    Default,
    /// This level and above, whatever `RIL_LOG` says.
    Level(LevelFilter),
}

impl Verbosity {
    /// The level for that many `-v` and `-q`.
    pub fn from_counts(verbose: u8, quiet: u8) -> Verbosity {
        match (verbose, quiet) {
            (0, 0) => Verbosity::Default,
            (1, _) => Verbosity::Level(LevelFilter::DEBUG),
            (2.., _) => Verbosity::Level(LevelFilter::TRACE),
            (0, 1) => Verbosity::Level(LevelFilter::WARN),
            (0, 2) => Verbosity::Level(LevelFilter::ERROR),
            (0, 3..) => Verbosity::Level(LevelFilter::OFF),
        }
    }
}

/// Starts logging, and the thread that writes it. Only the first call of a process has an effect, so that commands
/// which contain others need not care.
///
/// # Errors
/// `RIL_LOG` cannot be understood (exit code 78).
pub fn init(verbosity: Verbosity) -> Result<(), Failure> {
    let filter = filter(verbosity, std::env::var(LOG_VARIABLE).ok().as_deref())?;
    let to = output::standard_error();
    let standard_error = fmt::layer()
        .with_writer(move || Line(to))
        // Plain text everywhere: a journal, a file and a terminal show the same.
        .with_ansi(false)
        // A closed standard error must not become a panic.
        .log_internal_errors(false);
    let subscriber = tracing_subscriber::registry()
        .with(filter)
        .with(standard_error)
        .with(LineLayer);
    let _ = tracing::subscriber::set_global_default(subscriber);
    Ok(())
}

/// Longest line on standard error, bytes; a longer one is cut and ends with `…`. The queue's bound in bytes follows
/// from it.
const MAX_LINE: usize = 8192;

/// A line for standard error, which the layer writes by one call.
struct Line(&'static Output);

impl Write for Line {
    fn write(&mut self, line: &[u8]) -> std::io::Result<usize> {
        let mut text = plain(&String::from_utf8_lossy(line)).into_owned();
        if text.len() > MAX_LINE {
            text = cut(text, MAX_LINE - 1) + "\n";
        }
        self.0.put(text);
        Ok(line.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// This level, and of the network library only its errors: it warns about each connection that an unknown peer tries,
/// and such a peer can try without end.
fn quietened(level: LevelFilter) -> String {
    format!("{level},zenoh={}", level.min(LevelFilter::ERROR))
}

/// The filter for `verbosity` when the environment says `variable`.
fn filter(verbosity: Verbosity, variable: Option<&str>) -> Result<EnvFilter, Failure> {
    let directives = match (verbosity, variable) {
        (Verbosity::Level(level), _) if level >= LevelFilter::DEBUG => level.to_string(),
        (Verbosity::Level(level), _) => quietened(level),
        (Verbosity::Default, None | Some("")) => quietened(LevelFilter::INFO),
        (Verbosity::Default, Some(variable)) => variable.to_owned(),
    };
    EnvFilter::try_new(&directives).map_err(|error| {
        Failure::new(ExitCode::Configuration, error).context(format!(
            "{LOG_VARIABLE}=`{directives}` is not a log filter: try `info`, or `warn,bridge=debug`"
        ))
    })
}

/// Lines that wait until they are taken; a further one is lost, and counted.
pub const MAX_WAITING: usize = 256;

/// Longest text of a line, bytes; a longer one is cut and ends with `…`.
pub const MAX_TEXT: usize = 1024;

/// What stands at the end of a text that was cut.
const CUT: &str = "…";

static TAP: OnceLock<Tap> = OnceLock::new();

/// Where the layer puts the lines.
#[derive(Debug)]
struct Tap {
    queue: LossyQueue<LogLine>,
    is_wanted: AtomicBool,
}

/// A line of the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogLine {
    /// When: host `CLOCK_MONOTONIC`, ns.
    pub at_ns: u64,
    /// How grave.
    pub level: Level,
    /// Path of the module in the source, such as `bridge::shell::audit`.
    pub module: String,
    /// Message and fields, as standard error has them; at most 1024 bytes, a longer text ends with `…`.
    pub text: String,
}

/// The lines of this process's log.
#[derive(Debug)]
pub struct LogLines {
    receiver: Receiver<LogLine>,
    tap: &'static Tap,
}

impl LogLines {
    /// The lines of this process, which has one such value: nothing at the second call.
    pub fn claim() -> Option<LogLines> {
        let mut receiver = None;
        let tap = TAP.get_or_init(|| {
            let (queue, lines) = LossyQueue::new(MAX_WAITING);
            receiver = Some(lines);
            Tap {
                queue,
                is_wanted: AtomicBool::new(false),
            }
        });
        receiver.map(|receiver| LogLines { receiver, tap })
    }

    /// Says whether lines are wanted from now on; those that wait are forgotten.
    pub fn want(&self, is_wanted: bool) {
        self.tap.is_wanted.store(is_wanted, Ordering::Relaxed);
        self.receiver.try_iter().for_each(drop);
        self.tap.queue.take_lost();
    }

    /// How many lines found no room since the last call.
    pub fn take_lost(&self) -> u64 {
        self.tap.queue.take_lost()
    }

    /// The lines that wait, oldest first.
    pub fn drain(&self) -> impl Iterator<Item = LogLine> + '_ {
        self.receiver.try_iter()
    }
}

impl Drop for LogLines {
    fn drop(&mut self) {
        self.tap.is_wanted.store(false, Ordering::Relaxed);
    }
}

/// Puts the lines where [`LogLines`] finds them.
#[derive(Debug)]
struct LineLayer;

impl<S: Subscriber> Layer<S> for LineLayer {
    fn on_event(&self, event: &Event<'_>, _context: Context<'_, S>) {
        let Some(tap) = TAP
            .get()
            .filter(|tap| tap.is_wanted.load(Ordering::Relaxed))
        else {
            return;
        };
        let now = clock_gettime(ClockId::Monotonic);
        let mut text = String::new();
        // Writing into a text cannot fail; a value that cannot be shown leaves what is there.
        let _ = DefaultFields::new().format_fields(Writer::new(&mut text), event);
        let line = LogLine {
            at_ns: now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64,
            level: *event.metadata().level(),
            module: event.metadata().target().to_owned(),
            text: cut(text, MAX_TEXT),
        };
        if tap.queue.offer(line).is_err() {
            tap.queue.lose(1);
        }
    }
}

fn cut(mut text: String, most: usize) -> String {
    if text.len() > most {
        let mut end = most - CUT.len();
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        text.truncate(end);
        text += CUT;
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_rules_over_the_environment() {
        for (verbose, quiet, variable, expected) in [
            (0, 0, None, "zenoh=error,info"),
            (0, 0, Some(""), "zenoh=error,info"),
            (0, 0, Some("bridge=trace"), "bridge=trace"),
            (1, 0, Some("error"), "debug"),
            (2, 0, None, "trace"),
            (9, 0, None, "trace"),
            (0, 1, Some("trace"), "zenoh=error,warn"),
            (0, 2, None, "zenoh=error,error"),
            (0, 3, None, "zenoh=off,off"),
        ] {
            let filter = filter(Verbosity::from_counts(verbose, quiet), variable).unwrap();
            assert_eq!(
                filter.to_string(),
                expected,
                "{verbose} {quiet} {variable:?}"
            );
        }
    }

    #[test]
    fn a_filter_that_makes_no_sense_is_a_configuration_error() {
        let failure = filter(Verbosity::Default, Some("bridge=loud")).unwrap_err();
        assert_eq!(failure.code(), ExitCode::Configuration);
        assert!(failure.chain()[0].contains("RIL_LOG"));
    }

    /// The one test that claims the lines: all tests of this crate are one process.
    #[test]
    fn lines_are_there_while_they_are_wanted_and_losses_are_counted() {
        let lines = LogLines::claim().unwrap();
        assert!(LogLines::claim().is_none());
        let _logging =
            tracing::subscriber::set_default(tracing_subscriber::registry().with(LineLayer));
        tracing::info!("nobody wants it");
        lines.want(true);
        tracing::warn!(port = 7, name = "sci_a", "gone");
        tracing::error!("{}", "ä".repeat(MAX_TEXT));
        let taken: Vec<_> = lines.drain().collect();
        assert_eq!(taken.len(), 2, "{taken:?}");
        assert_eq!(taken[0].level, Level::WARN);
        assert_eq!(taken[0].module, module_path!());
        assert_eq!(taken[0].text, "gone port=7 name=\"sci_a\"");
        assert!(taken[0].at_ns > 0 && taken[0].at_ns <= taken[1].at_ns);
        assert!(taken[1].text.len() <= MAX_TEXT && taken[1].text.ends_with("ä…"));

        for number in 0..MAX_WAITING + 3 {
            tracing::info!(number, "many");
        }
        assert_eq!(lines.take_lost(), 3);
        assert_eq!(lines.take_lost(), 0);
        let taken: Vec<_> = lines.drain().collect();
        assert_eq!(taken.len(), MAX_WAITING);
        assert_eq!(taken[0].text, "many number=0", "the oldest stay");

        tracing::info!("it waits");
        lines.want(false);
        tracing::info!("nobody wants it");
        assert_eq!(lines.drain().count(), 0);
    }
}
