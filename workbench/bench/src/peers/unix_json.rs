//! A Unix datagram socket that carries JSON, made and read with `serde_json`.

use std::os::unix::net::UnixDatagram;
use std::path::Path;

use anyhow::Result;
use ipc_types::payload::HeroTelemetry;
use serde::Deserialize;

use super::ends::Mark;
use super::unix_socket;

/// Room for a sample as text, which has about 1,300 bytes.
const MAX_LEN: usize = 4096;

pub struct Sender {
    socket: UnixDatagram,
    text: Vec<u8>,
}

impl Sender {
    pub fn new(site: &Path) -> Result<Sender> {
        Ok(Sender {
            socket: unix_socket::connect(site)?,
            text: Vec::with_capacity(MAX_LEN),
        })
    }
}

impl super::ends::Sender for Sender {
    fn send(&mut self, sample: &HeroTelemetry) -> Result<()> {
        self.text.clear();
        serde_json::to_writer(&mut self.text, sample)?;
        self.socket.send(&self.text)?;
        Ok(())
    }
}

/// What a consumer of position and attitude reads of the text; the parser skips the rest.
#[derive(Deserialize)]
struct Seen {
    source_sequence: u64,
    published_ns: u64,
    geodetic: Geodetic,
    attitude: Attitude,
}

#[derive(Deserialize)]
struct Geodetic {
    latitude_rad: f64,
    longitude_rad: f64,
    altitude_m: f64,
}

#[derive(Deserialize)]
struct Attitude {
    roll_rad: f32,
    pitch_rad: f32,
    yaw_rad: f32,
}

pub struct Receiver {
    socket: UnixDatagram,
    text: [u8; MAX_LEN],
}

impl Receiver {
    pub fn new(site: &Path) -> Result<Receiver> {
        Ok(Receiver {
            socket: unix_socket::bind(site)?,
            text: [0; MAX_LEN],
        })
    }
}

impl super::ends::Receiver for Receiver {
    fn receive(&mut self, take: &mut dyn FnMut(Mark)) -> Result<()> {
        let count = self.socket.recv(&mut self.text)?;
        let seen: Seen = serde_json::from_slice(&self.text[..count])?;
        let Geodetic {
            latitude_rad,
            longitude_rad,
            altitude_m,
        } = seen.geodetic;
        let Attitude {
            roll_rad,
            pitch_rad,
            yaw_rad,
        } = seen.attitude;
        // Nothing of it may be optimized away.
        std::hint::black_box((latitude_rad, longitude_rad, altitude_m));
        std::hint::black_box((roll_rad, pitch_rad, yaw_rad));
        take(Mark {
            index: seen.source_sequence,
            sent_ns: seen.published_ns,
        });
        Ok(())
    }
}
