//! [`Site`]: a robot's machine and a station's machine with networks of their own, on this machine; the robot's clock is hours off.
//!
//! A machine is a child process that holds a network namespace, and for the robot a time namespace as well. All processes of the
//! machine are started within them, and end with this program.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use ipc_types::Domain;
use ril_tests::Process;

use crate::air::Weather;
use crate::machine::{Crew, Machine, end, kill};
use crate::tunnel::{INTERFACE, Tunnel};

/// How far the robot's monotonic clock is ahead of the station's, s.
pub const AHEAD_S: i64 = 25_200;

/// Addresses of the robot and the station.
const ADDRESSES: [&str; 2] = ["10.99.0.1", "10.99.0.2"];

/// Port of the robot's relay.
const PORT: u16 = 7447;

/// Makes a child end with this program, however that ends.
const WITH_THIS: &str = "setpriv --pdeathsig KILL";

/// Nothing but this program reaches these networks.
const OPEN: &str = "[security]\ninsecure = true\n";

/// The name of the station, and the one that may command.
const STATION: &str = "gcs";

/// The name of the robot's certificate.
const ROBOT: &str = "robot-1";

/// Whether the protocol wants certificates.
fn is_encrypted(protocol: &str) -> bool {
    ["tls", "quic"].contains(&protocol)
}

/// The configuration of a machine with certificates in this folder.
fn certificates(folder: &Path, name: &str) -> String {
    let folder = folder.display();
    format!(
        "[security]\nauthority = \"{folder}/ca.pem\"\ncertificate = \"{folder}/{name}.pem\"\nkey = \"{folder}/{name}-key.pem\"\n\
         robots = {{ {ROBOT} = 1 }}\n"
    )
}

/// What a site is made of.
pub struct Plan {
    /// What is measured.
    pub name: &'static str,
    /// The relay's program; `ril` lies beside it.
    pub ril: PathBuf,
    /// Protocol of the link, such as `tcp`.
    pub protocol: String,
    /// Part of `relay.toml` for both sides, without `[security]`.
    pub relay_toml: String,
    /// A measurement that takes longer hangs.
    pub limit: Duration,
    /// Of the air's chances.
    pub seed: u64,
    /// What all processes log; the logs of the relays are printed at the end.
    pub log: Option<String>,
}

/// Both machines with everything that runs on them.
pub struct Site {
    pub air: Tunnel,
    pub crew: Option<Crew>,
    robot_relay: Option<Process>,
    station_relay: Option<Process>,
    pub robot: Machine,
    pub station: Machine,
    endpoint: String,
    _holders: [Process; 2],
}

impl Site {
    /// Starts everything in fine weather, and returns when the station shows the robot.
    ///
    /// # Errors
    ///
    /// What this machine does not have or does not allow.
    pub fn start(plan: &Plan) -> Result<Site, String> {
        let clock = format!("--time --monotonic={AHEAD_S} --boottime={AHEAD_S}");
        let robot = Place::make(&clock)?;
        let station = Place::make("")?;
        let air = Tunnel::between([&robot.network(), &station.network()], plan.seed)
            .map_err(|error| format!("/dev/net/tun: {error}"))?;
        for (place, address) in [&robot, &station].into_iter().zip(ADDRESSES) {
            place.run("ip link set lo up")?;
            place.run(&format!("ip addr add {address}/24 dev {INTERFACE}"))?;
            place.run(&format!("ip link set {INTERFACE} up"))?;
        }
        let machine = |place: &Place| {
            let mut machine = Machine::within(&plan.ril, plan.name, place.starter(), plan.limit);
            machine.log.clone_from(&plan.log);
            machine.speed = 1;
            machine
        };
        let (robot_machine, station_machine) = (machine(&robot), machine(&station));
        if is_encrypted(&plan.protocol) {
            let names = format!("{ROBOT}={} {STATION}", ADDRESSES[0]);
            robot_machine.run(&format!("relay certify pki {names}"), 0);
        }
        for (machine, name) in [(&robot_machine, ROBOT), (&station_machine, STATION)] {
            let security = match is_encrypted(&plan.protocol) {
                true => certificates(&robot_machine.path("pki"), name),
                false => OPEN.to_owned(),
            };
            machine.write("relay.toml", &format!("{security}{}", plan.relay_toml));
        }
        let crew = Crew::start(&robot_machine, 1);
        let mut site = Site {
            air,
            crew: Some(crew),
            robot_relay: None,
            station_relay: None,
            robot: robot_machine,
            station: station_machine,
            endpoint: format!("{}/{}:{PORT}", plan.protocol, ADDRESSES[0]),
            _holders: [robot.holder, station.holder],
        };
        site.start_robot_relay();
        site.start_station_relay();
        site.station.await_link(1);
        Ok(site)
    }

    /// Starts the robot's relay in the place of one that was killed.
    pub fn start_robot_relay(&mut self) {
        let args = format!(
            "relay robot --listen {} --may-command {STATION}",
            self.endpoint
        );
        self.robot_relay = Some(self.robot.start_ready(&args));
    }

    /// Starts the station's relay in the place of one that was killed.
    pub fn start_station_relay(&mut self) {
        let args = format!("relay station --name {STATION} --connect {}", self.endpoint);
        self.station_relay = Some(self.station.start_ready(&args));
    }

    /// Kills the robot's relay and starts another one.
    pub fn restart_robot_relay(&mut self) {
        if let Some(relay) = self.robot_relay.take() {
            kill(&self.robot, relay);
        }
        self.start_robot_relay();
    }

    /// Kills the station's relay and starts another one.
    pub fn restart_station_relay(&mut self) {
        if let Some(relay) = self.station_relay.take() {
            kill(&self.station, relay);
        }
        self.start_station_relay();
    }

    /// Ends all processes in order, in fine weather; the machines look whether anything is left when they are dropped. Returns the log of the bridge and that of the simulator.
    pub fn end(&mut self) -> [ril_tests::process::Finished; 2] {
        self.air.set(Weather::default());
        for relay in [self.station_relay.take(), self.robot_relay.take()]
            .into_iter()
            .flatten()
        {
            let log = end(relay).stderr;
            if self.robot.log.is_some() {
                eprintln!("{}", log.join("\n"));
            }
        }
        self.crew.take().expect("it runs").end()
    }
}

/// Namespaces, and the process that holds them.
struct Place {
    holder: Process,
    id: u32,
    has_clock: bool,
}

impl Place {
    fn make(clock: &str) -> Result<Place, String> {
        // The process prints its number, and stays until it is killed.
        let script = "echo holds $$; exec tail -f /dev/null";
        let mut words = format!("{WITH_THIS} unshare --net {clock} --fork --kill-child sh -c")
            .split_whitespace()
            .map(str::to_owned)
            .collect::<Vec<_>>();
        words.push(script.to_owned());
        // Where it may not be, a try ends at once and says why.
        let attempt = Command::new(&words[0])
            .args(&words[1..words.len() - 1])
            .arg("true")
            .output()
            .map_err(|error| format!("{}: {error}", words[0]))?;
        if !attempt.status.success() {
            let reason = String::from_utf8_lossy(&attempt.stderr).trim().to_owned();
            return Err(format!("no network of its own: {reason}"));
        }
        let mut command = Command::new(&words[0]);
        command.args(&words[1..]);
        let mut holder = Process::spawn(&Domain::isolated(), command);
        let line = holder.wait_for_text("holds ").text;
        let id = line.trim_start_matches("holds ").parse();
        Ok(Place {
            id: id.map_err(|_| format!("`{line}` is no number of a process"))?,
            has_clock: !clock.is_empty(),
            holder,
        })
    }

    fn network(&self) -> PathBuf {
        Path::new("/proc").join(self.id.to_string()).join("ns/net")
    }

    /// The words before each command on this machine.
    fn starter(&self) -> Vec<String> {
        let mut text = format!("{WITH_THIS} nsenter --net={}", self.network().display());
        if self.has_clock {
            text += &format!(" --time=/proc/{}/ns/time", self.id);
        }
        text.split_whitespace().map(str::to_owned).collect()
    }

    /// Runs a command on this machine.
    fn run(&self, line: &str) -> Result<(), String> {
        let starter = self.starter();
        let output = Command::new(&starter[0])
            .args(&starter[1..])
            .args(line.split_whitespace())
            .output()
            .map_err(|error| format!("{line}: {error}"))?;
        match output.status.success() {
            true => Ok(()),
            false => Err(format!(
                "{line}: {}",
                String::from_utf8_lossy(&output.stderr).trim()
            )),
        }
    }
}
