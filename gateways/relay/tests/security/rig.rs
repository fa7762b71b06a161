//! A robot and a station on this machine, each with a relay of its own and shared memory of its own, and strangers.

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::{HeroTelemetry, MovementData, RequestReport};
use ipc_types::{Client, Ipc, RobotId, Subscriber};
use ril_tests::process::{Process, Signal, WAIT_LIMIT};
use ril_tests::sandbox::Holdings;
use ril_tests::sandbox::place;
use ril_tests::{Received, Script, StandInBridge, StandInStatus, TestDomain};

use crate::hostile::Flood;

/// The relay's program.
pub const RELAY: &str = env!("CARGO_BIN_EXE_ril-relay");

/// Pause between two samples.
const SAMPLE_PERIOD: Duration = Duration::from_millis(20);

/// Runs a side of the relay in `folder`, with the configuration that it has there.
fn relay(domain: &TestDomain, folder: &Path, side: &str) -> Process {
    let mut command = Command::new(RELAY);
    command.args([side, "--config", &format!("{side}.toml")]);
    place(&mut command, folder);
    Process::spawn(domain, command)
}

/// The station's relay, when the robot's services are there.
fn station(domain: &TestDomain, folder: &Path) -> Process {
    let mut station = relay(domain, folder, "station");
    for key in ["movement", "hero_telemetry"] {
        station.wait_for_line(|line| {
            line.text.contains("provided here") && line.text.contains(&format!("{key:?}"))
        });
    }
    station
}

/// What a test plays with. The domains are dropped last.
pub struct Rig {
    pub station: Process,
    pub robot: Process,
    router: Option<Process>,
    pub bridge: StandInBridge,
    status: StandInStatus,
    /// Of a robot with the card of the first.
    copy: Option<StandInStatus>,
    client: Client<MovementData>,
    telemetry: Subscriber<HeroTelemetry>,
    samples: Vec<HeroTelemetry>,
    published: usize,
    pub received: u64,
    /// The last one was of the copy.
    is_of_copy: bool,
    /// How often one came of another robot than the one before.
    pub alternations: u64,
    /// What strangers send with each sample: so many messages of each.
    pub floods: Vec<(usize, Flood)>,
    pub hostile: u64,
    next_id: u64,
    _ground: Ipc,
    pub folder: tempfile::TempDir,
    domains: [TestDomain; 2],
}

impl Rig {
    /// Both relays with `robot.toml` and `station.toml` of the folder, and a router if there is `router.toml`, when the
    /// link is up and the robot's services are there at the station.
    pub fn start(folder: tempfile::TempDir) -> Rig {
        let (robot_domain, station_domain) = (TestDomain::new(), TestDomain::new());
        let bridge = StandInBridge::start_lossy(&robot_domain, RobotId::DEFAULT);
        let status = StandInStatus::start_lossy(&robot_domain, RobotId::DEFAULT);
        let has_router = folder.path().join("router.toml").is_file();
        let router = has_router.then(|| relay(&robot_domain, folder.path(), "router"));
        let robot = relay(&robot_domain, folder.path(), "robot");
        let station = station(&station_domain, folder.path());
        let ground = station_domain.join("ground");
        let client = ground.client().expect("a client");
        let telemetry = ground.subscriber().expect("a subscriber");
        let script = Script::at(37.4, -5.9, 10.0).take_off(5.0).land();
        Rig {
            station,
            robot,
            router,
            bridge,
            status,
            copy: None,
            client,
            telemetry,
            samples: script.hero(),
            published: 0,
            received: 0,
            is_of_copy: false,
            alternations: 0,
            floods: Vec::new(),
            hostile: 0,
            next_id: 1,
            _ground: ground,
            folder,
            domains: [station_domain, robot_domain],
        }
    }

    /// Another robot with the card of the first: its number, its certificate, and its relay's configuration. It
    /// publishes whenever the first one does, from the other hemisphere. The domain is dropped last.
    pub fn copy_of_robot(&mut self) -> (Process, StandInBridge, TestDomain) {
        let domain = TestDomain::new();
        let bridge = StandInBridge::start(&domain);
        self.copy = Some(StandInStatus::start_lossy(&domain, RobotId::DEFAULT));
        let robot = relay(&domain, self.folder.path(), "robot");
        (robot, bridge, domain)
    }

    /// Kills the station's relay and starts another one. Returns when the robot's services are there again.
    pub fn restart_station(&mut self) {
        self.station.signal(Signal::KILL);
        self.station.wait_exit();
        self.station = station(&self.domains[0], self.folder.path());
    }

    /// Publishes a sample on the robot, and takes what comes at the station within the pause between two.
    pub fn telemetry(&mut self) {
        let sample = &self.samples[self.published % self.samples.len()];
        let mut sample = HeroTelemetry {
            published_ns: 0,
            ..*sample
        };
        self.status.publish(&sample);
        self.published += 1;
        if let Some(copy) = &self.copy {
            sample.geodetic.latitude_rad *= -1.0;
            copy.publish(&sample);
        }
        for (count, flood) in &mut self.floods {
            for _ in 0..*count {
                flood.send();
            }
            self.hostile += *count as u64;
        }
        let mut take = |sample: &HeroTelemetry| {
            self.received += 1;
            let is_of_copy = sample.geodetic.latitude_rad < 0.0;
            let before = std::mem::replace(&mut self.is_of_copy, is_of_copy);
            self.alternations += u64::from(before != is_of_copy);
        };
        if let Ok(Some(sample)) = self.telemetry.recv_timeout(SAMPLE_PERIOD) {
            take(&sample);
        }
        self.telemetry.drain(take).expect("samples");
    }

    /// Publishes until `count` more samples have come.
    pub fn until_telemetry_comes(&mut self, count: u64) {
        let wanted = self.received + count;
        for _ in 0..WAIT_LIMIT.as_millis() / SAMPLE_PERIOD.as_millis() {
            if self.received >= wanted {
                return;
            }
            self.telemetry();
        }
        panic!("{} samples, and then none", self.received);
    }

    /// How many samples were published.
    pub fn published(&self) -> usize {
        self.published
    }

    /// Sends a request from the station, and returns its final report, while telemetry goes on.
    pub fn request(&mut self) -> RequestReport {
        let id = self.next_id;
        self.next_id += 1;
        self.client
            .send(&MovementData::take_off(id, 10.0))
            .expect("a request");
        let mut last = None;
        for _ in 0..WAIT_LIMIT.as_millis() / SAMPLE_PERIOD.as_millis() {
            self.telemetry();
            self.client.drain(|report| last = Some(*report));
            if let Some(report) = last.filter(RequestReport::is_final) {
                return report;
            }
        }
        panic!("request {id} has no final report: {last:?}");
    }

    /// Id of the request that was sent last.
    pub fn last_id(&self) -> u64 {
        self.next_id - 1
    }

    /// Sends a request that must be done, and asserts that the bridge has had it, and no other. On a machine that
    /// stalls the station takes the link for down, and refuses what it then does not send: it is asked again.
    pub fn request_done(&mut self) {
        let link_down = (Some(Stage::Refused), Some(Reason::RelayLinkDown));
        let (id, outcome) = loop {
            let id = self.next_id;
            let report = self.request();
            let outcome = (report.stage(), report.reason());
            if outcome != link_down {
                break (id, outcome);
            }
        };
        assert_eq!(outcome, (Some(Stage::Done), Some(Reason::None)), "{id}");
        match self.bridge.next_request() {
            Received::Movement(movement) => assert_eq!(movement.request_id, id),
            other => panic!("{other:?} was ordered by a stranger"),
        }
    }

    /// Memory of the robot's and the station's relay, kB.
    pub fn resident_kb(&self) -> [u64; 2] {
        [&self.robot, &self.station].map(|process| Holdings::of(process.id()).memory_kib)
    }

    /// Processor time of the robot's and the station's relay so far, s.
    pub fn processor_s(&self) -> [f64; 2] {
        [&self.robot, &self.station].map(|process| {
            let stat = std::fs::read_to_string(format!("/proc/{}/stat", process.id()));
            let stat = stat.expect("a running process");
            let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or("").split(' ').collect();
            let ticks = |index: usize| fields[index].parse::<f64>().expect("ticks");
            (ticks(12) + ticks(13)) / 100.0
        })
    }

    /// Lines that the robot's and the station's relay have logged.
    pub fn lines(&mut self) -> [usize; 2] {
        [self.robot.lines().len(), self.station.lines().len()]
    }

    /// Ends the relays as an operator does.
    pub fn end(self) {
        let relays = [self.station, self.robot].into_iter();
        relays.chain(self.router).for_each(|relay| {
            relay.end();
        });
    }
}
