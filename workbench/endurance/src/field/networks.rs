//! [`Networks`]: a robot's machine and a station's machine with networks of their own, on this machine; the robot's
//! clock is hours off.
//!
//! A machine is a child process that holds a network namespace, and for the robot a time namespace as well. Each has a
//! network interface whose other end is this program, which carries the packets, at the rate and with the delay of a
//! [`Weather`], and loses some by a seed, as `tc netem` would. That needs root, `/dev/net/tun`, and the programs `ip`,
//! `setpriv`, `unshare` and `nsenter`; a measurement says which is missing. Everything ends with this program, even if
//! it is killed: the interfaces are not persistent.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, Read, Write};
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use fastrand::Rng;
use ipc_types::Domain;
use ril_tests::air::{Way, Weather};
use ril_tests::process::Finished;
use ril_tests::{Process, Rig};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::ioctl::{Opcode, Setter, ioctl};
use rustix::thread::{LinkNameSpaceType, move_into_link_name_space};

use super::secure;
use crate::site::Site;

/// How far the robot's monotonic clock is ahead of the station's, s.
pub const AHEAD_S: i64 = 25_200;

/// Addresses of the robot and the station.
const ADDRESSES: [&str; 2] = ["10.99.0.1", "10.99.0.2"];

/// Port of the robot's relay.
const PORT: u16 = 7447;

/// Makes a child end with this program, however that ends.
const WITH_THIS: &str = "setpriv --pdeathsig KILL";

/// Name of the interface in each namespace.
const INTERFACE: &str = "air";

/// Longest packet, bytes; the interface's is 1500.
const PACKET: usize = 2048;

/// Attaches a descriptor of `/dev/net/tun` to an interface.
const TUNSETIFF: Opcode = 0x4004_54ca;
/// Packets of IP, without anything in front of them.
const IFF_TUN_NO_PI: i16 = 0x1001;

/// Both machines with everything that runs on them.
pub struct Networks {
    /// What runs on the machines.
    pub rig: Rig,
    /// Share of the packets that is lost in fine weather, 0 … 1.
    pub loss: f64,
    /// Share of the packets that is lost at this moment, each packet by itself.
    lost: Arc<Mutex<f64>>,
    /// Last: the namespaces end with them.
    _holders: [Process; 2],
}

impl Networks {
    /// Starts everything with a link that loses nothing, and returns when the station shows the robot and packets are
    /// lost as planned.
    ///
    /// # Errors
    ///
    /// What this machine does not have or does not allow.
    pub fn start(
        site: &Site,
        protocol: &str,
        usual_loss_percent: u8,
        one_way: Duration,
    ) -> Result<Networks, String> {
        let clock = format!("--time --monotonic={AHEAD_S} --boottime={AHEAD_S}");
        let places = [Place::make(&clock)?, Place::make("")?];
        let ends = places.each_ref().map(|place| open_in(&place.network()));
        let [first, second] = ends.map(|end| end.map_err(|error| format!("/dev/net/tun: {error}")));
        let (ends, lost) = ([first?, second?], Arc::new(Mutex::new(0.0)));
        let (loses, chance) = (Arc::clone(&lost), site.chance(0));
        thread::spawn(move || {
            if let Err(error) = carry(ends, Weather::far(one_way), &loses, chance) {
                eprintln!("the tunnel has ended: {error}");
            }
        });
        for (place, address) in places.iter().zip(ADDRESSES) {
            place.run("ip link set lo up")?;
            place.run(&format!("ip addr add {address}/24 dev {INTERFACE}"))?;
            place.run(&format!("ip link set {INTERFACE} up"))?;
        }
        let [robot, station] = places.each_ref().map(|place| site.machine(place.starter()));
        secure(protocol, ADDRESSES[0], &robot, &station);
        let endpoint = format!("{protocol}/{}:{PORT}", ADDRESSES[0]);
        let networks = Networks {
            rig: Rig::between(robot, station, endpoint, 1),
            loss: site.plan.loss(usual_loss_percent),
            lost,
            _holders: places.map(|place| place.holder),
        };
        networks.calm();
        Ok(networks)
    }

    /// Loses packets as planned from now on.
    pub fn calm(&self) {
        self.lose(self.loss);
    }

    /// Loses all packets from now on.
    pub fn cut(&self) {
        self.lose(1.0);
    }

    fn lose(&self, share: f64) {
        *self.lost.lock().expect("no panic while it is held") = share;
    }

    /// Ends all processes in order, over a link that loses nothing. Returns what the bridge and the simulator had
    /// printed.
    pub fn end(&mut self) -> [Finished; 2] {
        self.lose(0.0);
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
        let words = format!("{WITH_THIS} unshare --net {clock} --fork --kill-child");
        // Where it may not be, a try ends at once and says why.
        done(
            command(&words).arg("true").output(),
            "no network of its own",
        )?;
        let mut command = command(&words);
        // The process prints its number, and stays until it is killed.
        command.args(["sh", "-c", "echo holds $$; exec tail -f /dev/null"]);
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
        let words = format!("{} {line}", self.starter().join(" "));
        done(command(&words).output(), line)
    }
}

fn command(words: &str) -> Command {
    let mut words = words.split_whitespace();
    let mut command = Command::new(words.next().expect("a program"));
    command.args(words);
    command
}

/// An error says what the command said.
fn done(output: io::Result<Output>, what: &str) -> Result<(), String> {
    let output = output.map_err(|error| format!("{what}: {error}"))?;
    let words = String::from_utf8_lossy(&output.stderr);
    let failed = || format!("{what}: {}", words.trim());
    output.status.success().then_some(()).ok_or_else(failed)
}

/// `struct ifreq`, of which the kernel reads name and flags.
#[repr(C)]
struct InterfaceRequest {
    name: [u8; 16],
    flags: i16,
    rest: [u8; 22],
}

/// Makes the interface within the namespace, by a thread that goes there.
fn open_in(namespace: &Path) -> io::Result<File> {
    let namespace = File::open(namespace)?;
    let thread = thread::spawn(move || -> io::Result<File> {
        move_into_link_name_space(namespace.as_fd(), Some(LinkNameSpaceType::Network))?;
        let mut options = File::options();
        let tun = options.read(true).write(true).open("/dev/net/tun")?;
        attach(&tun)?;
        fcntl_setfl(&tun, fcntl_getfl(&tun)? | OFlags::NONBLOCK)?;
        Ok(tun)
    });
    thread.join().expect("the thread does not panic")
}

#[allow(unsafe_code)]
fn attach(tun: &File) -> io::Result<()> {
    let mut request = InterfaceRequest {
        name: [0; 16],
        flags: IFF_TUN_NO_PI,
        rest: [0; 22],
    };
    request.name[..INTERFACE.len()].copy_from_slice(INTERFACE.as_bytes());
    // SAFETY: the operation reads a `struct ifreq`, which this is.
    unsafe { ioctl(tun, Setter::<TUNSETIFF, InterfaceRequest>::new(request))? };
    Ok(())
}

/// Carries packets until an end is gone.
fn carry(
    mut ends: [File; 2],
    weather: Weather,
    lost: &Mutex<f64>,
    mut chance: Rng,
) -> io::Result<()> {
    let mut ways = [Way::new(weather); 2];
    // What is under way from each end: when it arrives, and what it is.
    let mut passing = [(); 2].map(|()| VecDeque::<(Instant, Vec<u8>)>::new());
    let mut packet = [0; PACKET];
    loop {
        for (from, to) in [(0, 1), (1, 0)] {
            while let Ok(length) = ends[from].read(&mut packet) {
                let now = Instant::now();
                let is_lost = chance.f64() < *lost.lock().expect("no panic while it is held");
                if is_lost || !ways[from].full_for(now).is_zero() {
                    continue;
                }
                let (leaves, _) = ways[from].take(length, now);
                passing[from].push_back((leaves + weather.delay, packet[..length].to_vec()));
            }
            let now = Instant::now();
            while let Some((arrives, _)) = passing[from].front()
                && *arrives <= now
                && let Some((_, packet)) = passing[from].pop_front()
            {
                // An interface that is down, or full, loses it.
                let _ = ends[to].write(&packet);
            }
        }
        let next = passing.iter().filter_map(VecDeque::front);
        let next = next.map(|(arrives, _)| arrives.saturating_duration_since(Instant::now()));
        let timeout = next.min().and_then(|left| left.try_into().ok());
        let [first, second] = &ends;
        let mut descriptors = [first, second].map(|end| PollFd::new(end, PollFlags::IN));
        poll(&mut descriptors, timeout.as_ref())?;
        let is_gone = |end: &PollFd<'_>| end.revents().contains(PollFlags::ERR);
        if descriptors.iter().any(is_gone) {
            return Ok(());
        }
    }
}
