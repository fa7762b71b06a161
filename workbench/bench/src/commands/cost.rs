//! `cost`: what the bridge and status take of the machine, and how much telemetry they carry without a loss.

use std::collections::BTreeMap;
use std::fmt;
use std::time::Duration;

use anyhow::{Context, Result};
use ipc_types::MonotonicNs;

use super::Common;
use crate::consumer::Kept;
use crate::dsp::Sent;
use crate::pace::sleep_until;
use crate::process::{Child, Ril, Stage};
use crate::report::{Bound, Section};
use crate::rounds::Measured;
use crate::site::Site;
use crate::statistics::{Ratio, median};
use crate::usage::{Calls, Usage, count_calls};

/// Telemetry of the first goal, frames a second.
const RATE_HZ: u32 = 100;

/// How long the processes settle before they are measured: start-up, first connections, cleaning.
const SETTLING: Duration = Duration::from_millis(1500);

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

/// What the line does.
#[derive(Clone, Copy, PartialEq)]
enum Line {
    Telemetry,
    Silent,
}

impl Line {
    fn rate(self) -> String {
        match self {
            Line::Telemetry => RATE_HZ.to_string(),
            Line::Silent => "silent".to_owned(),
        }
    }
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Line::Telemetry => write!(f, "telemetry at {RATE_HZ} Hz"),
            Line::Silent => f.write_str("silent line"),
        }
    }
}

/// What both processes used in one round.
#[derive(Clone, Copy)]
struct Used {
    bridge: Usage,
    status: Usage,
    elapsed_s: f64,
}

impl Used {
    fn cpu_percent(&self, of: impl Fn(&Used) -> Usage) -> f64 {
        of(self).cpu_ns as f64 / 1e7 / self.elapsed_s
    }

    fn wakes_hz(&self, of: impl Fn(&Used) -> Usage) -> f64 {
        of(self).wakes as f64 / self.elapsed_s
    }
}

/// Bridge and status with a consumer of `HeroTelemetry`, as one finds them in a robot.
struct Running {
    ril: Ril,
    _consumer: Child,
    site: Site,
}

impl Running {
    fn start(rate: &str) -> Result<Running> {
        let site = Site::new()?;
        let ril = Ril::start(&site, rate, Stage::Status)?;
        // More than will come; it ends with this value.
        let consumer = Child::start(&site, &[&"consume", &"hero", &1_000_000_usize])?;
        sleep_until(MonotonicNs::now() + SETTLING)?;
        Ok(Running {
            ril,
            _consumer: consumer,
            site,
        })
    }

    fn ids(&self) -> Result<(u32, u32)> {
        let status = self.ril.status().context("status runs")?;
        Ok((self.ril.bridge().id(), status.id()))
    }

    fn end(self) -> Result<()> {
        self.ril.finish::<Sent>().map(drop)
    }
}

fn measure(line: Line, seconds: f64) -> Result<Used> {
    let running = Running::start(&line.rate())?;
    let (bridge, status) = running.ids()?;
    let before = (Usage::of(bridge)?, Usage::of(status)?);
    let begin = MonotonicNs::now();
    sleep_until(begin + Duration::from_secs_f64(seconds))?;
    let used = Used {
        bridge: Usage::of(bridge)?.since(before.0),
        status: Usage::of(status)?.since(before.1),
        elapsed_s: MonotonicNs::now().since(begin).as_secs_f64(),
    };
    running.end()?;
    Ok(used)
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let lines = [Line::Telemetry, Line::Silent];
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
    let mut rows = Vec::new();
    for line in lines {
        rows.push(usage_row("bridge", line, &measured, |used| used.bridge));
        rows.push(usage_row("status", line, &measured, |used| used.status));
    }
    section.table(&["process", "% of a core", "wake-ups a second"], &rows);
    usage_goals(&mut section, &measured);
    calls(&mut section, args.seconds)?;
    highest_rate(&mut section, args.seconds)?;
    soak(&mut section, args.minutes)?;
    section.publish(args.common.out().as_deref())
}

fn usage_row(
    process: &str,
    line: Line,
    measured: &Measured<Line, Used>,
    of: impl Fn(&Used) -> Usage,
) -> Vec<String> {
    let cpu = measured.each(line, |used| used.cpu_percent(&of));
    let wakes = measured.each(line, |used| used.wakes_hz(&of));
    vec![
        format!("{process}, {line}"),
        format!("{:.2}", median(&cpu).unwrap_or_default()),
        format!("{:.0}", median(&wakes).unwrap_or_default()),
    ]
}

fn usage_goals(section: &mut Section, measured: &Measured<Line, Used>) {
    let cpu = measured.each(Line::Telemetry, |used| {
        used.cpu_percent(|used| used.bridge) + used.cpu_percent(|used| used.status)
    });
    section.goal(
        format!("bridge + status, telemetry at {RATE_HZ} Hz, % of a core"),
        Bound::AtMost(1.0),
        Ratio::of_values(&cpu),
    );
    let bridge = measured.each(Line::Silent, |used| used.wakes_hz(|used| used.bridge));
    let status = measured.each(Line::Silent, |used| used.wakes_hz(|used| used.status));
    for (process, wakes) in [("bridge", bridge), ("status", status)] {
        section.goal(
            format!("{process}, silent line, wake-ups a second"),
            Bound::AtMost(10.0),
            Ratio::of_values(&wakes),
        );
    }
}

/// System calls for each frame, by name.
fn calls(section: &mut Section, seconds: f64) -> Result<()> {
    let duration = Duration::from_secs_f64(seconds);
    let frames = f64::from(RATE_HZ) * seconds;
    let running = Running::start(&Line::Telemetry.rate())?;
    let (bridge, status) = running.ids()?;
    let bridge = count_calls(bridge, duration, running.site.path())?;
    let status = count_calls(status, duration, running.site.path())?;
    running.end()?;
    let (Some(bridge), Some(status)) = (bridge, status) else {
        section.text(
            "System calls were not counted: that takes `strace`, and the permission to attach it.",
        );
        return Ok(());
    };
    section.text(format!(
        "System calls for each frame at {RATE_HZ} Hz, all threads, counted by `strace -f -c` in {seconds} s of their own; what \
         the processes do on timers is in it:"
    ));
    section.table(
        &["call", "bridge", "status"],
        &call_rows(&bridge, &status, frames),
    );
    Ok(())
}

fn call_rows(bridge: &Calls, status: &Calls, frames: f64) -> Vec<Vec<String>> {
    let mut by_name: BTreeMap<&str, (u64, u64)> = BTreeMap::new();
    for (name, count) in bridge {
        by_name.entry(name).or_default().0 += count;
    }
    for (name, count) in status {
        by_name.entry(name).or_default().1 += count;
    }
    let mut rows: Vec<_> = by_name.into_iter().collect();
    rows.sort_by_key(|(_, (bridge, status))| std::cmp::Reverse(bridge + status));
    let figure = |count: u64| format!("{:.2}", count as f64 / frames);
    let sum = |calls: &Calls| calls.iter().map(|(_, count)| count).sum::<u64>();
    let total = vec!["all".to_owned(), figure(sum(bridge)), figure(sum(status))];
    std::iter::once(total)
        .chain(rows.into_iter().map(|(name, (bridge, status))| {
            vec![format!("`{name}`"), figure(bridge), figure(status)]
        }))
        .collect()
}

/// One try of a rate.
fn carry(rate: &str, seconds: f64) -> Result<Kept> {
    let site = Site::new()?;
    let ril = Ril::start(&site, rate, Stage::Status)?;
    let mut consumer = Child::start(&site, &[&"keep-up", &seconds])?;
    let kept = consumer.result()?;
    ril.finish::<Sent>()?;
    Ok(kept)
}

impl Kept {
    fn rate_hz(&self) -> f64 {
        self.received as f64 / (self.elapsed_ns as f64 / 1e9)
    }

    fn is_complete(&self) -> bool {
        self.lost == 0 && self.missing == 0
    }

    fn row(&self, what: String) -> Vec<String> {
        vec![
            what,
            format!("{:.0}", self.rate_hz()),
            self.missing.to_string(),
            self.lost.to_string(),
        ]
    }
}

fn highest_rate(section: &mut Section, seconds: f64) -> Result<()> {
    eprintln!("highest rate: as fast as the bridge reads");
    let flood = carry("flood", seconds)?;
    let mut rows = vec![flood.row("as many as the bridge reads".to_owned())];
    let mut highest = flood.is_complete().then(|| flood.rate_hz());
    for rate_hz in RATES {
        if highest.is_some() {
            break;
        }
        eprintln!("highest rate: {rate_hz} Hz");
        let kept = carry(&rate_hz.to_string(), seconds)?;
        rows.push(kept.row(format!("{rate_hz} a second")));
        // The other end may not have been able to send so many.
        highest = kept.is_complete().then(|| kept.rate_hz());
    }
    section.text(format!(
        "Full frames through bridge and status to the consumer, {seconds} s each; *missing*: frames of which nothing came, \
         wherever they were lost; *lost*: of these, between status and the consumer:"
    ));
    section.table(
        &["frames sent", "received a second", "missing", "lost"],
        &rows,
    );
    section.goal(
        "full frames a second without a loss",
        Bound::AtLeast(20_000.0),
        Ratio::of_values(&highest.into_iter().collect::<Vec<_>>()),
    );
    Ok(())
}

fn soak(section: &mut Section, minutes: f64) -> Result<()> {
    eprintln!("a consumer that keeps up at 1 kHz: {minutes} minutes");
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usage_is_told_per_second() {
        let usage = Usage {
            cpu_ns: 20_000_000,
            wakes: 40,
            preemptions: 0,
        };
        let used = Used {
            bridge: usage,
            status: Usage::default(),
            elapsed_s: 4.0,
        };
        assert_eq!(used.cpu_percent(|used| used.bridge), 0.5);
        assert_eq!(used.wakes_hz(|used| used.bridge), 10.0);
        assert_eq!(used.cpu_percent(|used| used.status), 0.0);
    }

    #[test]
    fn calls_of_both_processes_stand_in_one_row_and_add_up() {
        let calls = |pairs: &[(&str, u64)]| -> Calls {
            pairs
                .iter()
                .map(|(name, count)| (name.to_string(), *count))
                .collect()
        };
        let rows = call_rows(
            &calls(&[("read", 10), ("write", 5)]),
            &calls(&[("read", 20)]),
            10.0,
        );
        assert_eq!(rows[0], ["all", "1.50", "2.00"]);
        assert_eq!(rows[1], ["`read`", "1.00", "2.00"]);
        assert_eq!(rows[2], ["`write`", "0.50", "0.00"]);
    }
}
