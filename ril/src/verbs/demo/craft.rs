//! One robot: its processes in shared memory of its own, as on a machine of its own, and what is seen of it there and
//! at the station.

use std::fs;
use std::path::PathBuf;

use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState, RelayLink};
use ipc_types::{Domain, Ipc, MonotonicNs, RobotId, Source, Subscriber, TelemetryGroup};
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::finding::Finding;
use rustix::process::Signal;

use super::children::{ChildProcess, Readiness, Spawner};
use super::files::{FlightFiles, judge_flight};
use super::script::{BRIDGE_CONFIG, ScriptCommand, line, status_config, waypoints_of, write_paths};
use super::seen::{Flown, LossCounts};

/// The name of the station.
pub const STATION: &str = "demo";

/// Of both sides of the relays: a machine that stalls for seconds is no outage, and the outcome of an order is not
/// waited for very long when its robot is dead.
pub const RELAY_CONFIG: &str =
    "[network]\nsilent_after_ms = 6000\n[commands]\nunknown_after_s = 15\n";

/// The processes of a robot, in the order in which they are started: each before the one that it would miss something
/// of. A robot that is alone has no relay, the last one.
pub const KINDS: [&str; 5] = ["sim", "status", "record", "bridge", "relay"];

/// The order in which they end: what the bridge published last is recorded before the recorder ends.
pub const ENDS: [&str; 5] = ["relay", "bridge", "status", "sim", "record"];

/// How far the robots stand from each other, degrees of latitude: 222 m. None flies a tenth of that.
const APART_DEG: f64 = 0.002;

/// Where the first robot stands, degrees.
const FIRST_DEG: (f64, f64) = (37.411, -6.001);

/// The latitude at which a robot stands.
fn latitude_deg(number: u32) -> f64 {
    FIRST_DEG.0 + APART_DEG * f64::from(number - 1)
}

/// A robot.
pub struct Craft {
    /// Its number.
    pub number: u32,
    /// Shared memory of its own.
    pub domain: Domain,
    folder: PathBuf,
    /// Where its relay listens; `None` if it has none and stands where the simulator puts it.
    endpoint: Option<String>,
    /// Its processes, those of [`KINDS`] that were started.
    pub processes: Vec<ChildProcess>,
    /// How many were started.
    started: usize,
    ports: Option<CraftPorts>,
    /// How it flies, and what a consumer beside it sees.
    pub flown: Flown,
    /// The operator's command for it that is under way.
    pub order: Option<(ScriptCommand, ChildProcess)>,
}

/// The consumer beside the robot.
struct CraftPorts {
    _ipc: Ipc,
    dsp: Subscriber<DspTelemetry>,
    hero: Subscriber<HeroTelemetry>,
    state: Subscriber<ModuleState>,
}

impl Craft {
    /// A robot with its files in `folder`, of which nothing is started yet. Its relay, if it has one, listens at
    /// `endpoint`.
    pub fn new(number: u32, folder: PathBuf, endpoint: Option<&str>) -> Result<Craft, Failure> {
        fs::create_dir_all(&folder).or_fail(ExitCode::Internal)?;
        let domain = Domain::isolated();
        let robot = RobotId::new(number).expect("robots are counted from 1");
        let ipc = Ipc::join(&domain, robot, "demo").map_err(Failure::internal)?;
        let ports = CraftPorts {
            dsp: ipc.subscriber().map_err(Failure::internal)?,
            hero: ipc.subscriber().map_err(Failure::internal)?,
            state: ipc.subscriber().map_err(Failure::internal)?,
            _ipc: ipc,
        };
        Ok(Craft {
            number,
            domain,
            folder,
            endpoint: endpoint.map(str::to_owned),
            processes: Vec::new(),
            started: 0,
            ports: Some(ports),
            flown: Flown::default(),
            order: None,
        })
    }

    /// Where its relay listens.
    pub fn endpoint(&self) -> Option<&str> {
        self.endpoint.as_deref()
    }

    fn spawner<'a>(&'a self, domain: &'a Domain, readiness: &'a Readiness) -> Spawner<'a> {
        Spawner {
            domain,
            robot: self.number,
            folder: &self.folder,
            readiness,
        }
    }

    /// Starts one of [`KINDS`]; it says on `readiness` when it is ready.
    pub fn start(&mut self, kind: &str, speed: f64, readiness: &Readiness) -> Result<(), Failure> {
        let (port, speed) = (self.folder.join("dsp"), speed.to_string());
        let port = port.to_string_lossy();
        let spawner = self.spawner(&self.domain, readiness);
        let write = |name: &str, text: &str| {
            let written = fs::write(spawner.config_file(name), text);
            written.or_fail(ExitCode::Internal)
        };
        let started = match kind {
            "sim" => {
                let (latitude, longitude) = (latitude_deg(self.number), FIRST_DEG.1);
                let home = self.endpoint.as_ref().map(|_| {
                    format!("[home]\nlatitude_deg = {latitude:.6}\nlongitude_deg = {longitude}\n")
                });
                write("sim", &home.unwrap_or_default())?;
                spawner.start("sim", &["--link", &port, "--speed", &speed])
            }
            "status" => {
                write("status", &status_config(&self.folder))?;
                spawner.start("status", &[])
            }
            "bridge" => spawner.start("bridge", &["--port", &port]),
            "relay" => {
                write("relay", RELAY_CONFIG)?;
                let endpoint = self.endpoint.as_deref().unwrap_or_default();
                let args = ["--listen", endpoint, "--may-command", STATION];
                spawner.start_relay("robot", &args)
            }
            _ => {
                // The recorder keeps it along.
                write("bridge", BRIDGE_CONFIG)?;
                spawner.start_recorder()
            }
        };
        self.processes.push(started?);
        self.started += 1;
        Ok(())
    }

    /// Gives a command in the shared memory of the station, or, without one, in its own.
    pub fn order(
        &mut self,
        command: ScriptCommand,
        station: Option<&Domain>,
        readiness: &Readiness,
    ) -> Result<(), Failure> {
        let spawner = self.spawner(station.unwrap_or(&self.domain), readiness);
        self.order = Some((command, spawner.order(command.0, command.1)?));
        Ok(())
    }

    /// Whether the command has ended; takes down how.
    pub fn has_order_ended(&mut self) -> bool {
        let Some((command, order)) = self.order.as_mut() else {
            return true;
        };
        if !order.has_ended() {
            return false;
        }
        let (code, said) = (order.end(), order.last_words());
        let end = said.lines().last().unwrap_or("it ended without a word");
        self.flown.order_ended(&line(*command), code, end);
        self.order = None;
        true
    }

    /// Looks for the waypoints around the place where it stands, and writes them for the operator.
    pub fn plan_paths(&mut self) -> Result<(), Failure> {
        let home = self.flown.seen.home.ok_or_else(|| {
            Failure::internal(format!("robot {} has not shown where it is", self.number))
        })?;
        let paths = waypoints_of(&home);
        self.flown.seen.waypoints = paths.concat();
        write_paths(&self.folder, &paths)
    }

    /// Takes every sample that came.
    pub fn drain(&mut self) -> Result<(), Failure> {
        let (Some(ports), seen) = (&mut self.ports, &mut self.flown.seen) else {
            return Ok(());
        };
        ports
            .dsp
            .drain(|sample| seen.dsp(sample))
            .map_err(Failure::internal)?;
        ports
            .hero
            .drain(|sample| seen.hero(sample, MonotonicNs::now()))
            .map_err(Failure::internal)?;
        ports
            .state
            .drain(|state| seen.state(state))
            .map_err(Failure::internal)?;
        seen.counts = LossCounts {
            dsp: ports.dsp.losses(),
            hero: ports.hero.losses(),
            state: ports.state.losses(),
        };
        Ok(())
    }

    /// What wakes the one wait for it: samples, and the ends of processes and of the command.
    pub fn sources(&mut self) -> (Vec<&mut dyn Source>, impl Iterator<Item = &ChildProcess>) {
        let ports = self.ports.iter_mut();
        let ports = ports.flat_map(|ports| -> [&mut dyn Source; 3] {
            [&mut ports.dsp, &mut ports.hero, &mut ports.state]
        });
        (
            ports.collect(),
            self.processes
                .iter()
                .chain(self.order.iter().map(|(_, order)| order)),
        )
    }

    /// Its relay.
    pub fn relay(&self) -> Option<&ChildProcess> {
        self.processes
            .iter()
            .find(|process| process.name() == "relay")
    }

    /// Whether it was killed, or has been left.
    pub fn is_dead(&self) -> bool {
        self.ports.is_none()
    }

    /// Ends everything of it at once, without a word.
    pub fn kill(&mut self) {
        for process in &mut self.processes {
            process.signal(Signal::KILL);
        }
        for process in &mut self.processes {
            process.end();
        }
        self.processes.clear();
        self.ports = None;
    }

    /// Hands over its process of this kind, if it has one.
    pub fn take_process(&mut self, kind: &str) -> Option<ChildProcess> {
        let at = self.processes.iter().position(|one| one.name() == kind)?;
        Some(self.processes.swap_remove(at))
    }

    /// Leaves its shared memory; its processes have ended. Returns how many things are left there.
    pub fn leave(&mut self) -> Result<usize, Failure> {
        self.ports = None;
        self.domain.remove_if_dead().map_err(Failure::internal)?;
        Ok(self.domain.residue().len())
    }

    /// Judges its flight; it has ended.
    pub fn judge(&self, files: &FlightFiles, residue: usize) -> Vec<Finding> {
        let robot = RobotId::new(self.number).expect("robots are counted from 1");
        judge_flight(&self.flown, robot, files, self.started, residue)
    }

    /// The files that its flight has left.
    pub fn files(&self) -> FlightFiles {
        FlightFiles::find(&self.folder)
    }
}

/// What the station sees of a robot.
pub struct View {
    number: u32,
    _ipc: Ipc,
    link: Subscriber<RelayLink>,
    hero: Subscriber<HeroTelemetry>,
    state: Subscriber<ModuleState>,
    /// How the link is.
    pub last_link: Option<RelayLink>,
    /// The last state of the bridge.
    pub last_state: Option<ModuleState>,
    /// Samples of a helicopter that is where this robot is.
    pub own: u64,
    /// Samples of a helicopter that is somewhere else.
    pub foreign: u64,
}

impl View {
    /// In the station's shared memory.
    pub fn new(number: u32, station: &Domain) -> Result<View, Failure> {
        let robot = RobotId::new(number).expect("robots are counted from 1");
        let ipc = Ipc::join(station, robot, "demo").map_err(Failure::internal)?;
        Ok(View {
            number,
            link: ipc.subscriber().map_err(Failure::internal)?,
            hero: ipc.subscriber().map_err(Failure::internal)?,
            state: ipc.subscriber().map_err(Failure::internal)?,
            _ipc: ipc,
            last_link: None,
            last_state: None,
            own: 0,
            foreign: 0,
        })
    }

    /// Takes every sample that came.
    pub fn drain(&mut self) -> Result<(), Failure> {
        let (link, state) = (&mut self.last_link, &mut self.last_state);
        self.link
            .drain(|sample| *link = Some(*sample))
            .map_err(Failure::internal)?;
        self.state
            .drain(|sample| *state = Some(*sample))
            .map_err(Failure::internal)?;
        let (number, own, foreign) = (self.number, &mut self.own, &mut self.foreign);
        let take = |sample: &HeroTelemetry| {
            if sample.valid(TelemetryGroup::Geographic) {
                let latitude = sample.geodetic.latitude_rad.to_degrees();
                match (latitude - latitude_deg(number)).abs() < APART_DEG / 2.0 {
                    true => *own += 1,
                    false => *foreign += 1,
                }
            }
        };
        self.hero.drain(take).map_err(Failure::internal)?;
        Ok(())
    }
}
