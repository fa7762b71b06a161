//! `cost`: what the bridge and status take of the machine, and how much telemetry they carry without a loss.

use std::fmt;
use std::time::Duration;

use anyhow::Result;
use ipc_types::MonotonicNs;

use super::Common;
use crate::consumer::Kept;
use crate::harness::{Placement, Ril, Site};
use crate::measured::{Measured, Ratio, Round};
use crate::pace::sleep_until;
use crate::report::{Bound, Section};
use crate::usage::{CPU, WAKES, Watch};

/// Telemetry of the first goal, frames a second.
const RATE_HZ: u32 = 100;

/// What the RIL may take of what is taken by hand: where that takes 1.03 % of a core, to wait for 13 descriptors in
/// place of 3 adds 0.15, and the bridge's state, rules, checks and journal 0.3 (`perf` of its symbols); and 15 %.
const MOST_OF_BY_HAND: f64 = 1.65;

/// How long the processes run before they are measured: start-up, first connections, cleaning, and the lines of the log
/// that say that a DSP sends no status.
const START_UP: Duration = Duration::from_secs(6);

/// Rates that are tried, one after the other, when the highest possible one loses samples.
const RATES: [u32; 11] = [
    60_000, 50_000, 40_000, 30_000, 25_000, 22_000, 20_000, 15_000, 10_000, 5_000, 1_000,
];

/// Options of the command.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    common: Common,

    /// Seconds of each measurement
    #[arg(long, default_value_t = 3.0)]
    seconds: f64,

    /// Minutes that a consumer keeps up at 1 kHz; the goal is stated for 10
    #[arg(long, default_value_t = 0.5)]
    minutes: f64,
}

/// What the line does, and who listens.
#[derive(Clone, Copy, PartialEq)]
enum Line {
    Telemetry,
    /// Telemetry to processes that were written by hand.
    ByHand,
    Silent,
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Line::Telemetry => write!(f, "telemetry at {RATE_HZ} Hz"),
            Line::ByHand => write!(f, "telemetry at {RATE_HZ} Hz, by hand"),
            Line::Silent => f.write_str("silent line"),
        }
    }
}

/// Bridge and status with a consumer of `HeroTelemetry`, as they are in a robot.
fn measure(line: Line, seconds: f64) -> Result<Round> {
    let site = Site::new(Placement::Free)?;
    let rate = RATE_HZ.to_string();
    let (ril, consumer) = match line {
        Line::Telemetry => (Ril::start(&site, &rate, true)?, "consume hero"),
        Line::ByHand => (Ril::by_hand(&site, &rate, true)?, "consume-by-hand"),
        Line::Silent => (Ril::start(&site, "silent", true)?, "consume hero"),
    };
    // More than will come: it is killed.
    let consumer = site.start(&format!("{consumer} 1000000"))?;
    sleep_until(MonotonicNs::now() + START_UP)?;
    let status = ril.status.as_ref().map(|status| ("status", status));
    let watch = Watch::begin(std::iter::once(("bridge", &ril.bridge)).chain(status))?;
    sleep_until(watch.since() + Duration::from_secs_f64(seconds))?;
    let mut round = Round::default();
    watch.end(&mut round)?;
    drop(consumer);
    ril.end(&site)?;
    Ok(round)
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let lines = [Line::Telemetry, Line::ByHand, Line::Silent];
    let measured = Measured::take(&lines, args.common.rounds, |line| {
        measure(line, args.seconds)
    })?;
    let mut section = Section::new("cost", "What it costs, and how much it carries");
    section.text(format!(
        "`ril run bridge` and `ril run status` as processes, one consumer of `HeroTelemetry` that blocks, full status frames on a \
         pseudo-terminal that is not paced. Processor time is that of `/proc/PID/task/*/schedstat`, wake-ups are voluntary \
         context switches, of all threads. Medians of {} rounds of {} s.",
        args.common.rounds, args.seconds,
    ));
    let rows = lines.map(|line| [(line, "bridge"), (line, "status")]);
    section.figures(&measured, rows.as_flattened(), &[CPU, WAKES]);
    let both = |line| -> Vec<f64> {
        let figures = |process| measured.figures(line, process, CPU);
        let pairs = figures("bridge").into_iter().zip(figures("status"));
        pairs.map(|(bridge, status)| bridge + status).collect()
    };
    section.goal(
        format!("bridge + status / both by hand, telemetry at {RATE_HZ} Hz"),
        Bound::AtMost(MOST_OF_BY_HAND),
        Ratio::of_rounds(&both(Line::Telemetry), &both(Line::ByHand)),
    );
    for process in ["bridge", "status"] {
        section.goal(
            format!("{process}, silent line, wake-ups a second"),
            Bound::AtMost(10.0),
            Ratio::of_values(&measured.figures(Line::Silent, process, WAKES)),
        );
    }
    highest_rate(&mut section, args.seconds)?;
    soak(&mut section, args.minutes)?;
    section.publish(args.common.out().as_deref())
}

/// One try of a rate.
fn carry(rate: &str, seconds: f64) -> Result<Kept> {
    eprintln!("a consumer that keeps up at {rate} frames a second for {seconds} s");
    let site = Site::new(Placement::Free)?;
    let ril = Ril::start(&site, rate, true)?;
    let kept = site.finish(site.start(&format!("keep-up {seconds}"))?)?;
    ril.end(&site)?;
    Ok(kept)
}

fn highest_rate(section: &mut Section, seconds: f64) -> Result<()> {
    let mut rows = Vec::new();
    let mut highest = Vec::new();
    let rates = RATES.map(|rate| (rate.to_string(), format!("{rate} a second")));
    let flood = ("flood".to_owned(), "as many as the bridge reads".to_owned());
    for (rate, name) in std::iter::once(flood).chain(rates) {
        let kept = carry(&rate, seconds)?;
        // What came, since the sender may not have been able to send so many.
        let rate_hz = kept.received as f64 / (kept.elapsed_ns as f64 / 1e9);
        rows.push(vec![
            name,
            format!("{rate_hz:.0}"),
            kept.missing.to_string(),
            kept.lost.to_string(),
        ]);
        if kept.lost == 0 && kept.missing == 0 {
            highest.push(rate_hz);
            break;
        }
    }
    section.text(format!(
        "Full frames through bridge and status to the consumer, {seconds} s each; *missing*: frames of which nothing came, \
         wherever they were lost; *lost*: of these, between status and the consumer:"
    ));
    let header = ["frames sent", "received a second", "missing", "lost"];
    section.table(&header, &rows);
    section.goal(
        "full frames a second without a loss",
        Bound::AtLeast(20_000.0),
        Ratio::of_values(&highest),
    );
    Ok(())
}

fn soak(section: &mut Section, minutes: f64) -> Result<()> {
    let kept = carry("1000", minutes * 60.0)?;
    section.text(format!(
        "A consumer that keeps up at 1 kHz for {minutes} minutes (`--minutes`): {} samples, {} missing.",
        kept.received, kept.missing,
    ));
    section.goal(
        format!("samples lost in {minutes} minutes at 1 kHz"),
        Bound::AtMost(0.0),
        Ratio::of_values(&[kept.missing as f64]),
    );
    Ok(())
}
