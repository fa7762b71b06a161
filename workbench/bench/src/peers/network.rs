//! The ways that are made for a network: MAVLink 2 over UDP with the crate `mavlink`, and Zenoh.

use std::io::{self, Read};
use std::net::{Ipv4Addr, UdpSocket};
use std::{env, fs};

use anyhow::{Context, Result, anyhow};
use ipc_types::payload::{HeroTelemetry, SharedStruct};
use mavlink::dialects::common::{MavFrame, MavMessage, ODOMETRY_DATA};
use mavlink::{MavHeader, MavlinkReader, MavlinkVersion, write_v2_msg};
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Reliability};
use zenoh::{Config, Session, Wait};

use super::ends::{Mark, Receive, SOCKET, Send, TIMEOUT};

/// The element of the covariance that carries the bits of the index.
const INDEX: usize = 20;

/// The file in which the receiver writes its port number.
const PORT_FILE: &str = "port";

/// `sample` as the message that says the most of it: `ODOMETRY`, 230 bytes of payload, which is pose, velocity, rates
/// and their covariances.
pub fn odometry(sample: &HeroTelemetry) -> MavMessage {
    let mark = Mark::of(sample);
    let mut pose_covariance = [1e-3; 21];
    pose_covariance[INDEX] = f32::from_bits(mark.index as u32);
    let (attitude, rate) = (&sample.attitude, &sample.angular_rate);
    MavMessage::ODOMETRY(ODOMETRY_DATA {
        // Nanoseconds, because only this program reads it.
        time_usec: mark.sent_ns,
        x: sample.local.north_m as f32,
        y: sample.local.east_m as f32,
        z: -sample.geodetic.altitude_m as f32,
        q: [1.0, attitude.roll_rad, attitude.pitch_rad, attitude.yaw_rad],
        vx: sample.velocity.north_mps,
        vy: sample.velocity.east_mps,
        vz: -sample.velocity.up_mps,
        rollspeed: rate.forward_radps,
        pitchspeed: rate.right_radps,
        yawspeed: rate.down_radps,
        pose_covariance,
        velocity_covariance: [1e-3; 21],
        frame_id: MavFrame::MAV_FRAME_LOCAL_NED,
        child_frame_id: MavFrame::MAV_FRAME_BODY_FRD,
    })
}

pub fn mavlink_sender() -> Result<Send> {
    let port: u16 = fs::read_to_string(PORT_FILE)?.parse()?;
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
    socket.connect((Ipv4Addr::LOCALHOST, port))?;
    let mut header = MavHeader::default();
    let mut frame = Vec::with_capacity(512);
    Ok(Box::new(move |sample| {
        header.sequence = header.sequence.wrapping_add(1);
        frame.clear();
        write_v2_msg(&mut frame, header, &odometry(sample))?;
        socket.send(&frame)?;
        Ok(())
    }))
}

/// A socket as a stream of bytes, which is what the crate reads.
struct Datagrams(UdpSocket);

impl Read for Datagrams {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.0.recv(buffer)
    }
}

pub fn mavlink_receiver() -> Result<Receive> {
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
    socket.set_read_timeout(Some(TIMEOUT))?;
    fs::write(PORT_FILE, socket.local_addr()?.port().to_string())?;
    let mut reader = MavlinkReader::new(Datagrams(socket));
    Ok(Box::new(move |take| {
        let (_, message) = reader.read_message::<MavMessage>(MavlinkVersion::V2)?;
        let MavMessage::ODOMETRY(odometry) = message else {
            return Err(anyhow!("another message"));
        };
        take(Mark {
            index: odometry.pose_covariance[INDEX].to_bits().into(),
            sent_ns: odometry.time_usec,
        });
        Ok(())
    }))
}

/// A session of Zenoh that listens (`listen`) or connects (`connect`) at `endpoint`; no discovery.
pub fn zenoh_session(endpoint: &str, role: &str) -> Result<Session> {
    let mut config = Config::default();
    for (key, value) in [
        ("mode", "\"peer\""),
        ("scouting/multicast/enabled", "false"),
        ("listen/endpoints", "[]"),
        (
            &format!("{role}/endpoints") as &str,
            &format!("[\"{endpoint}\"]") as &str,
        ),
    ] {
        config
            .insert_json5(key, value)
            .map_err(anyhow::Error::msg)?;
    }
    zenoh::open(config).wait().map_err(|error| anyhow!(error))
}

/// A publisher of Zenoh; no batching, and a sample that has no room is dropped.
pub fn zenoh_publisher(session: &Session, key: &'static str) -> Result<Publisher<'static>> {
    session
        .declare_publisher(key)
        .congestion_control(CongestionControl::Drop)
        .reliability(Reliability::BestEffort)
        .express(true)
        .wait()
        .map_err(|error| anyhow!(error))
}

/// Publishes the bytes of a sample.
pub fn zenoh_put(publisher: &Publisher<'_>, sample: &impl SharedStruct) -> Result<()> {
    let sent = publisher.put(sample.bytes().to_vec()).wait();
    sent.map_err(|error| anyhow!(error))
}

/// Receives the samples of telemetry under `keys` that end with `key`, from a channel, as Zenoh gives them by default.
pub fn zenoh_subscriber(session: Session, keys: &str, key: &'static str) -> Result<Receive> {
    let subscriber = session
        .declare_subscriber(keys.to_owned())
        .wait()
        .map_err(|error| anyhow!(error))?;
    Ok(Box::new(move |take| {
        let _alive = &session;
        let sample = subscriber
            .recv_timeout(TIMEOUT)
            .map_err(|error| anyhow!(error))?
            .context("no sample came")?;
        if sample.key_expr().as_str() == key {
            let bytes = sample.payload().to_bytes();
            let sample = HeroTelemetry::from_bytes(&bytes).context("another message")?;
            take(Mark::of(&sample));
        }
        Ok(())
    }))
}

const KEY: &str = "hero/telemetry";

fn unix_endpoint() -> Result<String> {
    let socket = env::current_dir()?.join(SOCKET);
    Ok(format!("unixsock-stream/{}", socket.display()))
}

pub fn zenoh_sender() -> Result<Send> {
    let session = zenoh_session(&unix_endpoint()?, "connect")?;
    let publisher = zenoh_publisher(&session, KEY)?;
    Ok(Box::new(move |sample| {
        let _alive = &session;
        zenoh_put(&publisher, sample)
    }))
}

pub fn zenoh_receiver() -> Result<Receive> {
    zenoh_subscriber(zenoh_session(&unix_endpoint()?, "listen")?, KEY, KEY)
}
