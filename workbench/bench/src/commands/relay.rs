//! `relay`: what telemetry on another machine costs, beside plain Zenoh, and a star of many robots through one router.

use std::fmt::{self, Write};
use std::net::TcpListener;
use std::process::Command;
use std::time::Duration;

use anyhow::{Context, Result};
use ipc_types::MonotonicNs;
use ipc_types::payload::{DspTelemetry, HeroTelemetry};
use relay::config::MAX_ROBOTS;
use ril_tests::Process;
use ril_tests::process::Signal;

use super::Common;
use crate::harness::{Placement, Site};
use crate::measured::{LOST, Measured, Part, Ratio, Round, WARM_UP, median};
use crate::pace::sleep_until;
use crate::relayed::Reading;
use crate::report::{Bound, Section, percentiles};
use crate::usage::{CPU, FILES, MEMORY, WAKES, Watch};

/// Names of the processes.
const ROBOT_SIDE: &str = "relay, robot side";
const STATION_SIDE: &str = "relay, station side";
const ROUTER: &str = "router";
const PUBLISHER: &str = "plain Zenoh, publisher";
const CONSUMER: &str = "plain Zenoh, consumer";

/// What the listening process sends and receives, kB a second.
const LINK: &str = "link";
const OUT: &str = "out";
const IN: &str = "in";

/// Samples of all topics that got lost between two relays, and that the robots' relays did not read in time.
const ON_AIR: &str = "lost on the air";
const IN_RELAY: &str = "lost in a relay";

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

    /// Rates of the star, Hz
    #[arg(long, value_delimiter = ',', default_values_t = [5, 10], value_parser = clap::value_parser!(u32).range(1..=1000))]
    star_rates: Vec<u32>,

    /// Seconds that the star is measured for at each rate
    #[arg(long, default_value_t = 30.0)]
    star_seconds: f64,
}

/// How telemetry gets from robots to consumers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    /// Over the two sides of a relay, into another domain.
    Relay,
    /// Over plain Zenoh, without shared memory.
    Zenoh,
    /// Over shared memory alone, to a consumer on the robot.
    OneMachine,
    /// Over relays and one router; each station has all robots.
    Star { robots: u32, stations: u32 },
}

#[derive(Clone, Copy, PartialEq)]
struct Case {
    way: Way,
    rate_hz: u32,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.way {
            Way::Relay => f.write_str("relay, to the station's domain"),
            Way::Zenoh => f.write_str("plain Zenoh"),
            Way::OneMachine => f.write_str("shared memory, on the robot"),
            Way::Star { robots, stations } => {
                let rate_hz = self.rate_hz;
                write!(f, "{robots} robots × {rate_hz} Hz → {stations} stations")
            }
        }
    }
}

/// The processes of a way, in the order in which they are ended. The consumers have their first samples.
struct Running {
    /// With the number of the site of each.
    consumers: Vec<(usize, Process)>,
    relays: Vec<(&'static str, Process)>,
    robots: Process,
    port: u16,
    sites: Vec<Site>,
}

impl Running {
    fn start(case: Case, samples: usize) -> Result<Running> {
        let rate_hz = case.rate_hz;
        let port = TcpListener::bind("127.0.0.1:0")?.local_addr()?.port();
        let endpoint = format!("tcp/127.0.0.1:{port}");
        let (robots, stations) = match case.way {
            Way::Star { robots, stations } => (robots, stations),
            Way::Relay => (1, 1),
            Way::Zenoh => {
                let sites = vec![Site::new(Placement::Free)?];
                let robot = sites[0].start(&format!("zenoh-robot {endpoint} {rate_hz}"))?;
                let consumer = sites[0].start(&format!("consume-zenoh {endpoint} {samples}"))?;
                return Ok(Running {
                    consumers: vec![(0, consumer)],
                    relays: Vec::new(),
                    robots: robot,
                    port,
                    sites,
                });
            }
            Way::OneMachine => (1, 0),
        };
        // The robots come first, then the stations.
        let count = robots + stations;
        let sites = (0..count).map(|_| Site::new(Placement::Free));
        let sites = sites.collect::<Result<Vec<_>>>()?;
        let (robot_sites, station_sites) = sites.split_at(robots as usize);
        let mut role = format!("robots {rate_hz}");
        for site in robot_sites {
            write!(role, " {}", site.root().display())?;
        }
        let publishers = sites[0].start(&role)?;

        let has_router = matches!(case.way, Way::Star { .. });
        let mut relays = Vec::new();
        if case.way != Way::OneMachine {
            for (site, number) in robot_sites.iter().zip(1..) {
                let side = format!("robot --robot {number}");
                relays.push((
                    ROBOT_SIDE,
                    start_relay(site, &side, &endpoint, has_router, &[])?,
                ));
            }
        }
        if has_router {
            let router = start_relay(&sites[0], ROUTER, &endpoint, true, &[])?;
            relays.push((ROUTER, router));
        }
        let numbers: Vec<u32> = (1..=robots).collect();
        for (site, station) in station_sites.iter().zip(1..) {
            for some in numbers.chunks(MAX_ROBOTS) {
                let side = format!("station --name bench-{station}");
                let relay = start_relay(site, &side, &endpoint, has_router, some)?;
                relays.push((STATION_SIDE, relay));
            }
        }
        // Stations are ended before robots.
        relays.reverse();
        let mut consumers = Vec::new();
        for (index, site) in sites.iter().enumerate() {
            if index >= robots as usize || case.way == Way::OneMachine {
                let consumer = site.start(&format!("consume-robots {robots} {samples}"))?;
                consumers.push((index, consumer));
            }
        }
        Ok(Running {
            consumers,
            relays,
            robots: publishers,
            port,
            sites,
        })
    }

    fn watched(&self, way: Way) -> Vec<(&'static str, &Process)> {
        if way == Way::Zenoh {
            let consumers = self.consumers.iter();
            let consumers = consumers.map(|(_, consumer)| (CONSUMER, consumer));
            return consumers.chain([(PUBLISHER, &self.robots)]).collect();
        }
        let relays = self.relays.iter();
        relays.map(|(name, process)| (*name, process)).collect()
    }

    fn end(self) {
        drop(self.consumers);
        let relays = self.relays.into_iter().map(|(_, relay)| relay);
        for mut process in relays.chain([self.robots]) {
            process.signal(Signal::TERM);
            process.wait_exit();
        }
    }
}

/// Starts a side of the relay, or the router, with a configuration of its own.
fn start_relay(
    site: &Site,
    side: &str,
    endpoint: &str,
    has_router: bool,
    robots: &[u32],
) -> Result<Process> {
    let side_name = side.split(' ').next().unwrap_or_default();
    let file = format!("{side_name}-{}.toml", robots.first().unwrap_or(&0));
    let text = config(endpoint, has_router, robots);
    std::fs::write(site.folder().join(&file), text)?;
    let (side, options) = side.split_once(' ').unwrap_or((side, ""));
    site.spawn(&format!("relay {side} --config {file} {options}"))
}

fn config(endpoint: &str, has_router: bool, robots: &[u32]) -> String {
    let (through, listen, connect) = match has_router {
        true => ("router", String::new(), format!("\"{endpoint}\"")),
        false => ("peers", format!("\"{endpoint}\""), String::new()),
    };
    let robots: Vec<String> = robots
        .iter()
        .map(|number| format!("{{ number = {number} }}"))
        .collect();
    format!(
        "[network]\nthrough = \"{through}\"\n\
         [robot]\nlisten = [{listen}]\nconnect = [{connect}]\n\
         [station]\nconnect = [\"{endpoint}\"]\nrobots = [{}]\n\
         [router]\nlisten = [\"{endpoint}\"]\n",
        robots.join(", ")
    )
}

/// Measures a way once, for about so many seconds.
fn measure(case: Case, seconds: f64) -> Result<Round> {
    let samples = (f64::from(case.rate_hz) * seconds).ceil() as usize;
    let mut running = Running::start(case, samples)?;
    // Within the samples that do not count.
    let start_up = WARM_UP as f64 / f64::from(case.rate_hz) / 2.0;
    sleep_until(MonotonicNs::now() + Duration::from_secs_f64(start_up))?;
    let mut round = Round::default();
    let before = traffic(running.port);
    let watch = Watch::begin(running.watched(case.way))?;
    // Not longer than the consumer runs: over plain Zenoh it is one of those that are watched.
    sleep_until(watch.since() + Duration::from_secs_f64(seconds))?;
    let elapsed_s = watch.end(&mut round)?;
    if let Some((before, after)) = before.zip(traffic(running.port)) {
        for (direction, index) in [(OUT, 0), (IN, 1)] {
            let bytes = after[index].saturating_sub(before[index]);
            round.add_figure(LINK, direction, bytes as f64 / elapsed_s / 1000.0);
        }
    }
    for (site, consumer) in &mut running.consumers {
        let readings: Vec<Reading> = running.sites[*site].result(consumer)?;
        for reading in readings {
            round.add("", &reading.arrivals);
            round.add_figure("", ON_AIR, reading.lost_on_air as f64);
            round.add_figure("", IN_RELAY, reading.lost_in_relay as f64);
        }
    }
    running.end();
    Ok(round)
}

/// Bytes that the process that listens at `port` has sent and received since its connections began, as the kernel counts them; `None`
/// when there is no `ss`.
fn traffic(port: u16) -> Option<[u64; 2]> {
    let shown = Command::new("ss")
        .args(["-tinHO", "state", "established"])
        .arg(format!("sport = :{port}"))
        .output()
        .ok()?;
    let lines = String::from_utf8_lossy(&shown.stdout);
    shown.status.success().then(|| {
        let sum = |key: &str| {
            let values = lines.split_whitespace();
            let values = values.filter_map(|word| word.strip_prefix(key)?.parse::<u64>().ok());
            values.sum()
        };
        [sum("bytes_sent:"), sum("bytes_received:")]
    })
}

/// Runs the command.
pub fn run(args: &Args) -> Result<()> {
    let rate_hz = args.rate;
    let pair = [Way::Relay, Way::Zenoh, Way::OneMachine].map(|way| Case { way, rate_hz });
    let measured = Measured::take(&pair, args.common.rounds, |case| {
        measure(case, args.seconds)
    })?;
    let mut section = Section::new("relay", "The relay: telemetry on another machine");
    describe_pair(&mut section, args, pair, &measured)?;
    if args.robots > 0 {
        let (robots, stations) = (args.robots, args.stations);
        let way = Way::Star { robots, stations };
        let of_rate = |rate_hz: &u32| Case {
            way,
            rate_hz: *rate_hz,
        };
        let star: Vec<Case> = args.star_rates.iter().map(of_rate).collect();
        let measured = Measured::take(&star, 1, |case| measure(case, args.star_seconds))?;
        describe_star(&mut section, args, &star, &measured);
    }
    section.publish(args.common.out().as_deref())
}

fn describe_pair(
    section: &mut Section,
    args: &Args,
    pair: [Case; 3],
    measured: &Measured<Case>,
) -> Result<()> {
    let [relay, zenoh, _] = pair;
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
    let named = pair.map(|case| (case.to_string(), case));
    section.latencies(measured, &named, &[("to plain Zenoh", zenoh)]);
    section.text(format!(
        "What the processes use at {} Hz, all topics, all threads; medians of the rounds. The robot and the consumer are processes \
         of their own beside the relay, and are part of the two processes of plain Zenoh.",
        args.rate,
    ));
    let relay_processes = [(relay, ROBOT_SIDE), (relay, STATION_SIDE)];
    let zenoh_processes = [(zenoh, PUBLISHER), (zenoh, CONSUMER)];
    let rows = [relay_processes, zenoh_processes];
    section.figures(measured, rows.as_flattened(), &[CPU, WAKES]);
    let link = |case| {
        let sum = |direction| median(&measured.figures(case, LINK, direction)).context("rounds");
        Ok::<_, anyhow::Error>(sum(OUT)? + sum(IN)?)
    };
    section.text(format!(
        "Over the link go {:.1} kB a second with the relay, {:.1} kB with plain Zenoh, both directions together, without the \
         headers of TCP.",
        link(relay)?,
        link(zenoh)?,
    ));
    for (name, fraction) in [("p50", 0.5), ("p99", 0.99)] {
        let quantiles = |case| measured.quantiles(case, "", Part::Whole, fraction);
        section.goal(
            format!("relay / plain Zenoh, {name}, {} Hz", args.rate),
            Bound::AtMost(1.5),
            Ratio::of_rounds(&quantiles(relay), &quantiles(zenoh)),
        );
    }
    // The sum and no median: one loss in one round is a loss.
    section.goal(
        "samples lost over the relay, all rounds",
        Bound::AtMost(0.0),
        Ratio::of_values(&[measured.sum(relay, "", LOST)]),
    );
    for (case, process) in relay_processes {
        section.goal(
            format!("{process}, {} Hz, all topics, % of a core", args.rate),
            Bound::AtMost(2.0),
            Ratio::of_values(&measured.figures(case, process, CPU)),
        );
    }
    Ok(())
}

fn describe_star(section: &mut Section, args: &Args, star: &[Case], measured: &Measured<Case>) {
    section.text(format!(
        "A star on the same machine: {} robots, each in a domain of its own with a relay of its own (one process publishes for all \
         of them, at moments that are spread over the period); one `ril-relay router`; {} stations, each with all robots, and a \
         consumer that reads the `HeroTelemetry` of all. {} s at each rate. CPU, memory and files are those of one process, on \
         average. Proportional memory (PSS) divides pages by the processes that share them. The link is that of the router.",
        args.robots, args.stations, args.star_seconds,
    ));
    let processes = [ROBOT_SIDE, ROUTER, STATION_SIDE];
    let rows = star
        .iter()
        .flat_map(|case| processes.map(|process| (*case, process)));
    let rows: Vec<_> = rows.collect();
    section.figures(measured, &rows, &[CPU, WAKES, MEMORY, FILES]);
    let row = |case: &Case| {
        let times = measured.times(*case, "", Part::Whole);
        let mut row = vec![case.to_string()];
        row.extend(percentiles(&times));
        row.push(times.count().to_string());
        for (name, quantity) in [("", LOST), ("", ON_AIR), ("", IN_RELAY)] {
            row.push(format!("{:.0}", measured.sum(*case, name, quantity)));
        }
        for direction in [IN, OUT] {
            row.push(format!("{:.1}", measured.sum(*case, LINK, direction)));
        }
        row
    };
    section.table(
        &[
            "rate",
            "age p50, µs",
            "age p99, µs",
            "age p99.9, µs",
            "samples read",
            LOST,
            "all topics: lost on the air",
            IN_RELAY,
            "router in, kB/s",
            "router out, kB/s",
        ],
        &star.iter().map(row).collect::<Vec<_>>(),
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_configurations_are_some() {
        let cases: [(bool, &[u32]); 3] = [(false, &[1]), (true, &[1, 2]), (true, &[])];
        for (has_router, robots) in cases {
            let text = config("tcp/127.0.0.1:7447", has_router, robots);
            let config: relay::config::Config = runtime::config::parse(&text, "x.toml").unwrap();
            config.check().unwrap();
            assert_eq!(config.station.robots.len(), robots.len());
        }
    }
}
