//! `record`: how old telemetry is while a flight is recorded and while it is not, and what the recorder takes.

use std::path::Path;
use std::time::Duration;
use std::{fmt, fs};

use anyhow::{Context, Result};
use ipc_types::MonotonicNs;

use super::Common;
use crate::consumer::Watched;
use crate::dsp::Sent;
use crate::latency::WARM_UP;
use crate::pace::sleep_until;
use crate::process::{Child, Recorded, Recorder, Ril, Stage};
use crate::report::{Bound, Section, us};
use crate::rounds::Measured;
use crate::site::Site;
use crate::statistics::{Ratio, Times, median};
use crate::usage::Usage;

/// How long the processes settle before a window: start-up, first connections, the first snapshots of the journals.
const SETTLING: Duration = Duration::from_secs(1);

/// How much older telemetry may be while it is recorded. No age changes by nothing from one window to the next: the tables have
/// the two windows without a recorder against each other as well.
const MOST_OLDER: f64 = 1.05;

/// Options of the command.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    common: Common,

    /// Rates, Hz
    #[arg(long, value_delimiter = ',', default_values_t = [1000, 50], value_parser = clap::value_parser!(u32).range(10..=1000))]
    rates: Vec<u32>,

    /// Seconds with the recorder in one round; as many are measured without it
    #[arg(long, default_value_t = 4.0)]
    seconds: f64,
}

#[derive(Clone, Copy, PartialEq)]
struct Case {
    rate_hz: u32,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} Hz", self.rate_hz)
    }
}

/// The goal: what recording may take of a core, %.
fn most_percent(rate_hz: u32) -> f64 {
    if rate_hz <= 50 { 1.0 } else { 5.0 }
}

/// What is measured in a span of time in which nothing is started or ended.
struct Window {
    begin: MonotonicNs,
    end: MonotonicNs,
    bridge: Usage,
    status: Usage,
    recorder: Usage,
    file_bytes: u64,
}

impl Window {
    /// Measures for so long. The recorder's files are in `folder`.
    fn measure(
        ril: &Ril,
        recorder: Option<&Recorder>,
        folder: &Path,
        seconds: f64,
    ) -> Result<Window> {
        let status = ril.status().context("status runs")?.id();
        let look = || -> Result<_> {
            Ok((
                Usage::of(ril.bridge().id())?,
                Usage::of(status)?,
                recorder.map_or(Ok(Usage::default()), |recorder| Usage::of(recorder.id()))?,
                taken(folder)?,
            ))
        };
        let before = look()?;
        let begin = MonotonicNs::now();
        sleep_until(begin + Duration::from_secs_f64(seconds))?;
        let end = MonotonicNs::now();
        let after = look()?;
        Ok(Window {
            begin,
            end,
            bridge: after.0.since(before.0),
            status: after.1.since(before.1),
            recorder: after.2.since(before.2),
            file_bytes: after.3.saturating_sub(before.3),
        })
    }

    fn seconds(&self) -> f64 {
        self.end.since(self.begin).as_secs_f64()
    }

    fn has(&self, moment: MonotonicNs) -> bool {
        (self.begin..self.end).contains(&moment)
    }
}

/// Bytes of the disk that the files in `folder` take: a file that is not finished is longer than what lies in it.
fn taken(folder: &Path) -> Result<u64> {
    use std::os::unix::fs::MetadataExt;
    let mut bytes = 0;
    for file in fs::read_dir(folder)? {
        bytes += 512 * file?.metadata()?.blocks();
    }
    Ok(bytes)
}

/// What came in one or several windows.
#[derive(Clone)]
struct Ages {
    /// From just before the frame was written to the terminal.
    whole: Times,
    /// From the bridge's read on.
    after_read: Times,
    lost: u64,
}

impl Ages {
    fn in_windows(windows: &[&Window], sent: &Sent, watched: &Watched) -> Ages {
        let mut ages = Ages {
            whole: Times::new(),
            after_read: Times::new(),
            lost: 0,
        };
        for window in windows {
            let mut last: Option<u32> = None;
            for sample in watched.samples().skip(WARM_UP) {
                if !window.has(MonotonicNs(sample.arrived_ns)) {
                    continue;
                }
                if let Some(last) = last.replace(sample.index) {
                    ages.lost += u64::from(sample.index.saturating_sub(last + 1));
                }
                // The first frame has the index 1.
                let Some(sent_ns) = sent.sent_ns.get(sample.index as usize - 1) else {
                    continue;
                };
                ages.whole.add(sample.arrived_ns.saturating_sub(*sent_ns));
                ages.after_read
                    .add(sample.arrived_ns.saturating_sub(sample.received_ns));
            }
        }
        ages
    }
}

/// One way of a round: with the recorder or without.
struct Side {
    ages: Ages,
    bridge: Load,
    status: Load,
    recorder: Load,
}

/// What a process takes.
#[derive(Clone, Copy)]
struct Load {
    percent: f64,
    wakes_hz: f64,
}

impl Load {
    fn of(windows: &[&Window], of: fn(&Window) -> Usage) -> Load {
        let seconds: f64 = windows.iter().map(|window| window.seconds()).sum();
        let sum = |figure: fn(Usage) -> u64| -> f64 {
            windows.iter().map(|window| figure(of(window)) as f64).sum()
        };
        Load {
            percent: sum(|usage| usage.cpu_ns) / 1e7 / seconds,
            wakes_hz: sum(|usage| usage.wakes) / seconds,
        }
    }
}

impl Side {
    fn of(windows: &[&Window], sent: &Sent, watched: &Watched) -> Side {
        Side {
            ages: Ages::in_windows(windows, sent, watched),
            bridge: Load::of(windows, |window| window.bridge),
            status: Load::of(windows, |window| window.status),
            recorder: Load::of(windows, |window| window.recorder),
        }
    }

    fn percent(&self) -> f64 {
        self.bridge.percent + self.status.percent + self.recorder.percent
    }
}

/// One round: the same processes, before, while and after they are recorded.
struct Round {
    without: Side,
    with: Side,
    before: Ages,
    after: Ages,
    file_bytes_s: f64,
    recorded: Recorded,
}

fn measure(case: Case, seconds: f64) -> Result<Round> {
    let site = Site::new()?;
    let folder = site.path().join("recording");
    fs::create_dir(&folder)?;
    let ril = Ril::start(&site, &case.rate_hz.to_string(), Stage::Status)?;
    let consumer = Child::start(&site, &[&"watch"])?;
    let settle = || sleep_until(MonotonicNs::now() + SETTLING);
    // What begins with the first frames, and the samples that do not count.
    settle()?;
    settle()?;

    let before = Window::measure(&ril, None, &folder, seconds / 2.0)?;
    let recorder = Recorder::start(&site, &folder)?;
    settle()?;
    let during = Window::measure(&ril, Some(&recorder), &folder, seconds)?;
    let recorded = recorder.end()?;
    settle()?;
    let after = Window::measure(&ril, None, &folder, seconds / 2.0)?;

    let watched: Watched = consumer.finish()?;
    let sent: Sent = ril.finish()?;
    Ok(Round {
        without: Side::of(&[&before, &after], &sent, &watched),
        with: Side::of(&[&during], &sent, &watched),
        before: Ages::in_windows(&[&before], &sent, &watched),
        after: Ages::in_windows(&[&after], &sent, &watched),
        file_bytes_s: during.file_bytes as f64 / during.seconds(),
        recorded,
    })
}

type Rounds = Measured<Case, Round>;

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let cases: Vec<Case> = args
        .rates
        .iter()
        .map(|rate_hz| Case { rate_hz: *rate_hz })
        .collect();
    let measured = Measured::take(&cases, args.common.rounds, |case| {
        measure(case, args.seconds)
    })?;
    let mut section = Section::new("record", "Telemetry while it is recorded");
    section.text(format!(
        "The processes of *End to end*, with one consumer of `HeroTelemetry` that blocks; `ril record` writes every topic into a \
         file on the disk, the journals included. {} rounds. In each the same processes are measured for {half} s without the \
         recorder, {} s with it, and {half} s without it again. Times begin just before the frame is written to the terminal, or \
         with the bridge's read; µs.",
        args.common.rounds,
        args.seconds,
        half = args.seconds / 2.0,
    ));
    let rows: Vec<_> = cases
        .iter()
        .flat_map(|case| age_rows(*case, &measured))
        .collect();
    let header = [
        "rate",
        "p50",
        "p99",
        "from the bridge's read on, p50",
        "p99",
        "lost",
    ];
    section.table(&header, &rows);
    section.text(
        "Percentiles of a round with the recorder to those without it, medians over the rounds, least … most. The last column \
         has the second time without the recorder to the first: what the same processes differ by though nothing has changed.",
    );
    let rows: Vec<_> = cases
        .iter()
        .flat_map(|case| ratio_rows(*case, &measured))
        .collect();
    section.table(&["percentile", "recorded / not", "not / not"], &rows);
    section.text("Processor time and wake-ups, of all threads, medians of the rounds:");
    let rows: Vec<_> = cases
        .iter()
        .flat_map(|case| load_rows(*case, &measured))
        .collect();
    let header = [
        "process",
        "% of a core",
        "recorded",
        "wake-ups a second",
        "recorded",
    ];
    section.table(&header, &rows);
    for case in &cases {
        section.text(file_line(*case, &measured));
    }
    for case in &cases {
        goals(&mut section, *case, &measured);
    }
    section.publish(args.common.out().as_deref())
}

fn age_rows(case: Case, measured: &Rounds) -> [Vec<String>; 2] {
    let row = |what: &str, of: fn(&Round) -> &Ages| {
        let rounds = measured.rounds(case);
        let merged = |times: fn(&Ages) -> &Times| {
            Times::merged(rounds.iter().map(|round| times(of(round)).clone()))
        };
        let (whole, after_read) = (merged(|ages| &ages.whole), merged(|ages| &ages.after_read));
        vec![
            format!("{case}{what}"),
            us(whole.p50_ns()),
            us(whole.quantile_ns(0.99)),
            us(after_read.p50_ns()),
            us(after_read.quantile_ns(0.99)),
            rounds
                .iter()
                .map(|round| of(round).lost)
                .sum::<u64>()
                .to_string(),
        ]
    };
    [
        row("", |round| &round.without.ages),
        row(", recorded", |round| &round.with.ages),
    ]
}

/// The percentiles that are compared.
const PERCENTILES: [(&str, f64); 2] = [("p50", 0.5), ("p99", 0.99)];

/// A percentile of one time of each round to that of another.
fn ratio(
    case: Case,
    measured: &Rounds,
    fraction: f64,
    times: fn(&Ages) -> &Times,
    [one, other]: [fn(&Round) -> &Ages; 2],
) -> Option<Ratio> {
    let quantiles = |of: fn(&Round) -> &Ages| {
        measured.each(case, |round| times(of(round)).quantile_ns(fraction))
    };
    Ratio::of_rounds(&quantiles(one), &quantiles(other))
}

/// A part of the way of a sample.
type Part = fn(&Ages) -> &Times;

/// The windows with the recorder, or those without.
type WithOrWithout = fn(&Round) -> &Side;

const RECORDED: [fn(&Round) -> &Ages; 2] = [|round| &round.with.ages, |round| &round.without.ages];
const UNCHANGED: [fn(&Round) -> &Ages; 2] = [|round| &round.after, |round| &round.before];

fn ratio_rows(case: Case, measured: &Rounds) -> Vec<Vec<String>> {
    let parts: [(&str, Part); 2] = [
        ("", |ages| &ages.whole),
        (", from the bridge's read on", |ages| &ages.after_read),
    ];
    let mut rows = Vec::new();
    for (part, times) in parts {
        for (name, fraction) in PERCENTILES {
            let figure = |pair| {
                ratio(case, measured, fraction, times, pair).map_or_else(
                    || "–".to_owned(),
                    |ratio| {
                        let Ratio {
                            median,
                            least,
                            most,
                        } = ratio;
                        format!("{median:.2}, {least:.2} … {most:.2}")
                    },
                )
            };
            rows.push(vec![
                format!("{case}, {name}{part}"),
                figure(RECORDED),
                figure(UNCHANGED),
            ]);
        }
    }
    rows
}

fn load_rows(case: Case, measured: &Rounds) -> [Vec<String>; 3] {
    let row = |process: &str, of: fn(&Side) -> Load| {
        let figure = |side: WithOrWithout, figure: fn(Load) -> f64| {
            let values = measured.each(case, |round| figure(of(side(round))));
            median(&values).unwrap_or_default()
        };
        let percent = |side| format!("{:.2}", figure(side, |load| load.percent));
        let wakes = |side| format!("{:.0}", figure(side, |load| load.wakes_hz));
        let [without, with]: [WithOrWithout; 2] = [|round| &round.without, |round| &round.with];
        vec![
            format!("{process}, {case}"),
            percent(without),
            percent(with),
            wakes(without),
            wakes(with),
        ]
    };
    let mut recorder = row("`ril record`", |side| side.recorder);
    for absent in [1, 3] {
        recorder[absent] = "–".to_owned();
    }
    [
        row("bridge", |side| side.bridge),
        row("status", |side| side.status),
        recorder,
    ]
}

fn file_line(case: Case, measured: &Rounds) -> String {
    let bytes = measured.each(case, |round| round.file_bytes_s);
    let rounds = measured.rounds(case);
    let sum = |figure: fn(&Recorded) -> u64| -> u64 {
        rounds.iter().map(|round| figure(&round.recorded)).sum()
    };
    format!(
        "{case}: the file takes {:.0} kB a second of the disk; {} messages in all rounds, {} of them dropped, {} samples lost on \
         their way to the recorder.",
        median(&bytes).unwrap_or_default() / 1000.0,
        sum(|recorded| recorded.messages),
        sum(|recorded| recorded.dropped),
        sum(|recorded| recorded.lost),
    )
}

fn goals(section: &mut Section, case: Case, measured: &Rounds) {
    for (name, fraction) in PERCENTILES {
        section.goal(
            format!("recorded / not recorded, {name}, {case}"),
            Bound::AtMost(MOST_OLDER),
            ratio(case, measured, fraction, |ages| &ages.whole, RECORDED),
        );
    }
    let recorder = measured.each(case, |round| round.with.recorder.percent);
    let all = measured.each(case, |round| round.with.percent() - round.without.percent());
    for (what, percent) in [("`ril record`", recorder), ("all that recording adds", all)] {
        section.goal(
            format!("{what}, {case}, % of a core"),
            Bound::AtMost(most_percent(case.rate_hz)),
            Ratio::of_values(&percent),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::consumer::WatchedSample;

    fn window(begin: u64, end: u64) -> Window {
        let usage = Usage {
            cpu_ns: 20_000_000,
            wakes: 40,
            preemptions: 0,
        };
        Window {
            begin: MonotonicNs(begin),
            end: MonotonicNs(end),
            bridge: usage,
            status: Usage::default(),
            recorder: Usage::default(),
            file_bytes: 0,
        }
    }

    #[test]
    fn a_sample_counts_in_the_window_in_which_it_came_and_gaps_within_it_are_losses() {
        let count = WARM_UP as u32 + 10;
        let sent = Sent {
            sent_ns: (1..=u64::from(count)).map(|index| index * 1000).collect(),
        };
        let mut watched = Watched::default();
        let first = u64::from(count) - 10;
        // The fourth of the ten that count is missing.
        for index in (1..=count).filter(|index| u64::from(*index) != first + 4) {
            let sent_ns = u64::from(index) * 1000;
            watched.add(WatchedSample {
                index,
                received_ns: sent_ns + 10,
                arrived_ns: sent_ns + 60,
            });
        }
        let at = |number: u64| (first + number) * 1000;
        let (one, other) = (window(at(2), at(6)), window(at(6), at(9)));
        let ages = Ages::in_windows(&[&one], &sent, &watched);
        assert_eq!((ages.whole.count(), ages.lost), (3, 1));
        assert_eq!(ages.whole.p50_ns(), 60.0);
        assert_eq!(ages.after_read.p50_ns(), 50.0);
        let both = Ages::in_windows(&[&one, &other], &sent, &watched);
        assert_eq!((both.whole.count(), both.lost), (6, 1));
    }

    #[test]
    fn loads_of_several_windows_are_told_per_second() {
        let [one, other] = [window(0, 1_000_000_000), window(0, 3_000_000_000)];
        let load = Load::of(&[&one, &other], |window| window.bridge);
        assert_eq!((load.percent, load.wakes_hz), (1.0, 20.0));
        assert_eq!(Load::of(&[&one], |window| window.recorder).percent, 0.0);
    }

    #[test]
    fn a_file_takes_what_was_written_into_it_and_not_its_holes() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(taken(folder.path()).unwrap(), 0);
        let file = fs::File::create(folder.path().join("a")).unwrap();
        file.set_len(1 << 30).unwrap();
        fs::write(folder.path().join("b"), [1; 100_000]).unwrap();
        let bytes = taken(folder.path()).unwrap();
        assert!((100_000..1_000_000).contains(&bytes), "{bytes}");
    }
}
