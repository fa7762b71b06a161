//! One robot and one station, and what they are compared with.

use std::fmt;
use std::time::Duration;

use anyhow::Result;
use ipc_types::MonotonicNs;

use super::load::{Load, Watch};
use crate::latency::Series;
use crate::pace::sleep_until;
use crate::process::Child;
use crate::relayed::Reading;
use crate::site::Site;
use crate::traffic::{Traffic, free_port};
use crate::usage::{Calls, count_calls};

/// From the first sample at the consumer to the moment from which processes are watched: within the samples that do not
/// count.
const SETTLING: Duration = Duration::from_millis(500);

/// More samples than will come: the consumer is ended before.
const ENDLESS: usize = 1_000_000;

/// How telemetry gets from the robot to the consumer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Over the two sides of a relay, into another domain.
    Relay,
    /// Over plain Zenoh, without shared memory.
    Zenoh,
    /// Over shared memory alone, to a consumer on the robot.
    OneMachine,
}

impl Way {
    /// All of them.
    pub const ALL: [Way; 3] = [Way::Relay, Way::Zenoh, Way::OneMachine];
}

impl fmt::Display for Way {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Way::Relay => "relay, to the station's domain",
            Way::Zenoh => "plain Zenoh",
            Way::OneMachine => "shared memory, on the robot",
        })
    }
}

/// What one way has shown in one round.
pub struct Round {
    /// From publishing to reading.
    pub series: Series,
    /// Of the sending and of the receiving process; none where there are no two such processes.
    pub loads: Vec<Load>,
    /// Bytes a second over the link, both directions.
    pub link_bps: f64,
}

/// The processes of a way; the consumer has its first sample.
struct Running {
    /// First of the fields, because each is ended before the next one.
    consumer: Child,
    /// The sending and the receiving process.
    pair: Option<(Child, Option<Child>)>,
    robot: Option<Child>,
    port: u16,
    sites: [Site; 2],
}

impl Running {
    fn start(way: Way, rate_hz: u32, samples: usize) -> Result<Running> {
        let sites = [Site::new()?, Site::new()?];
        let port = free_port()?;
        let endpoint = format!("tcp/127.0.0.1:{port}");
        match way {
            Way::Relay => Running::relay(sites, port, &endpoint, rate_hz, samples),
            Way::Zenoh => {
                let robot = Child::start(&sites[0], &[&"zenoh-robot", &endpoint, &rate_hz])?;
                let consumer = Child::start(&sites[1], &[&"consume-zenoh", &endpoint, &samples])?;
                Ok(Running {
                    consumer,
                    pair: Some((robot, None)),
                    robot: None,
                    port,
                    sites,
                })
            }
            Way::OneMachine => {
                let robot = start_robot(&sites[0], rate_hz)?;
                let consumer = Child::start(&sites[0], &[&"consume-robots", &1_usize, &samples])?;
                Ok(Running {
                    consumer,
                    pair: None,
                    robot: Some(robot),
                    port,
                    sites,
                })
            }
        }
    }

    fn relay(
        sites: [Site; 2],
        port: u16,
        endpoint: &String,
        rate_hz: u32,
        samples: usize,
    ) -> Result<Running> {
        // Empty: the defaults, whatever lies in the folder that this program is run in.
        let config = sites[0].path().join("empty.toml");
        std::fs::write(&config, "")?;
        let config = config.as_path();
        let robot = start_robot(&sites[0], rate_hz)?;
        let (relay, ours) = (
            &"relay",
            [&"--config", &config as &dyn crate::process::Argument],
        );
        let robot_side = Child::spawn(
            &sites[0],
            &[relay, &"robot", ours[0], ours[1], &"--listen", endpoint],
        )?;
        let station_side = Child::spawn(
            &sites[1],
            &[
                relay,
                &"station",
                ours[0],
                ours[1],
                &"--name",
                &"bench",
                &"--connect",
                endpoint,
            ],
        )?;
        let consumer = Child::start(&sites[1], &[&"consume-robots", &1_usize, &samples])?;
        Ok(Running {
            consumer,
            pair: Some((robot_side, Some(station_side))),
            robot: Some(robot),
            port,
            sites,
        })
    }

    fn watched(&self) -> Vec<&Child> {
        match &self.pair {
            None => Vec::new(),
            Some((sending, Some(receiving))) => vec![sending, receiving],
            Some((sending, None)) => vec![sending, &self.consumer],
        }
    }

    fn end(self) {
        drop(self.consumer);
        if let Some((sending, receiving)) = self.pair {
            if let Some(receiving) = receiving {
                receiving.end();
            }
            sending.end();
        }
        if let Some(robot) = self.robot {
            robot.end();
        }
    }
}

fn start_robot(site: &Site, rate_hz: u32) -> Result<Child> {
    Child::start(site, &[&"robots", &rate_hz, &site.domain().root()])
}

/// Measures `way` once, for about so many seconds.
pub fn measure(way: Way, rate_hz: u32, seconds: f64) -> Result<Round> {
    let samples = (f64::from(rate_hz) * seconds).ceil() as usize;
    let mut running = Running::start(way, rate_hz, samples)?;
    sleep_until(MonotonicNs::now() + SETTLING)?;
    let before = Traffic::of_port(running.port)?.unwrap_or_default();
    let watch = Watch::begin(running.watched())?;
    // As long as the consumer, and no longer: it is one of the watched ones over plain Zenoh.
    sleep_until(MonotonicNs::now() + Duration::from_secs_f64(seconds))?;
    let (loads, elapsed_s) = watch.end()?;
    let after = Traffic::of_port(running.port)?.unwrap_or_default();
    let passed = after.since(before);
    let series = match way {
        Way::Zenoh => running.consumer.result()?,
        Way::Relay | Way::OneMachine => {
            let readings: Vec<Reading> = running.consumer.result()?;
            readings.into_iter().next().unwrap_or_default().series
        }
    };
    running.end();
    Ok(Round {
        series,
        loads,
        link_bps: (passed.sent + passed.received) as f64 / elapsed_s,
    })
}

/// System calls of the sending and of the receiving process in so many seconds; nothing when they cannot be counted.
pub fn calls(way: Way, rate_hz: u32, seconds: f64) -> Result<Option<[Calls; 2]>> {
    let running = Running::start(way, rate_hz, ENDLESS)?;
    sleep_until(MonotonicNs::now() + SETTLING)?;
    let duration = Duration::from_secs_f64(seconds);
    let mut counted = Vec::new();
    for child in running.watched() {
        counted.extend(count_calls(child.id(), duration, running.sites[0].path())?);
    }
    running.end();
    Ok(counted.try_into().ok())
}
