//! [`Tunnel`]: carries packets between two network namespaces, at the rate and with the delay of a [`Weather`], and loses some by a seed,
//! on a thread of its own.
//!
//! Each namespace has a network interface whose other end is this program. Everything ends with the program, even when it is
//! killed: the interfaces are not persistent, and the namespaces are those of child processes that end with it.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::AsFd;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Instant;

use dsp_sim::random::Random;
use ril_tests::air::{Way, Weather};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::ioctl::{Opcode, Setter, ioctl};
use rustix::thread::{LinkNameSpaceType, move_into_link_name_space};

/// Name of the interface in each namespace.
pub const INTERFACE: &str = "air";

/// Longest packet, bytes; the interface's is 1500.
const PACKET: usize = 2048;

/// Attaches a descriptor of `/dev/net/tun` to an interface.
const TUNSETIFF: Opcode = 0x4004_54ca;
/// Packets of IP, without anything in front of them.
const IFF_TUN_NO_PI: i16 = 0x1001;

/// `struct ifreq`, of which the kernel reads name and flags.
#[repr(C)]
struct InterfaceRequest {
    name: [u8; 16],
    flags: i16,
    rest: [u8; 22],
}

/// What is between two namespaces.
#[derive(Clone)]
pub struct Tunnel {
    /// Share of the packets that is lost, 0 … 1, each by itself.
    loss: Arc<Mutex<f64>>,
}

impl Tunnel {
    /// Makes the interface in both namespaces, and begins to carry packets.
    pub fn between(namespaces: [&Path; 2], weather: Weather, seed: u64) -> std::io::Result<Tunnel> {
        let ends = namespaces.map(open_in);
        let [first, second] = ends;
        let ends = [first?, second?];
        let loss = Arc::new(Mutex::new(0.0));
        let tunnel = Tunnel {
            loss: Arc::clone(&loss),
        };
        thread::spawn(move || {
            if let Err(error) = carry(ends, weather, &loss, seed) {
                eprintln!("the tunnel has ended: {error}");
            }
        });
        Ok(tunnel)
    }

    /// Loses this share of the packets from now on: 0 … 1, where 1 is an outage.
    pub fn lose(&self, share: f64) {
        *self.loss.lock().expect("no panic while it is held") = share;
    }
}

/// Makes the interface within the namespace, by a thread that goes there.
fn open_in(namespace: &Path) -> std::io::Result<File> {
    let namespace = File::open(namespace)?;
    let thread = thread::spawn(move || -> std::io::Result<File> {
        move_into_link_name_space(namespace.as_fd(), Some(LinkNameSpaceType::Network))?;
        let tun = File::options()
            .read(true)
            .write(true)
            .open("/dev/net/tun")?;
        attach(&tun)?;
        fcntl_setfl(&tun, fcntl_getfl(&tun)? | OFlags::NONBLOCK)?;
        Ok(tun)
    });
    thread.join().expect("the thread does not panic")
}

#[allow(unsafe_code)]
fn attach(tun: &File) -> std::io::Result<()> {
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

fn carry(
    mut ends: [File; 2],
    weather: Weather,
    loss: &Mutex<f64>,
    seed: u64,
) -> std::io::Result<()> {
    let mut chance = Random::new(seed, 0);
    let mut ways = [Way::new(weather); 2];
    // What is under way from each end: when it arrives, and what it is.
    let mut passing = [(); 2].map(|()| VecDeque::<(Instant, Vec<u8>)>::new());
    let mut packet = [0; PACKET];
    loop {
        for (from, to) in [(0, 1), (1, 0)] {
            while let Ok(length) = ends[from].read(&mut packet) {
                let now = Instant::now();
                let is_lost = chance.uniform() < *loss.lock().expect("no panic while it is held");
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
