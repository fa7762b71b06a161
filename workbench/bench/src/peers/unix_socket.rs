//! A Unix datagram socket that carries the struct as it lies in memory.

use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};

use anyhow::{Result, ensure};
use ipc_types::payload::HeroTelemetry;

use super::ends::{Mark, PATIENCE};
use crate::plain;

/// Where the receiver is found.
pub fn address(site: &Path) -> PathBuf {
    site.join("socket")
}

/// The receiving socket, bound.
pub fn bind(site: &Path) -> Result<UnixDatagram> {
    let socket = UnixDatagram::bind(address(site))?;
    socket.set_read_timeout(Some(PATIENCE))?;
    Ok(socket)
}

/// The sending socket, connected.
pub fn connect(site: &Path) -> Result<UnixDatagram> {
    let socket = UnixDatagram::unbound()?;
    socket.connect(address(site))?;
    Ok(socket)
}

pub struct Sender(UnixDatagram);

impl Sender {
    pub fn new(site: &Path) -> Result<Sender> {
        Ok(Sender(connect(site)?))
    }
}

impl super::ends::Sender for Sender {
    fn send(&mut self, sample: &HeroTelemetry) -> Result<()> {
        self.0.send(&plain::to_bytes(sample))?;
        Ok(())
    }
}

pub struct Receiver(UnixDatagram);

impl Receiver {
    pub fn new(site: &Path) -> Result<Receiver> {
        Ok(Receiver(bind(site)?))
    }
}

impl super::ends::Receiver for Receiver {
    fn receive(&mut self, take: &mut dyn FnMut(Mark)) -> Result<()> {
        let mut bytes = [0; plain::LEN];
        let count = self.0.recv(&mut bytes)?;
        ensure!(count == plain::LEN, "a datagram of {count} bytes");
        take(Mark::of(&plain::from_bytes(bytes)));
        Ok(())
    }
}
