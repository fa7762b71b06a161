//! `ril echo`: prints samples as they come, and says at the end how many were lost.

use std::fmt::Write as _;
use std::io::{self, BufWriter, Write};
use std::time::Duration;

use clap::Args;
use ipc_types::{Losses, MonotonicNs, Schema};
use operator::options::EXIT_CODES;
use operator::render::fields::{JsonLine, Meaning, Plain, Selection, Tree};
use operator::render::stamps::StampReader;
use operator::render::words::count as plural;
use operator::render::{json_line, note};
use operator::robot::freshness::STALE_AFTER;
use runtime::exit::Failure;

use super::stream::{Stream, StreamArgs, Watcher};

/// `ril echo`, `ril topic echo`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct EchoArgs {
    /// The samples.
    #[command(flatten)]
    pub stream: StreamArgs,

    /// End after so many samples
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub count: Option<u64>,

    /// Print only this field, or group of fields, such as geographic.latitude_deg or geographic; can be repeated.
    /// `ril topic info` lists them
    #[arg(long = "field", value_name = "NAME")]
    pub fields: Vec<String>,

    /// Print each sample as a JSON object on a line
    #[arg(long)]
    pub json: bool,
}

/// `ril echo`
///
/// # Errors
///
/// Code 2 for a field that does not exist, 3 when there is no such topic or no process publishes it, 4 when the
/// publisher says nothing.
pub fn echo(args: &EchoArgs) -> Result<(), Failure> {
    let (watched, stream) = Stream::open(&args.stream, args.count)?;
    let printer = Printer {
        key: &watched.key,
        schema: &watched.schema,
        stamps: StampReader::of(&watched.schema),
        meaning: Meaning::of_type(watched.schema.type_name()),
        selection: Selection::of_topic(&watched.schema, &args.fields, &watched.key)?,
        json: args.json,
        out: BufWriter::new(io::stdout().lock()),
        seen: Printed::default(),
    };
    stream.watch(&watched, printer, |printer, losses| {
        if tracing::enabled!(tracing::Level::INFO) {
            note(printer.seen.summary(losses));
        }
        Ok(())
    })
}

/// How samples are printed.
struct Printer<'a, W> {
    key: &'a str,
    schema: &'a Schema,
    stamps: StampReader,
    meaning: Meaning,
    selection: Selection,
    json: bool,
    out: W,
    seen: Printed,
}

impl<W: Write> Watcher for Printer<'_, W> {
    fn sample(&mut self, payload: &[u8]) -> Result<bool, Failure> {
        let now = MonotonicNs::now();
        let stamps = self.stamps.read(payload, now);
        let note = match self.seen.samples {
            0 => note_of_age(now.since(stamps.sent), self.key),
            _ => None,
        };
        self.seen.take(stamps.sent.0);
        self.print(payload)?;
        if let Some(note) = note {
            self.out.flush().map_err(Failure::output)?;
            self::note(note);
        }
        Ok(true)
    }

    fn woken(&mut self, _: Losses, _: MonotonicNs) -> Result<(), Failure> {
        self.out.flush().map_err(Failure::output)
    }
}

impl<W: Write> Printer<'_, W> {
    fn print(&mut self, payload: &[u8]) -> Result<(), Failure> {
        let schema = self.schema;
        let tree = Tree::read(schema, self.meaning, payload, &self.selection);
        if self.json {
            let line = JsonLine {
                schema: schema.type_name(),
                tree: &tree,
            };
            return json_line(&mut self.out, &line);
        }
        let text = if self.selection.is_everything() {
            block(&tree)
        } else {
            line(&tree)
        };
        self.out.write_all(text.as_bytes()).map_err(Failure::output)
    }
}

/// What is said of a first sample that is so old that it does not show how things are now. It is the last one that was
/// published, which every subscriber gets at once: newer ones do not come because nothing of the kind happens or
/// because the link is down.
fn note_of_age(age: Duration, key: &str) -> Option<String> {
    let age_ms = age.as_millis();
    (age > STALE_AFTER).then(|| {
        format!(
            "note: this is the last sample of {key}, {age_ms} ms old; `ril status` shows whether the link is down"
        )
    })
}

/// A whole sample: a line for each field, and one that ends it.
fn block(tree: &Tree) -> String {
    let mut text = String::new();
    for (name, value) in tree.plain_fields() {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{name}: {}", Plain(value));
    }
    text + "---\n"
}

/// Chosen fields: one line for each sample.
fn line(tree: &Tree) -> String {
    let fields = tree.plain_fields().into_iter();
    let fields: Vec<String> = fields
        .map(|(name, value)| format!("{name}={}", Plain(value)))
        .collect();
    fields.join("  ") + "\n"
}

/// Fewer samples than this say nothing about a rate: those of a change come close together.
const FEWEST_FOR_RATE: u64 = 5;

/// What was printed.
#[derive(Debug, Default)]
struct Printed {
    samples: u64,
    first_ns: u64,
    last_ns: u64,
}

impl Printed {
    /// A sample that was made at `sent_ns`.
    fn take(&mut self, sent_ns: u64) {
        self.last_ns = sent_ns;
        if self.samples == 0 {
            self.first_ns = self.last_ns;
        }
        self.samples += 1;
    }

    fn summary(&self, losses: Losses) -> String {
        let count = self.samples;
        let seconds = self.last_ns.saturating_sub(self.first_ns) as f64 / 1e9;
        let rate = if count >= FEWEST_FOR_RATE && seconds > 0.0 {
            format!(" at {:.1} a second", (count - 1) as f64 / seconds)
        } else {
            String::new()
        };
        let (lost, changes) = (losses.lost, losses.publisher_restarts);
        let (samples, changes) = (
            plural(count, "sample"),
            plural(changes, "publisher restart"),
        );
        format!("{samples}{rate}, {lost} lost, {changes}")
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::TelemetryGroup;
    use ipc_types::payload::{DspTelemetry, SharedStruct};

    use super::*;

    fn sample() -> DspTelemetry {
        let mut sample = DspTelemetry {
            sequence: 3,
            valid_groups: TelemetryGroup::Geographic.bit(),
            ..DspTelemetry::default()
        };
        sample.geographic.altitude_m = 1.5;
        sample
    }

    fn printed(names: &[&str], json: bool) -> String {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        let schema = &Schema::of::<DspTelemetry>();
        let mut printer = Printer {
            key: "dsp_telemetry",
            schema,
            stamps: StampReader::of(schema),
            meaning: Meaning::of::<DspTelemetry>(),
            selection: Selection::of(schema, &names).unwrap(),
            json,
            out: Vec::new(),
            seen: Printed::default(),
        };
        printer.print(sample().bytes()).unwrap();
        String::from_utf8(printer.out).unwrap()
    }

    #[test]
    fn chosen_fields_are_one_line_for_each_sample() {
        let names = ["sequence", "geographic.altitude_m", "rotor_rpm"];
        assert_eq!(
            printed(&names, false),
            "sequence=3  rotor_rpm=-  geographic.altitude_m=1.5\n"
        );
        assert_eq!(
            printed(&names, true),
            "{\"schema\":\"hero.DspTelemetry.v3\",\"sequence\":3,\"rotor_rpm\":null,\"geographic\":{\"altitude_m\":1.5}}\n"
        );
    }

    #[test]
    fn whole_samples_are_blocks_with_an_end() {
        let text = printed(&[], false);
        assert!(text.starts_with("sequence: 3\nepoch_ns: 0\n"), "{text}");
        assert!(text.contains("\nattitude.yaw_deg: -\n"), "{text}");
        assert!(text.ends_with("\n---\n"), "{text}");
    }

    #[test]
    fn a_first_sample_that_is_old_is_said_to_be_so() {
        assert_eq!(note_of_age(STALE_AFTER, "dsp_telemetry"), None);
        let note = note_of_age(Duration::from_secs(12), "dsp_telemetry").unwrap();
        assert!(
            note.contains("last sample of dsp_telemetry, 12000 ms old"),
            "{note}"
        );
    }

    #[test]
    fn the_summary_counts_what_was_printed_and_tells_the_rate() {
        let mut seen = Printed::default();
        let losses = Losses {
            lost: 3,
            publisher_restarts: 1,
            ..Losses::default()
        };
        assert_eq!(
            seen.summary(losses),
            "0 samples, 3 lost, 1 publisher restart"
        );
        for index in 0..4 {
            seen.take(1_000_000_000 + index * 20_000_000);
        }
        assert_eq!(
            seen.summary(Losses::default()),
            "4 samples, 0 lost, 0 publisher restarts"
        );
        seen.take(1_080_000_000);
        assert_eq!(
            seen.summary(Losses::default()),
            "5 samples at 50.0 a second, 0 lost, 0 publisher restarts"
        );
    }
}
