//! `record`: how old telemetry is while a flight is recorded and while it is not, and what the recorder takes.

use std::path::Path;
use std::time::Duration;
use std::{fmt, fs};

use anyhow::{Context, Result};
use ipc_types::MonotonicNs;
use measure::median;
use ril_tests::Process;

use super::Common;
use crate::harness::{Placement, Ril, Site, end_recorder, start_recorder};
use crate::measured::{Arrival, LOST, Measured, Part, Ratio, Round, join};
use crate::pace::sleep_until;
use crate::report::{Bound, Section, us};
use crate::usage::{CPU, WAKES, Watch};

/// How long the processes run before a window: start-up, first connections, the first snapshots of the journals.
const START_UP: Duration = Duration::from_secs(1);

/// How much older telemetry may be while it is recorded. No age changes by nothing from one window to the next: the
/// tables have the two windows without a recorder against each other as well.
const MOST_OLDER: f64 = 1.05;

/// The windows of a round, in order. Both without the recorder together are [`NOT_RECORDED`].
const WINDOWS: [&str; 3] = ["before", RECORDED, "after"];
const RECORDED: &str = "recorded";
const NOT_RECORDED: &str = "not recorded";

/// What uses processor time; recording adds the recorder's, and what bridge and status take more than without it.
const SHOWN: [[&str; 2]; 2] = [
    ["bridge before", "status before"],
    ["bridge, recorded", "status, recorded"],
];
const RECORDER: &str = "`ril record`";
const ADDED: &str = "all that recording adds";

/// The percentiles that are compared.
const PERCENTILES: [(&str, f64); 2] = [("p50", 0.5), ("p99", 0.99)];

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

/// A span of time in which nothing is started or ended.
type Window = std::ops::Range<MonotonicNs>;

/// What the processes have used in a window, and how much longer the files in `folder` are then.
fn watch(
    processes: &[(&'static str, &Process)],
    folder: &Path,
    seconds: f64,
) -> Result<(Window, Round)> {
    let watch = Watch::begin(processes.iter().copied())?;
    let bytes = taken(folder)?;
    let begin = watch.since();
    sleep_until(begin + Duration::from_secs_f64(seconds))?;
    let end = MonotonicNs::now();
    let mut used = Round::default();
    let elapsed_s = watch.end(&mut used)?;
    let bytes_s = taken(folder)?.saturating_sub(bytes) as f64 / elapsed_s;
    used.add_figure(RECORDED, "bytes a second", bytes_s);
    Ok((begin..end, used))
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

/// The arrivals within a window.
fn within(window: &Window, arrivals: &[Arrival]) -> Vec<Arrival> {
    let is_within = |arrival: &&Arrival| window.contains(&MonotonicNs(arrival.arrived_ns));
    arrivals.iter().filter(is_within).copied().collect()
}

/// One round: the same processes, before, while and after they are recorded.
fn measure(case: Case, seconds: f64) -> Result<Round> {
    let site = Site::new(Placement::Free)?;
    let folder = site.folder().join("recording");
    fs::create_dir(&folder)?;
    let ril = Ril::start(&site, &case.rate_hz.to_string(), true)?;
    let consumer = site.start(&format!("consume hero {}", usize::MAX))?;
    let start_up = || sleep_until(MonotonicNs::now() + START_UP);
    // What begins with the first frames, and the samples that do not count.
    start_up()?;
    start_up()?;

    let status = ril.status.as_ref().context("it was started")?;
    let [before_names, names] =
        SHOWN.map(|[bridge, of_status]| [(bridge, &ril.bridge), (of_status, status)]);
    let (before, without) = watch(&before_names, &folder, seconds / 2.0)?;
    let recorder = start_recorder(&site, "recording")?;
    start_up()?;
    let [bridge, of_status] = names;
    let (during, with) = watch(
        &[bridge, of_status, (RECORDER, &recorder)],
        &folder,
        seconds,
    )?;
    let end = end_recorder(recorder)?;
    start_up()?;
    let (after, later) = watch(&before_names, &folder, seconds / 2.0)?;
    let cpu = |used: &Round, names: &[&'static str]| -> f64 {
        names.iter().map(|name| used.figure(name, CPU)).sum()
    };
    let alone = cpu(&without, &SHOWN[0]) + cpu(&later, &SHOWN[0]);
    let added = cpu(&with, &SHOWN[1]) + cpu(&with, &[RECORDER]) - alone / 2.0;

    let mut round = with;
    for name in SHOWN[0] {
        for quantity in [CPU, WAKES] {
            round.add_figure(name, quantity, without.figure(name, quantity));
        }
    }
    round.add_figure(ADDED, CPU, added);
    for (quantity, value) in [
        ("messages", end.messages),
        ("dropped", end.dropped),
        ("not received", end.lost),
    ] {
        round.add_figure(RECORDED, quantity, value as f64);
    }
    let mut arrivals: Vec<Arrival> = site.end(consumer)?;
    join(&mut arrivals, &ril.end(&site)?);
    for (name, window) in WINDOWS.into_iter().zip([before, during, after]) {
        let arrivals = within(&window, &arrivals);
        round.add(name, &arrivals);
        if name != RECORDED {
            round.add(NOT_RECORDED, &arrivals);
        }
    }
    Ok(round)
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let case = |rate_hz: &u32| Case { rate_hz: *rate_hz };
    let cases: Vec<Case> = args.rates.iter().map(case).collect();
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
    let rows = cases.iter().flat_map(|case| {
        [NOT_RECORDED, RECORDED].map(|name| {
            let mut row = vec![format!("{case}, {name}")];
            for part in [Part::Whole, Part::AfterRead] {
                let times = measured.times(*case, name, part);
                row.extend(PERCENTILES.map(|(_, fraction)| us(times.quantile_ns(fraction))));
            }
            row.push(format!("{:.0}", measured.sum(*case, name, LOST)));
            row
        })
    });
    let header = [
        "rate",
        "p50",
        "p99",
        "from the bridge's read on, p50",
        "p99",
        "lost",
    ];
    section.table(&header, &rows.collect::<Vec<_>>());
    section.text(
        "Percentiles of a round with the recorder to those without it, medians over the rounds, least … most. The last column \
         has the second time without the recorder to the first: what the same processes differ by though nothing has changed.",
    );
    let rows = cases.iter().flat_map(|case| ratio_rows(*case, &measured));
    let header = ["percentile", "recorded / not", "not / not"];
    section.table(&header, &rows.collect::<Vec<_>>());
    section.text("Processor time and wake-ups, of all threads, medians of the rounds; without the recorder, those before it:");
    let shown = [&SHOWN.concat()[..], &[RECORDER]].concat();
    let rows = cases
        .iter()
        .flat_map(|case| shown.iter().map(|process| (*case, *process)));
    section.figures(&measured, &rows.collect::<Vec<_>>(), &[CPU, WAKES]);
    for case in cases {
        describe_file(&mut section, case, &measured);
        goals(&mut section, case, &measured);
    }
    section.publish(args.common.out().as_deref())
}

/// A percentile of one window of each round to that of another.
fn ratio(
    case: Case,
    measured: &Measured<Case>,
    fraction: f64,
    part: Part,
    [one, other]: [&'static str; 2],
) -> Option<Ratio> {
    let quantiles = |name| measured.quantiles(case, name, part, fraction);
    Ratio::of_rounds(&quantiles(one), &quantiles(other))
}

fn ratio_rows(case: Case, measured: &Measured<Case>) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for (part, name_of_part) in [
        (Part::Whole, String::new()),
        (Part::AfterRead, format!(", {}", Part::AfterRead)),
    ] {
        for (name, fraction) in PERCENTILES {
            let figure = |pair| match ratio(case, measured, fraction, part, pair) {
                Some(Ratio {
                    median,
                    least,
                    most,
                }) => format!("{median:.2}, {least:.2} … {most:.2}"),
                None => "–".to_owned(),
            };
            rows.push(vec![
                format!("{case}, {name}{name_of_part}"),
                figure([RECORDED, NOT_RECORDED]),
                figure([WINDOWS[2], WINDOWS[0]]),
            ]);
        }
    }
    rows
}

fn describe_file(section: &mut Section, case: Case, measured: &Measured<Case>) {
    let sum = |quantity| measured.sum(case, RECORDED, quantity);
    let bytes_s = measured.figures(case, RECORDED, "bytes a second");
    section.text(format!(
        "{case}: the file takes {:.0} kB a second of the disk; {:.0} messages in all rounds, {:.0} of them dropped, {:.0} samples lost \
         on their way to the recorder.",
        median(&bytes_s).unwrap_or_default() / 1000.0,
        sum("messages"),
        sum("dropped"),
        sum("not received"),
    ));
}

fn goals(section: &mut Section, case: Case, measured: &Measured<Case>) {
    for (name, fraction) in PERCENTILES {
        section.goal(
            format!("recorded / not recorded, {name}, {case}"),
            Bound::AtMost(MOST_OLDER),
            ratio(
                case,
                measured,
                fraction,
                Part::Whole,
                [RECORDED, NOT_RECORDED],
            ),
        );
    }
    // What recording may take of a core, %.
    let most = if case.rate_hz <= 50 { 1.0 } else { 5.0 };
    for what in [RECORDER, ADDED] {
        section.goal(
            format!("{what}, {case}, % of a core"),
            Bound::AtMost(most),
            Ratio::of_values(&measured.figures(case, what, CPU)),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_counts_in_the_window_in_which_it_came() {
        let arrivals = [2, 3, 5, 6, 9].map(|index| Arrival {
            index,
            arrived_ns: index * 1000,
            ..Arrival::default()
        });
        let window = MonotonicNs(3000)..MonotonicNs(9000);
        let within = within(&window, &arrivals);
        assert_eq!(within, arrivals[1..4]);
    }

    #[test]
    fn a_file_takes_what_was_written_into_it_and_not_its_holes() {
        let folder = ril_tests::PtyFolder::new();
        assert_eq!(taken(folder.path()).unwrap(), 0);
        let file = fs::File::create(folder.link("a")).unwrap();
        file.set_len(1 << 30).unwrap();
        fs::write(folder.link("b"), [1; 100_000]).unwrap();
        let bytes = taken(folder.path()).unwrap();
        assert!((100_000..1_000_000).contains(&bytes), "{bytes}");
    }
}
