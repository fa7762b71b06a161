//! [`Tunnel`]: carries packets between two network namespaces through [`Air`], on a thread of its own.
//!
//! Each namespace has a network interface whose other end is this program. Everything ends with the program, even when it is
//! killed: the interfaces are not persistent, and the namespaces are those of child processes that end with it.

use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::AsFd;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::thread;

use ipc_types::MonotonicNs;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::ioctl::{Opcode, Setter, ioctl};
use rustix::thread::{LinkNameSpaceType, move_into_link_name_space};

use super::air::{Air, Weather};

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

/// The air between two namespaces.
#[derive(Clone)]
pub struct Tunnel {
    weather: Arc<Mutex<Weather>>,
}

impl Tunnel {
    /// Makes the interface in both namespaces, and begins to carry packets.
    pub fn between(namespaces: [&Path; 2], seed: u64) -> std::io::Result<Tunnel> {
        let ends = namespaces.map(open_in);
        let [first, second] = ends;
        let ends = [first?, second?];
        let weather = Arc::new(Mutex::new(Weather::default()));
        let tunnel = Tunnel {
            weather: Arc::clone(&weather),
        };
        thread::spawn(move || {
            if let Err(error) = carry(ends, &weather, seed) {
                eprintln!("the air has ended: {error}");
            }
        });
        Ok(tunnel)
    }

    /// Changes the weather for all packets that come from now on.
    pub fn set(&self, weather: Weather) {
        *self.weather.lock().expect("no panic while it is held") = weather;
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

fn carry(mut ends: [File; 2], weather: &Mutex<Weather>, seed: u64) -> std::io::Result<()> {
    let mut air = Air::new(seed);
    let mut packet = [0; PACKET];
    loop {
        for (from, end) in ends.iter_mut().enumerate() {
            while let Ok(length) = end.read(&mut packet) {
                let present = *weather.lock().expect("no panic while it is held");
                air.send(1 - from, &packet[..length], &present, MonotonicNs::now());
            }
        }
        while let Some((to, bytes)) = air.arrived(MonotonicNs::now()) {
            // An interface that is down, or full, loses it.
            let _ = ends[to].write(&bytes);
        }
        let timeout = air.deadline().map(|deadline| {
            let left = deadline.since(MonotonicNs::now());
            Timespec {
                tv_sec: left.as_secs().cast_signed(),
                tv_nsec: left.subsec_nanos().into(),
            }
        });
        let [first, second] = &ends;
        let mut descriptors = [first, second].map(|end| PollFd::new(end, PollFlags::IN));
        poll(&mut descriptors, timeout.as_ref())?;
        let is_gone = |end: &PollFd<'_>| end.revents().contains(PollFlags::ERR);
        if descriptors.iter().any(is_gone) {
            return Ok(());
        }
    }
}
