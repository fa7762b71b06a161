//! A gateway whose time a test sets, the samples that it gets, and stations.

use std::cell::Cell;
use std::net::SocketAddr;
use std::time::Duration;

use ipc_types::code::{Functionality, LinkState, ModuleStatus, PilotSwitch, Reason, Stage};
use ipc_types::payload::{HeroTelemetry, ModuleState, RequestReport};
use ipc_types::{MonotonicNs, TelemetryGroup};
use mavlink_gateway::message::{self, COMMAND_LONG, HEARTBEAT, MessageKind};
use mavlink_gateway::wire::{MessageWriter, frames};
use mavlink_gateway::{Gateway, Mission, Order, OrderKind, Settings, Task};

/// A ground station, as an address and a system.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Station {
    pub port: u16,
    pub system: u8,
}

pub const QGC: Station = Station {
    port: 14_550,
    system: 255,
};
pub const SCRIPT: Station = Station {
    port: 40_000,
    system: 245,
};

impl Station {
    pub fn address(self) -> SocketAddr {
        ([127, 0, 0, 1], self.port).into()
    }

    /// The next frame of this test's stations.
    pub fn frame(self, message: &MessageWriter) -> Vec<u8> {
        let sequence = SEQUENCE.get();
        SEQUENCE.set(sequence.wrapping_add(1));
        message.frame(sequence, self.system, 190)
    }
}

thread_local! {
    /// The number of the next frame: one count for all stations, so that some are lost for each.
    static SEQUENCE: Cell<u8> = const { Cell::new(250) };
}

/// A message that was sent to a station.
#[derive(Clone, Debug, PartialEq)]
pub struct Sent {
    pub to: SocketAddr,
    pub kind: MessageKind,
    pub payload: Vec<u8>,
}

impl Sent {
    pub fn bytes<const N: usize>(&self, at: usize) -> [u8; N] {
        std::array::from_fn(|index| self.payload.get(at + index).copied().unwrap_or(0))
    }
}

/// The heartbeat of a ground station.
pub fn heartbeat() -> MessageWriter {
    let message = MessageWriter::new(HEARTBEAT).u32(0).u8(6).u8(8);
    message.u8(0).u8(4).u8(3)
}

/// The id of the request that an order becomes.
pub fn request_of(order: &Order) -> u64 {
    1000 + order.number
}

/// COMMAND_ACK: command, result, reason.
pub type Ack = (u16, u8, u32);

pub struct World {
    pub gateway: Gateway,
    pub now: MonotonicNs,
    pub state: ModuleState,
    pub telemetry: HeroTelemetry,
    /// What lies on the disk.
    pub disk: Option<Mission>,
    /// The areas of a station in the bridge's configuration file.
    pub put: Option<Vec<String>>,
}

/// Where the helicopter is, degrees and m with telemetry's zero.
pub const HERE: (f64, f64, f64) = (37.4112, -6.001, 30.0);

impl World {
    /// A helicopter on the ground, heard, whose module was not started.
    pub fn new(settings: Settings) -> World {
        let mut telemetry = HeroTelemetry {
            valid_groups: 0xffff,
            gps_quality: 4,
            ..HeroTelemetry::default()
        };
        telemetry.geodetic.latitude_rad = HERE.0.to_radians();
        telemetry.geodetic.longitude_rad = HERE.1.to_radians();
        telemetry.geodetic.altitude_m = HERE.2;
        let mut state = ModuleState {
            blocked: 1,
            status: ModuleStatus::WaitingDataToStart.code(),
            functionality: Functionality::AtRest.code(),
            ..ModuleState::default()
        };
        state.link.state = LinkState::Up.code();
        state.safety.pilot_switch = PilotSwitch::Auto.code();
        let mut world = World {
            gateway: Gateway::new(settings, 1),
            now: MonotonicNs(1_000_000_000_000),
            state,
            telemetry,
            disk: None,
            put: None,
        };
        world.tick(0);
        world
    }

    /// A gateway with a ground station, and without what was sent to it.
    pub fn with_station() -> World {
        let mut world = World::new(Settings::default());
        world.heartbeat(QGC);
        world.sent();
        world
    }

    /// A gateway whose helicopter was started and is 20 m above home.
    pub fn flying() -> World {
        World::flying_with(Settings::default())
    }

    /// A gateway with these settings, whose helicopter was started and is 20 m above home.
    pub fn flying_with(settings: Settings) -> World {
        let mut world = World::new(settings);
        world.heartbeat(QGC);
        world.state.blocked = 0;
        world.state.status = ModuleStatus::Running.code();
        world.tick(20);
        world.telemetry.flying = 1;
        world.telemetry.geodetic.altitude_m = HERE.2 + 20.0;
        world.tick(20);
        world.sent();
        world
    }

    /// Time passes, then new samples come.
    pub fn tick(&mut self, ms: u64) {
        self.pass(ms);
        self.telemetry.received_ns = self.now.0;
        self.state.published_ns = self.now.0;
        // As a bridge says it that has seen the helicopter on the ground.
        if self.telemetry.flying == 0 && self.telemetry.valid(TelemetryGroup::Geographic) {
            let place = self.telemetry.geodetic;
            self.state.ground_valid = 1;
            self.state.home_latitude_deg = place.latitude_rad.to_degrees();
            self.state.home_longitude_deg = place.longitude_rad.to_degrees();
            self.state.ground_altitude_m = place.altitude_m;
        }
        self.gateway.state(&self.state, self.now);
        self.gateway.telemetry(&self.telemetry, self.now);
        self.gateway.advance(self.now);
    }

    /// So many samples come, one each 20 ms; what was sent meanwhile.
    pub fn run(&mut self, samples: usize) -> Vec<Sent> {
        let mut sent = Vec::new();
        for _ in 0..samples {
            self.tick(20);
            sent.extend(self.sent());
        }
        sent
    }

    /// Time passes without a sample, in steps of at most 10 ms.
    pub fn pass(&mut self, ms: u64) {
        for _ in 0..ms.div_ceil(10) {
            self.now = self.now + Duration::from_millis(10.min(ms));
            self.gateway.advance(self.now);
        }
    }

    pub fn receive(&mut self, from: Station, bytes: &[u8]) {
        self.receive_late(from, bytes, 0);
    }

    /// A datagram that has waited for so long to be read.
    pub fn receive_late(&mut self, from: Station, bytes: &[u8], age_ms: u64) {
        let came = MonotonicNs(self.now.0 - age_ms * 1_000_000);
        self.gateway.datagram(from.address(), bytes, came, self.now);
        self.gateway.advance(self.now);
    }

    pub fn heartbeat(&mut self, from: Station) {
        self.receive(from, &from.frame(&heartbeat()));
    }

    pub fn command(&mut self, from: Station, command: u16, params: [f32; 7]) {
        self.receive(from, &from.frame(&long(command, params)));
    }

    /// The program around the gateway does what it wants beside orders: the bridge has these rules.
    pub fn serve(&mut self, rules: &str) {
        while let Some(task) = self.gateway.poll_task() {
            match task {
                Task::Rules => {
                    let rules = runtime::config::parse(rules, "bridge.toml").expect("rules");
                    self.gateway.rules(Some(&rules), self.now);
                }
                Task::PutFence(areas) => {
                    // One area of the operator is there.
                    let names = areas.iter().map(|area| area.name.clone()).collect();
                    self.put = Some(names);
                    self.gateway.fence_put(Ok(areas.len() + 1), self.now);
                }
                Task::RestoreFence => {
                    self.put = None;
                    self.gateway.fence_restored(Ok(()), self.now);
                }
                Task::Save(mission) => {
                    self.disk = Some(mission.clone());
                    self.gateway.saved(mission, Ok(()), self.now);
                }
            }
        }
        self.gateway.advance(self.now);
    }

    /// The bridge reports on an order.
    pub fn report(&mut self, order: &Order, stage: Stage, reason: Reason) {
        let report = RequestReport {
            request_id: request_of(order),
            ..RequestReport::new(stage, reason)
        };
        let words = format!("{} {stage} ({reason})", order.kind.name());
        self.gateway.report(order.number, &report, &words, self.now);
        self.gateway.advance(self.now);
    }

    /// What was sent since the last call.
    pub fn sent(&mut self) -> Vec<Sent> {
        let mut sent = Vec::new();
        while let Some(datagram) = self.gateway.poll_datagram() {
            for frame in frames(&datagram.bytes) {
                let frame = frame.expect("a frame");
                assert_eq!((frame.system, frame.component), (1, 1));
                sent.push(Sent {
                    to: datagram.to,
                    kind: frame.kind,
                    payload: frame.payload.0.to_vec(),
                });
            }
        }
        sent
    }

    pub fn orders(&mut self) -> Vec<Order> {
        std::iter::from_fn(|| self.gateway.poll_order()).collect()
    }

    /// What the bridge is asked for.
    pub fn kinds(&mut self) -> Vec<OrderKind> {
        self.orders().iter().map(|order| order.kind).collect()
    }
}

/// A mission or a fence of so many items comes.
pub fn count(count: u16, mission_type: u8) -> MessageWriter {
    let message = MessageWriter::new(message::MISSION_COUNT).u16(count);
    message.u8(1).u8(1).u8(mission_type)
}

pub fn clear(mission_type: u8) -> MessageWriter {
    let message = MessageWriter::new(message::MISSION_CLEAR_ALL);
    message.u8(1).u8(1).u8(mission_type)
}

pub fn request_list(mission_type: u8) -> MessageWriter {
    let message = MessageWriter::new(message::MISSION_REQUEST_LIST);
    message.u8(1).u8(1).u8(mission_type)
}

pub fn request_item(sequence: u16, mission_type: u8) -> MessageWriter {
    let message = MessageWriter::new(message::MISSION_REQUEST_INT).u16(sequence);
    message.u8(1).u8(1).u8(mission_type)
}

pub fn of_kind(sent: &[Sent], kind: MessageKind) -> Vec<&Sent> {
    sent.iter().filter(|one| one.kind == kind).collect()
}

/// MISSION_ACK: the results that were sent.
pub fn results(sent: &[Sent]) -> Vec<u8> {
    let answers = of_kind(sent, message::MISSION_ACK).into_iter();
    answers.map(|ack| ack.bytes::<1>(2)[0]).collect()
}

pub fn long(command: u16, [a, b, c, d, x, y, z]: [f32; 7]) -> MessageWriter {
    let params = [a, b, c, d, x, y, z];
    let message = params
        .iter()
        .fold(MessageWriter::new(COMMAND_LONG), |message, param| {
            message.f32(*param)
        });
    message.u16(command).u8(1).u8(1).u8(0)
}

/// COMMAND_INT of a reposition without speed and heading.
pub fn reposition(frame: u8, x: i32, y: i32, z: f32) -> MessageWriter {
    let message = MessageWriter::new(message::COMMAND_INT)
        .f32(-1.0)
        .f32(0.0)
        .f32(0.0)
        .f32(f32::NAN);
    let message = message.i32(x).i32(y).f32(z);
    message.u16(192).u8(1).u8(1).u8(frame).u8(0).u8(0)
}

/// The acknowledgements among what was sent.
pub fn acks(sent: &[Sent]) -> Vec<Ack> {
    let acks = sent.iter().filter(|one| one.kind == message::COMMAND_ACK);
    acks.map(|ack| {
        let command = u16::from_le_bytes(ack.bytes(0));
        (
            command,
            ack.bytes::<1>(2)[0],
            u32::from_le_bytes(ack.bytes(4)),
        )
    })
    .collect()
}

/// The texts among what was sent, whole.
pub fn texts(sent: &[Sent]) -> Vec<(u8, String)> {
    let mut texts: Vec<(u8, String)> = Vec::new();
    for one in sent.iter().filter(|one| one.kind == message::STATUSTEXT) {
        let text: Vec<u8> = one
            .bytes::<50>(1)
            .into_iter()
            .filter(|byte| *byte != 0)
            .collect();
        let text = String::from_utf8(text).expect("ASCII");
        match (one.bytes::<1>(53)[0], texts.last_mut()) {
            (1.., Some((_, whole))) => whole.push_str(&text),
            _ => texts.push((one.bytes::<1>(0)[0], text)),
        }
    }
    texts
}
