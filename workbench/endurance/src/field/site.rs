//! [`Site`]: a robot's machine and a station's machine with networks of their own, on this machine; the robot's clock is hours off.
//!
//! A machine is a child process that holds a network namespace, and for the robot a time namespace as well. All processes of the
//! machine are started within them, and end with this program.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use ipc_types::Domain;
use ril_tests::air::Weather;
use ril_tests::process::Finished;
use ril_tests::relayed::STATION;
use ril_tests::{Process, Rig, Sandbox};

use super::tunnel::{INTERFACE, Tunnel};

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

/// The name of the robot's certificate.
const ROBOT: &str = "robot-1";

/// The configuration of a machine with certificates in this folder.
pub(super) fn certificates(folder: &Path, name: &str) -> String {
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
    /// The program `ril`; the relay's lies beside it.
    pub ril: PathBuf,
    /// Protocol of the link, such as `tcp`.
    pub protocol: String,
    /// Rate and delay of the link.
    pub weather: Weather,
    /// Packets that are lost but for outages, 0 … 1.
    pub loss: f64,
    /// A measurement that takes longer hangs.
    pub limit: Duration,
    /// Of the packets that are lost.
    pub seed: u64,
}

/// Both machines with everything that runs on them.
pub struct Site {
    /// What is between the networks.
    pub tunnel: Tunnel,
    /// What runs on the machines.
    pub rig: Rig,
    /// Last: the namespaces end with them.
    _holders: [Process; 2],
}

impl Site {
    /// Starts everything in fine weather, and returns when the station shows the robot and packets are lost as planned.
    ///
    /// # Errors
    ///
    /// What this machine does not have or does not allow.
    pub fn start(plan: &Plan) -> Result<Site, String> {
        let clock = format!("--time --monotonic={AHEAD_S} --boottime={AHEAD_S}");
        let places = [Place::make(&clock)?, Place::make("")?];
        let [robot, station] = &places;
        let tunnel = Tunnel::between(
            [&robot.network(), &station.network()],
            plan.weather,
            plan.seed,
        )
        .map_err(|error| format!("/dev/net/tun: {error}"))?;
        for (place, address) in places.iter().zip(ADDRESSES) {
            place.run("ip link set lo up")?;
            place.run(&format!("ip addr add {address}/24 dev {INTERFACE}"))?;
            place.run(&format!("ip link set {INTERFACE} up"))?;
        }
        let machines = places.each_ref().map(|place| {
            let ril = plan.ril.display().to_string();
            let words = place.starter().into_iter().chain([ril]);
            Sandbox::new(words, plan.name, plan.limit)
        });
        let is_encrypted = ["tls", "quic"].contains(&plan.protocol.as_str());
        if is_encrypted {
            let names = format!("{ROBOT}={} {STATION}", ADDRESSES[0]);
            machines[0].run(&format!("relay certify pki {names}"), 0);
        }
        let folder = machines[0].path("pki");
        for (machine, name) in machines.iter().zip([ROBOT, STATION]) {
            let security = match is_encrypted {
                true => certificates(&folder, name),
                false => OPEN.to_owned(),
            };
            machine.write("relay.toml", &security);
        }
        let endpoint = format!("{}/{}:{PORT}", plan.protocol, ADDRESSES[0]);
        let [robot, station] = machines;
        let rig = Rig::between(robot, station, endpoint, 1);
        tunnel.lose(plan.loss);
        Ok(Site {
            tunnel,
            rig,
            _holders: places.map(|place| place.holder),
        })
    }

    /// Ends all processes in order, in fine weather. Returns what the bridge and the simulator had printed.
    pub fn end(&mut self) -> [Finished; 2] {
        self.tunnel.lose(0.0);
        self.rig.end()
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
