//! `relay`: what telemetry on another machine costs, beside plain Zenoh.

use std::fmt;
use std::net::TcpListener;
use std::process::Command;
use std::time::Duration;

use anyhow::{Context, Result};
use ipc_types::MonotonicNs;
use ipc_types::payload::{DspTelemetry, HeroTelemetry};
use measure::median;
use ril_tests::Process;
use ril_tests::process::Signal;

use super::Common;
use crate::harness::{Placement, Site};
use crate::measured::{Arrival, LOST, Measured, Part, Ratio, Round, WARM_UP};
use crate::pace::sleep_until;
use crate::report::{Bound, Section};
use crate::usage::{CPU, WAKES, Watch};

/// Names of the processes.
const ROBOT_SIDE: &str = "relay, robot side";
const STATION_SIDE: &str = "relay, station side";
const PUBLISHER: &str = "plain Zenoh, publisher";
const CONSUMER: &str = "plain Zenoh, consumer";

/// What the listening process sends and receives, kB a second.
const LINK: &str = "link";
const OUT: &str = "out";
const IN: &str = "in";

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
}

/// How telemetry gets from a robot to a consumer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    /// Over the two sides of a relay, into another domain.
    Relay,
    /// Over plain Zenoh, without shared memory.
    Zenoh,
    /// Over shared memory alone, to a consumer on the robot.
    OneMachine,
}

impl fmt::Display for Way {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Way::Relay => f.write_str("relay, to the station's domain"),
            Way::Zenoh => f.write_str("plain Zenoh"),
            Way::OneMachine => f.write_str("shared memory, on the robot"),
        }
    }
}

/// The processes of a way, in the order in which they are ended. The consumer has its first sample.
struct Running {
    consumer: Process,
    relays: Vec<(&'static str, Process)>,
    robot: Process,
    port: u16,
    /// The robot's, and the one of the consumer.
    sites: [Site; 2],
}

impl Running {
    fn start(way: Way, rate_hz: u32, samples: usize) -> Result<Running> {
        let port = TcpListener::bind("127.0.0.1:0")?.local_addr()?.port();
        let endpoint = format!("tcp/127.0.0.1:{port}");
        let sites = [Site::new(Placement::Free)?, Site::new(Placement::Free)?];
        let mut relays = Vec::new();
        let (robot, consumer) = match way {
            Way::Zenoh => (
                sites[0].start(&format!("zenoh-robot {endpoint} {rate_hz}"))?,
                sites[1].start(&format!("consume-zenoh {endpoint} {samples}"))?,
            ),
            Way::Relay => {
                let robot = sites[0].start(&format!("robot {rate_hz}"))?;
                let robot_side = start_relay(&sites[0], "robot", &endpoint)?;
                let station_side = start_relay(&sites[1], "station", &endpoint)?;
                // The station's is ended before the robot's.
                relays = vec![(STATION_SIDE, station_side), (ROBOT_SIDE, robot_side)];
                let consumer = sites[1].start(&format!("consume-robot {samples}"))?;
                (robot, consumer)
            }
            Way::OneMachine => (
                sites[0].start(&format!("robot {rate_hz}"))?,
                sites[0].start(&format!("consume-robot {samples}"))?,
            ),
        };
        Ok(Running {
            consumer,
            relays,
            robot,
            port,
            sites,
        })
    }

    fn watched(&self, way: Way) -> Vec<(&'static str, &Process)> {
        if way == Way::Zenoh {
            return vec![(CONSUMER, &self.consumer), (PUBLISHER, &self.robot)];
        }
        let relays = self.relays.iter();
        relays.map(|(name, process)| (*name, process)).collect()
    }

    fn end(self) {
        drop(self.consumer);
        let relays = self.relays.into_iter().map(|(_, relay)| relay);
        for mut process in relays.chain([self.robot]) {
            process.signal(Signal::TERM);
            process.wait_exit();
        }
    }
}

/// Starts a side of the relay, with a configuration of its own.
fn start_relay(site: &Site, side: &str, endpoint: &str) -> Result<Process> {
    let file = format!("{side}.toml");
    std::fs::write(site.folder().join(&file), config(endpoint))?;
    site.spawn(&format!("relay {side} --config {file}"))
}

/// Of both sides.
fn config(endpoint: &str) -> String {
    format!(
        "[robot]\nlisten = [\"{endpoint}\"]\n[station]\nname = \"bench\"\nconnect = [\"{endpoint}\"]\n"
    )
}

/// Measures a way once, for about so many seconds.
fn measure(way: Way, rate_hz: u32, seconds: f64) -> Result<Round> {
    let samples = (f64::from(rate_hz) * seconds).ceil() as usize;
    let mut running = Running::start(way, rate_hz, samples)?;
    // Within the samples that do not count.
    let start_up = WARM_UP as f64 / f64::from(rate_hz) / 2.0;
    sleep_until(MonotonicNs::now() + Duration::from_secs_f64(start_up))?;
    let mut round = Round::default();
    let before = traffic(running.port);
    let watch = Watch::begin(running.watched(way))?;
    // Not longer than the consumer runs: over plain Zenoh it is one of those that are watched.
    sleep_until(watch.since() + Duration::from_secs_f64(seconds))?;
    let elapsed_s = watch.end(&mut round)?;
    if let Some((before, after)) = before.zip(traffic(running.port)) {
        for (direction, index) in [(OUT, 0), (IN, 1)] {
            let bytes = after[index].saturating_sub(before[index]);
            round.add_figure(LINK, direction, bytes as f64 / elapsed_s / 1000.0);
        }
    }
    let site = &running.sites[usize::from(way != Way::OneMachine)];
    let arrivals: Vec<Arrival> = site.result(&mut running.consumer)?;
    round.add("", &arrivals);
    running.end();
    Ok(round)
}

/// Bytes that the process that listens at `port` has sent and received since its connections began, as the kernel
/// counts them; `None` when there is no `ss`.
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
    let ways = [Way::Relay, Way::Zenoh, Way::OneMachine];
    let measured = Measured::take(&ways, args.common.rounds, |way| {
        measure(way, args.rate, args.seconds)
    })?;
    let mut section = Section::new("relay", "The relay: telemetry on another machine");
    describe(&mut section, args, ways, &measured)?;
    section.publish(args.common.out().as_deref())
}

fn describe(
    section: &mut Section,
    args: &Args,
    ways: [Way; 3],
    measured: &Measured<Way>,
) -> Result<()> {
    let [relay, zenoh, _] = ways;
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
    let named = ways.map(|way| (way.to_string(), way));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_configuration_is_one() {
        let text = config("tcp/127.0.0.1:7447");
        let config: relay::config::Config = runtime::config::parse(&text, "x.toml").unwrap();
        config.check().unwrap();
    }
}
