//! MAVLink 2 over UDP on the loopback interface, made and read with the crate `mavlink`.

use std::fs;
use std::io::{self, Read};
use std::net::{Ipv4Addr, UdpSocket};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use ipc_types::payload::HeroTelemetry;
use mavlink::dialects::common::MavMessage;
use mavlink::{MavHeader, MavlinkReader, MavlinkVersion, write_v2_msg};

use super::ends::{Mark, PATIENCE};
use crate::mavlink_message;

/// Where the receiver writes its port number.
fn port_file(site: &Path) -> PathBuf {
    site.join("port")
}

pub struct Sender {
    socket: UdpSocket,
    sequence: u8,
    frame: Vec<u8>,
}

impl Sender {
    pub fn new(site: &Path) -> Result<Sender> {
        let port: u16 = fs::read_to_string(port_file(site))?.parse()?;
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
        socket.connect((Ipv4Addr::LOCALHOST, port))?;
        Ok(Sender {
            socket,
            sequence: 0,
            frame: Vec::with_capacity(512),
        })
    }
}

impl super::ends::Sender for Sender {
    fn send(&mut self, sample: &HeroTelemetry) -> Result<()> {
        self.sequence = self.sequence.wrapping_add(1);
        let header = MavHeader {
            sequence: self.sequence,
            ..MavHeader::default()
        };
        self.frame.clear();
        write_v2_msg(
            &mut self.frame,
            header,
            &mavlink_message::to_message(sample),
        )?;
        self.socket.send(&self.frame)?;
        Ok(())
    }
}

/// A socket as a stream of bytes, which is what the crate reads.
struct Datagrams(UdpSocket);

impl Read for Datagrams {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.0.recv(buffer)
    }
}

pub struct Receiver(MavlinkReader<Datagrams>);

impl Receiver {
    pub fn new(site: &Path) -> Result<Receiver> {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
        socket.set_read_timeout(Some(PATIENCE))?;
        fs::write(port_file(site), socket.local_addr()?.port().to_string())?;
        Ok(Receiver(MavlinkReader::new(Datagrams(socket))))
    }
}

impl super::ends::Receiver for Receiver {
    fn receive(&mut self, take: &mut dyn FnMut(Mark)) -> Result<()> {
        let (_, message) = self.0.read_message::<MavMessage>(MavlinkVersion::V2)?;
        take(mavlink_message::mark(&message).context("another message")?);
        Ok(())
    }
}
