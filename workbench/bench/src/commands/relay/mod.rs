//! `relay`: what telemetry on another machine costs, beside plain Zenoh, and a star of many robots through one router.

mod holding;
mod load;
mod pair;
mod star;

use std::collections::BTreeMap;

use anyhow::Result;
use ipc_types::payload::{DspTelemetry, HeroTelemetry};

use super::Common;
use crate::report::{Bound, Section, us};
use crate::rounds::Measured;
use crate::statistics::{Ratio, Times, median};
use crate::usage::Calls;
use load::Load;
use pair::Way;
use star::{Group, Line, Size};

/// Sizes of a fleet that the star's figures are carried over to.
const FLEETS: [u32; 3] = [2, 20, 200];

/// Options of the command.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    common: Common,

    /// Samples a second of each kind of telemetry, of one robot
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..=1000))]
    rate: u32,

    /// Seconds that one way is measured for in one round
    #[arg(long, default_value_t = 6.0)]
    seconds: f64,

    /// Robots of the star; 0 leaves it out
    #[arg(long, default_value_t = 20)]
    robots: u32,

    /// Stations of the star
    #[arg(long, default_value_t = 3)]
    stations: u32,

    /// Rates of the star, Hz, in ascending order; the calculated figures are a line through the first and the last
    #[arg(long, value_delimiter = ',', default_values_t = [5, 10], value_parser = clap::value_parser!(u32).range(1..=1000))]
    star_rates: Vec<u32>,

    /// Seconds that the star is measured for at each rate
    #[arg(long, default_value_t = 30.0)]
    star_seconds: f64,
}

type Rounds = Measured<Way, pair::Round>;

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let measured = Measured::take(&Way::ALL, args.common.rounds, |way| {
        pair::measure(way, args.rate, args.seconds)
    })?;
    let mut section = Section::new("relay", "The relay: telemetry on another machine");
    latencies(&mut section, args, &measured);
    loads(&mut section, args, &measured);
    calls(&mut section, args)?;
    goals(&mut section, args, &measured);
    if args.robots > 0 {
        let size = Size {
            robots: args.robots,
            stations: args.stations,
        };
        let rounds = args
            .star_rates
            .iter()
            .map(|rate_hz| star::measure(size, *rate_hz, args.star_seconds))
            .collect::<Result<Vec<_>>>()?;
        describe_star(&mut section, size, args.star_seconds, &rounds);
        carry_over(&mut section, size, &rounds);
    }
    section.publish(args.common.out().as_deref())
}

fn latencies(section: &mut Section, args: &Args, measured: &Rounds) {
    section.text(format!(
        "A stand-in for a robot publishes `DspTelemetry` ({} bytes) and at once `HeroTelemetry` ({} bytes), {} times a second, and \
         the bridge's state once a second. Measured is a `HeroTelemetry` from just before it is published until a consumer can \
         read it; µs. The relay: robot side, TCP on the loopback interface, station side, and a consumer in the station's \
         domain. Plain Zenoh: the same bytes under three keys from one process to another, over the same kind of link, best \
         effort, express, dropped when there is no room; its receiver takes samples from a channel, as Zenoh gives them by \
         default. A relay translates the moments in a sample; the moment that is measured from lies in `dsp_time_s`, which it \
         does not change. {} rounds of {} s, in which the ways take turns.",
        size_of::<DspTelemetry>(),
        size_of::<HeroTelemetry>(),
        args.rate,
        args.common.rounds,
        args.seconds,
    ));
    let rows: Vec<_> = Way::ALL
        .iter()
        .map(|way| {
            let rounds = measured.rounds(*way);
            let times = Times::merged(rounds.iter().map(|round| round.series.times()));
            let lost: u64 = rounds.iter().map(|round| round.series.lost).sum();
            let ratio = ratio(measured, *way, 0.5);
            vec![
                way.to_string(),
                us(times.quantile_ns(0.5)),
                us(times.quantile_ns(0.99)),
                us(times.quantile_ns(0.999)),
                lost.to_string(),
                ratio.map_or_else(|| "–".to_owned(), |ratio| format!("{:.2}", ratio.median)),
            ]
        })
        .collect();
    let header = ["way", "p50", "p99", "p99.9", "lost", "to plain Zenoh"];
    section.table(&header, &rows);
}

/// A quantile of a way to that of plain Zenoh, round by round.
fn ratio(measured: &Rounds, way: Way, fraction: f64) -> Option<Ratio> {
    let quantile = |round: &pair::Round| round.series.times().quantile_ns(fraction);
    Ratio::of_rounds(
        &measured.each(way, quantile),
        &measured.each(Way::Zenoh, quantile),
    )
}

/// Names of the sending and of the receiving process.
fn processes(way: Way) -> [&'static str; 2] {
    match way {
        Way::Relay => ["relay, robot side", "relay, station side"],
        Way::Zenoh | Way::OneMachine => ["plain Zenoh, publisher", "plain Zenoh, consumer"],
    }
}

fn loads(section: &mut Section, args: &Args, measured: &Rounds) {
    section.text(format!(
        "What the processes use at {} Hz, all topics, all threads; medians of the rounds. The robot and the consumer are processes \
         of their own beside the relay, and are part of the two processes of plain Zenoh.",
        args.rate,
    ));
    let mut rows = Vec::new();
    for way in [Way::Relay, Way::Zenoh] {
        for (index, process) in processes(way).into_iter().enumerate() {
            let figure = |of: fn(&Load) -> f64| {
                let each = measured.each(way, |round| round.loads.get(index).map_or(0.0, of));
                median(&each).unwrap_or_default()
            };
            rows.push(vec![
                process.to_owned(),
                format!("{:.2}", figure(|load| load.cpu_percent)),
                format!("{:.0}", figure(|load| load.wakes_hz)),
            ]);
        }
    }
    section.table(&["process", "% of a core", "wake-ups a second"], &rows);
    let link = |way| {
        let each = measured.each(way, |round| round.link_bps / 1000.0);
        median(&each).unwrap_or_default()
    };
    section.text(format!(
        "Over the link go {:.1} kB a second with the relay, {:.1} kB with plain Zenoh, both directions together, without the \
         headers of TCP.",
        link(Way::Relay),
        link(Way::Zenoh),
    ));
}

fn calls(section: &mut Section, args: &Args) -> Result<()> {
    let relay = pair::calls(Way::Relay, args.rate, args.seconds)?;
    let zenoh = pair::calls(Way::Zenoh, args.rate, args.seconds)?;
    let (Some(relay), Some(zenoh)) = (relay, zenoh) else {
        section.text(
            "System calls were not counted: that takes `strace`, and the permission to attach it.",
        );
        return Ok(());
    };
    section.text(
        "System calls for each pair of `DspTelemetry` and `HeroTelemetry`, all threads, counted by `strace -f -c` in a run of its \
         own; what the processes do on timers is in it:",
    );
    let header = [
        "call",
        "robot side",
        "station side",
        "Zenoh's publisher",
        "its consumer",
    ];
    let frames = f64::from(args.rate) * args.seconds;
    let [robot_side, station_side] = relay;
    let [publisher, consumer] = zenoh;
    let rows = call_rows(&[robot_side, station_side, publisher, consumer], frames);
    section.table(&header, &rows);
    Ok(())
}

/// The sum of each process, then its calls, those first that are most frequent; what is rarer than one call in twenty frames is
/// in the sum alone.
fn call_rows(processes: &[Calls; 4], frames: f64) -> Vec<Vec<String>> {
    let mut by_name: BTreeMap<&str, [u64; 4]> = BTreeMap::new();
    let mut sums = [0; 4];
    for (index, calls) in processes.iter().enumerate() {
        for (name, count) in calls {
            by_name.entry(name).or_default()[index] += count;
            sums[index] += count;
        }
    }
    let mut rows: Vec<_> = by_name.into_iter().collect();
    rows.retain(|(_, counts)| counts.iter().any(|count| *count as f64 >= frames / 20.0));
    rows.sort_by_key(|(_, counts)| std::cmp::Reverse(counts.iter().sum::<u64>()));
    let row = |name: String, counts: [u64; 4]| {
        let figures = counts.map(|count| format!("{:.2}", count as f64 / frames));
        std::iter::once(name).chain(figures).collect()
    };
    std::iter::once(row("all".to_owned(), sums))
        .chain(
            rows.into_iter()
                .map(|(name, counts)| row(format!("`{name}`"), counts)),
        )
        .collect()
}

fn goals(section: &mut Section, args: &Args, measured: &Rounds) {
    for (name, fraction) in [("p50", 0.5), ("p99", 0.99)] {
        section.goal(
            format!("relay / plain Zenoh, {name}, {} Hz", args.rate),
            Bound::AtMost(1.5),
            ratio(measured, Way::Relay, fraction),
        );
    }
    // The sum and no median: one loss in one round is a loss.
    let lost: u64 = measured
        .rounds(Way::Relay)
        .iter()
        .map(|round| round.series.lost)
        .sum();
    section.goal(
        "samples lost over the relay, all rounds",
        Bound::AtMost(0.0),
        Ratio::of_values(&[lost as f64]),
    );
    for (index, process) in processes(Way::Relay).into_iter().enumerate() {
        let cpu = measured.each(Way::Relay, |round| {
            round.loads.get(index).map_or(0.0, |load| load.cpu_percent)
        });
        section.goal(
            format!("{process}, {} Hz, all topics, % of a core", args.rate),
            Bound::AtMost(2.0),
            Ratio::of_values(&cpu),
        );
    }
}

fn describe_star(section: &mut Section, size: Size, seconds: f64, rounds: &[star::Round]) {
    section.text(format!(
        "A star on the same machine: {} robots, each in a domain of its own with a relay of its own (one process publishes for all \
         of them, at moments that are spread over the period); one `ril-relay router`; {} stations, each with all robots, and a \
         consumer that reads the `HeroTelemetry` of all. {seconds} s at each rate. CPU, memory and files are those of one process, on \
         average. Resident memory (RSS) counts the pages that processes share in each, proportional memory (PSS) divides them.",
        size.robots, size.stations,
    ));
    let mut rows = Vec::new();
    for round in rounds {
        for (kind, group) in [
            ("robot side", &round.robot_sides),
            ("router", &round.router),
            ("station side", &round.station_sides),
        ] {
            rows.push(group_row(kind, round.rate_hz, group));
        }
    }
    section.table(
        &[
            "process",
            "number",
            "% of a core",
            "wake-ups a second",
            "RSS, MiB",
            "PSS, MiB",
            "files",
        ],
        &rows,
    );
    let rows: Vec<_> = rounds.iter().map(|round| star_row(size, round)).collect();
    section.table(
        &[
            "rate",
            "age p50, µs",
            "age p99, µs",
            "age p99.9, µs",
            "samples read",
            "lost",
            "all topics: lost on the air",
            "in a relay",
            "router in, kB/s",
            "router out, kB/s",
            "segments in + out, 1/s",
        ],
        &rows,
    );
}

fn group_row(kind: &str, rate_hz: u32, group: &Group) -> Vec<String> {
    let mib = |kib: u64| format!("{:.1}", kib as f64 / 1024.0);
    vec![
        format!("{kind}, {rate_hz} Hz"),
        group.count.to_string(),
        format!("{:.2}", group.load.cpu_percent),
        format!("{:.0}", group.load.wakes_hz),
        mib(group.holding.resident_kib),
        mib(group.holding.proportional_kib),
        group.holding.files.to_string(),
    ]
}

fn star_row(size: Size, round: &star::Round) -> Vec<String> {
    let kb = |bytes: Option<u64>| {
        bytes.map_or_else(
            || "not measured".to_owned(),
            |bytes| format!("{:.1}", bytes as f64 / 1000.0),
        )
    };
    let segments = round
        .traffic
        .map(|traffic| traffic.segments_sent + traffic.segments_received);
    vec![
        format!(
            "{} robots × {} Hz → {} stations",
            size.robots, round.rate_hz, size.stations
        ),
        us(round.times.quantile_ns(0.5)),
        us(round.times.quantile_ns(0.99)),
        us(round.times.quantile_ns(0.999)),
        round.times.count().to_string(),
        round.lost.to_string(),
        round.lost_on_air.to_string(),
        round.lost_in_relay.to_string(),
        kb(round.traffic.map(|traffic| traffic.received)),
        kb(round.traffic.map(|traffic| traffic.sent)),
        segments.map_or_else(|| "–".to_owned(), |segments| segments.to_string()),
    ]
}

/// What fleets of other sizes cost, calculated.
fn carry_over(section: &mut Section, size: Size, rounds: &[star::Round]) {
    let line = |cost: &dyn Fn(&star::Round) -> f64| {
        let points: Vec<_> = rounds
            .iter()
            .map(|round| (f64::from(round.rate_hz), cost(round)))
            .collect();
        Line::through(&points)
    };
    let of_station = |round: &star::Round| {
        let relays = round.station_sides.count as f64 / f64::from(size.stations);
        round.station_sides.load.cpu_percent * relays
    };
    let lines = (
        line(&|round| round.router.load.cpu_percent),
        line(&|round| round.traffic.unwrap_or_default().received as f64),
        line(&|round| round.traffic.unwrap_or_default().sent as f64),
        line(&of_station),
    );
    let (Some(router), Some(received), Some(sent), Some(station)) = lines else {
        return;
    };
    section.text(format!(
        "Calculated for other fleets, and not measured: a line through the costs at the lowest and the highest of these rates, in \
         proportion to the number of robots, {} stations that each take everything. It leaves out what a processor that is busier \
         does better (more samples with each wake-up) or worse, and the headers of TCP, IP and Ethernet, which are some 70 bytes for \
         each segment. More than 100 % of a core takes more than one core, or a lower rate.",
        size.stations,
    ));
    let mut rows = Vec::new();
    for robots in FLEETS {
        for rate_hz in [10.0, 50.0] {
            let times = f64::from(robots) / f64::from(size.robots);
            let mbps = |line: Line| format!("{:.2}", line.at(rate_hz, times) * 8e-6);
            rows.push(vec![
                format!("{robots} robots at {rate_hz} Hz"),
                format!("{:.1}", router.at(rate_hz, times)),
                mbps(received),
                mbps(sent),
                format!("{:.1}", station.at(rate_hz, times)),
            ]);
        }
    }
    section.table(
        &[
            "fleet",
            "router, % of a core",
            "router in, Mbit/s",
            "router out, Mbit/s",
            "relays of a station, % of a core",
        ],
        &rows,
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calls_of_all_processes_stand_in_one_row_and_rare_ones_in_the_sum_alone() {
        let calls = |pairs: &[(&str, u64)]| -> Calls {
            pairs
                .iter()
                .map(|(name, count)| (name.to_string(), *count))
                .collect()
        };
        let rows = call_rows(
            &[
                calls(&[("read", 100), ("brk", 4)]),
                calls(&[("futex", 300)]),
                calls(&[]),
                calls(&[("read", 50)]),
            ],
            100.0,
        );
        assert_eq!(rows.len(), 3);
        assert_eq!(rows[0], ["all", "1.04", "3.00", "0.00", "0.50"]);
        assert_eq!(rows[1], ["`futex`", "0.00", "3.00", "0.00", "0.00"]);
        assert_eq!(rows[2], ["`read`", "1.00", "0.00", "0.00", "0.50"]);
    }
}
