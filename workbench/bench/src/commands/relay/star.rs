//! Many robots, one router, some stations that each have all robots.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Result;
use ipc_types::MonotonicNs;
use relay::config::MAX_ROBOTS;

use super::holding::Holding;
use super::load::{Load, Watch};
use crate::latency::WARM_UP;
use crate::pace::sleep_until;
use crate::process::{Argument, Child};
use crate::relayed::Reading;
use crate::site::Site;
use crate::statistics::Times;
use crate::traffic::{Traffic, free_port};

/// How large the star is.
#[derive(Clone, Copy, Debug)]
pub struct Size {
    /// Robots, each with a relay.
    pub robots: u32,
    /// Stations, each with as many relays as it takes for all robots.
    pub stations: u32,
}

/// Processes of one kind.
#[derive(Clone, Debug, Default)]
pub struct Group {
    /// How many there are.
    pub count: usize,
    /// Of one of them, on average.
    pub load: Load,
    /// Of one of them, on average.
    pub holding: Holding,
}

/// What the star has shown at one rate.
pub struct Round {
    /// Samples a second of each kind of telemetry of each robot.
    pub rate_hz: u32,
    /// The robots' relays.
    pub robot_sides: Group,
    /// The router.
    pub router: Group,
    /// The stations' relays.
    pub station_sides: Group,
    /// What a second brings over the router's connections.
    pub traffic: Option<Traffic>,
    /// From publishing to reading, all robots and stations.
    pub times: Times,
    /// Samples of `HeroTelemetry` that a consumer did not get.
    pub lost: u64,
    /// Samples of all topics that got lost between two relays.
    pub lost_on_air: u64,
    /// Samples of all topics that the robots' relays did not read in time.
    pub lost_in_relay: u64,
}

/// The processes. Dropped in this order.
struct Running {
    consumers: Vec<Child>,
    station_sides: Vec<Child>,
    robot_sides: Vec<Child>,
    router: Child,
    _robots: Child,
    port: u16,
    _sites: Vec<Site>,
}

impl Running {
    fn start(size: Size, rate_hz: u32, samples: usize) -> Result<Running> {
        let port = free_port()?;
        let common = Site::new()?;
        let sites = |count| (0..count).map(|_| Site::new()).collect::<Result<Vec<_>>>();
        let (robot_sites, station_sites) = (sites(size.robots)?, sites(size.stations)?);
        let roots: Vec<_> = robot_sites
            .iter()
            .map(|site| site.domain().root())
            .collect();
        let mut arguments: Vec<&dyn Argument> = vec![&"robots", &rate_hz];
        arguments.extend(roots.iter().map(|root| root as &dyn Argument));
        let robots = Child::start(&common, &arguments)?;

        let configure = |robots: &[u32]| -> Result<PathBuf> {
            let path = common
                .path()
                .join(format!("{}.toml", robots.first().unwrap_or(&0)));
            std::fs::write(&path, config(port, robots))?;
            Ok(path)
        };
        let start = |site: &Site, side: &str, config: &Path, more: &[&dyn Argument]| {
            let arguments: [&dyn Argument; 4] = [&"relay", &side, &"--config", &config];
            Child::spawn(site, &[&arguments[..], more].concat())
        };
        let config = configure(&[])?;
        let router = start(&common, "router", &config, &[])?;
        let mut robot_sides = Vec::new();
        for (number, site) in (1_u32..).zip(&robot_sites) {
            robot_sides.push(start(site, "robot", &config, &[&"--robot", &number])?);
        }
        let all: Vec<u32> = (1..=size.robots).collect();
        let mut station_sides = Vec::new();
        for some in all.chunks(MAX_ROBOTS) {
            let config = configure(some)?;
            for (index, site) in station_sites.iter().enumerate() {
                let name = format!("bench-{index}");
                station_sides.push(start(site, "station", &config, &[&"--name", &name])?);
            }
        }
        let mut consumers = Vec::new();
        for site in &station_sites {
            consumers.push(Child::start(
                site,
                &[&"consume-robots", &size.robots, &samples],
            )?);
        }
        Ok(Running {
            consumers,
            station_sides,
            robot_sides,
            router,
            _robots: robots,
            port,
            _sites: [vec![common], robot_sites, station_sites]
                .into_iter()
                .flatten()
                .collect(),
        })
    }
}

/// What all processes of the star have as their configuration.
fn config(port: u16, robots: &[u32]) -> String {
    let endpoint = format!("[\"tcp/127.0.0.1:{port}\"]");
    let mut list = String::new();
    for number in robots {
        // Writing to a string cannot fail.
        let _ = write!(list, "{{ number = {number} }}, ");
    }
    format!(
        "[network]\nthrough = \"router\"\n\
         [robot]\nlisten = []\nconnect = {endpoint}\n\
         [station]\nconnect = {endpoint}\nrobots = [{list}]\n\
         [router]\nlisten = {endpoint}\n"
    )
}

/// Measures the star at `rate_hz` for about so many seconds.
pub fn measure(size: Size, rate_hz: u32, seconds: f64) -> Result<Round> {
    eprintln!("a star of {} robots at {rate_hz} Hz", size.robots);
    let samples = (f64::from(rate_hz) * seconds).ceil() as usize;
    let mut running = Running::start(size, rate_hz, samples)?;
    let settling = WARM_UP as f64 / f64::from(rate_hz);
    sleep_until(MonotonicNs::now() + Duration::from_secs_f64(settling))?;

    let before = Traffic::of_port(running.port)?;
    let groups = [
        running.robot_sides.iter().collect::<Vec<_>>(),
        vec![&running.router],
        running.station_sides.iter().collect(),
    ];
    let watches = groups
        .iter()
        .map(|group| Watch::begin(group.iter().copied()))
        .collect::<Result<Vec<_>>>()?;
    sleep_until(MonotonicNs::now() + Duration::from_secs_f64(seconds))?;
    let mut results = Vec::new();
    for (group, watch) in groups.iter().zip(&watches) {
        results.push(Group::of(group, watch)?);
    }
    let after = Traffic::of_port(running.port)?;
    let [robot_sides, router, station_sides] = results.try_into().unwrap_or_default();

    let mut round = Round {
        rate_hz,
        robot_sides,
        router,
        station_sides,
        traffic: before
            .zip(after)
            .map(|(before, after)| after.since(before).per(seconds)),
        times: Times::new(),
        lost: 0,
        lost_on_air: 0,
        lost_in_relay: 0,
    };
    for consumer in &mut running.consumers {
        for reading in consumer.result::<Vec<Reading>>()? {
            round.times.merge(&reading.series.times());
            round.lost += reading.series.lost;
            round.lost_on_air += reading.lost_on_air;
            round.lost_in_relay += reading.lost_in_relay;
        }
    }
    Ok(round)
}

impl Group {
    fn of(children: &[&Child], watch: &Watch) -> Result<Group> {
        let (loads, _) = watch.end()?;
        let mut sum = Holding::default();
        for child in children {
            let holding = Holding::of(child.id())?;
            sum.resident_kib += holding.resident_kib;
            sum.proportional_kib += holding.proportional_kib;
            sum.files += holding.files;
        }
        let count = children.len().max(1) as u64;
        Ok(Group {
            count: children.len(),
            load: Load::mean(&loads),
            holding: Holding {
                resident_kib: sum.resident_kib / count,
                proportional_kib: sum.proportional_kib / count,
                files: sum.files / count,
            },
        })
    }
}

impl Traffic {
    /// The same a second, of what came in so many.
    fn per(self, seconds: f64) -> Traffic {
        let per = |count: u64| (count as f64 / seconds).round() as u64;
        Traffic {
            sent: per(self.sent),
            received: per(self.received),
            segments_sent: per(self.segments_sent),
            segments_received: per(self.segments_received),
        }
    }
}

/// A cost that grows with the rate: what it is without telemetry, and what each sample a second adds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    fixed: f64,
    per_hz: f64,
}

impl Line {
    /// The line through two points (rate, cost); what one point alone says is counted as telemetry's.
    pub fn through(points: &[(f64, f64)]) -> Option<Line> {
        let (first, last) = (points.first()?, points.last()?);
        if last.0 > first.0 {
            let per_hz = ((last.1 - first.1) / (last.0 - first.0)).max(0.0);
            let fixed = (first.1 - per_hz * first.0).max(0.0);
            return Some(Line { fixed, per_hz });
        }
        Some(Line {
            fixed: 0.0,
            per_hz: first.1 / first.0,
        })
    }

    /// The cost at a rate, when everything is `times` as much.
    pub fn at(self, rate_hz: f64, times: f64) -> f64 {
        (self.fixed + self.per_hz * rate_hz) * times
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cost_is_calculated_from_two_rates() {
        let line = Line::through(&[(5.0, 3.0), (10.0, 5.0)]).unwrap();
        assert_eq!(
            line,
            Line {
                fixed: 1.0,
                per_hz: 0.4
            }
        );
        assert_eq!(line.at(50.0, 10.0), 210.0);
        let line = Line::through(&[(10.0, 5.0)]).unwrap();
        assert_eq!(line.at(20.0, 1.0), 10.0);
        assert_eq!(Line::through(&[]), None);
        let noise = Line::through(&[(5.0, 3.0), (10.0, 2.0)]).unwrap();
        assert_eq!(noise.at(10.0, 1.0), 3.0, "a cost does not shrink");
    }

    #[test]
    fn the_configuration_of_the_star_is_one() {
        let text = config(7447, &[1, 2]);
        let config: relay::config::Config = runtime::config::parse(&text, "star.toml").unwrap();
        config.check().unwrap();
        assert_eq!(config.station.robots.len(), 2);
    }
}
