//! [`World`]: a server whose clock stands until a test moves it, and clients of it, written by hand so that they can do
//! what none may.

use std::net::SocketAddr;
use std::time::Duration;

use ipc_types::MonotonicNs;
use serde_json::{Value, json};
use view::page::{Age, Freshness, Now, ReplayInfo, Role};
use view::{ConnectionId, Event, Instance, Peer, Server, Settings, Token};

/// A token that allows to order, and one that allows to look.
pub const SECRET: &str = "0123456789abcdef0123456789abcdef";
pub const WATCH: &str = "fedcba9876543210fedcba9876543210";

/// Opcodes of frames.
pub const TEXT: u8 = 1;
pub const BINARY: u8 = 2;
pub const CLOSE: u8 = 8;
pub const PING: u8 = 9;

/// A frame of the server: its opcode and its payload.
pub type Frame = (u8, Vec<u8>);

/// One connection.
pub struct Client {
    pub id: ConnectionId,
    /// What has come and was not read.
    bytes: Vec<u8>,
}

/// A server whose clock stands until a test moves it, and its clients.
pub struct World {
    pub server: Server,
    pub now: MonotonicNs,
}

/// What tests of orders want.
pub fn settings() -> Settings {
    let token = |name: &str, role, secret: &str| Token {
        name: name.into(),
        role,
        secret: secret.into(),
        is_local: false,
    };
    Settings {
        origins: vec!["https://studio.example".into()],
        tokens: vec![
            token("page", Role::Command, SECRET),
            token("phone", Role::Watch, WATCH),
        ],
        ..Settings::default()
    }
}

/// A recording.
pub fn replay() -> ReplayInfo {
    ReplayInfo {
        file: "a.mcap".into(),
        duration_s: 10.0,
        start_unix_ms: None,
        phases: vec![],
        events: vec![],
    }
}

pub fn peer(address: &str, is_own_user: bool) -> Peer {
    Peer {
        address: address.parse::<SocketAddr>().unwrap(),
        at: [127, 0, 0, 1].into(),
        is_own_user,
        is_encrypted: false,
    }
}

/// A program of the own user.
pub fn own() -> Peer {
    peer("127.0.0.1:50000", true)
}

/// A frame of a client, with the mask 0.
pub fn frame(first: u8, payload: &[u8]) -> Vec<u8> {
    let mut frame = vec![first];
    match payload.len() {
        length @ ..126 => frame.push(0x80 | length as u8),
        length => {
            frame.push(0x80 | 126);
            frame.extend(u16::try_from(length).unwrap().to_be_bytes());
        }
    }
    frame.extend([0; 4]);
    frame.extend(payload);
    frame
}

pub fn text(message: &Value) -> Vec<u8> {
    frame(0x80 | TEXT, message.to_string().as_bytes())
}

/// A request for a WebSocket.
pub fn upgrade(path: &str, protocols: &str, lines: &str) -> Vec<u8> {
    format!(
        "GET {path} HTTP/1.1\r\nHost: localhost:8765\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
         Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\
         Sec-WebSocket-Protocol: {protocols}\r\n{lines}\r\n"
    )
    .into_bytes()
}

pub fn open(token: Option<&str>, robot: Option<u32>) -> Value {
    json!({"type": "open", "token": token, "robot": robot, "rate_hz": 20})
}

pub fn order(number: &str, kind: &str, seen: u64) -> Value {
    json!({"type": "order", "order": number, "robot": 1, "kind": kind, "seen": seen, "position": null, "altitude_m": null, "confirm": null})
}

impl World {
    pub fn new(settings: Settings) -> World {
        let mut server = Server::new(settings, Instance("life".into()));
        server.set_robots(vec![1, 2]);
        let now = MonotonicNs(1_000_000_000_000);
        World { server, now }
    }

    /// Lets time pass.
    pub fn pass(&mut self, duration: Duration) {
        self.now = self.now + duration;
        self.server.advance(self.now);
    }

    pub fn pass_ms(&mut self, ms: u64) {
        self.pass(Duration::from_millis(ms));
    }

    pub fn connect(&mut self, peer: Peer) -> Client {
        let id = self.server.accept(peer, self.now).expect("room");
        Client { id, bytes: vec![] }
    }

    pub fn send(&mut self, client: &Client, bytes: &[u8]) {
        self.server.receive(client.id, bytes, self.now);
    }

    pub fn say(&mut self, client: &Client, message: &Value) {
        self.send(client, &text(message));
    }

    /// Writes at most `most` bytes of what waits.
    pub fn write(&mut self, client: &mut Client, mut most: usize) -> usize {
        let mut all = 0;
        loop {
            let output = self.server.output(client.id);
            let count = output.len().min(most);
            if count == 0 {
                return all;
            }
            client.bytes.extend_from_slice(&output[..count]);
            self.server.sent(client.id, count, self.now);
            most -= count;
            all += count;
        }
    }

    /// All that was answered to a request, as text.
    pub fn answer(&mut self, client: &mut Client) -> String {
        self.write(client, usize::MAX);
        String::from_utf8_lossy(&std::mem::take(&mut client.bytes)).into_owned()
    }

    /// All whole frames that have come.
    pub fn frames(&mut self, client: &mut Client) -> Vec<Frame> {
        self.write(client, usize::MAX);
        client.take_frames()
    }

    /// All messages that have come, of pages or JSON of Foxglove.
    pub fn messages(&mut self, client: &mut Client) -> Vec<Value> {
        let texts = self
            .frames(client)
            .into_iter()
            .filter(|(opcode, _)| *opcode == TEXT);
        texts
            .map(|(_, payload)| serde_json::from_slice(&payload).unwrap())
            .collect()
    }

    /// The messages of this type that have come.
    pub fn of_type(&mut self, client: &mut Client, kind: &str) -> Vec<Value> {
        let mut messages = self.messages(client);
        messages.retain(|message| message["type"] == kind);
        messages
    }

    /// The code with which the server has closed; `None` if it has not.
    pub fn close_code(&mut self, client: &mut Client) -> Option<u16> {
        let frames = self.frames(client);
        let (_, payload) = frames.into_iter().find(|(opcode, _)| *opcode == CLOSE)?;
        assert!(self.server.is_ended(client.id));
        Some(u16::from_be_bytes([payload[0], payload[1]]))
    }

    /// A client that speaks one of these subprotocols.
    pub fn viewer(&mut self, peer: Peer, path: &str, protocols: &str) -> Client {
        let mut client = self.connect(peer);
        self.send(&client, &upgrade(path, protocols, ""));
        let answer = self.upgraded(&mut client);
        assert!(answer.starts_with("HTTP/1.1 101 "), "{answer}");
        client
    }

    /// The head of the answer to an upgrade.
    pub fn upgraded(&mut self, client: &mut Client) -> String {
        self.write(client, usize::MAX);
        let end = client
            .bytes
            .windows(4)
            .position(|four| four == b"\r\n\r\n")
            .expect("a head");
        let head = client.bytes.drain(..end + 4).collect();
        String::from_utf8(head).unwrap()
    }

    /// A page that has opened.
    pub fn page(&mut self, token: Option<&str>, robot: u32) -> Client {
        let client = self.viewer(own(), "/", "hero.view.v1");
        self.say(&client, &open(token, Some(robot)));
        client
    }

    pub fn events(&mut self) -> Vec<Event> {
        std::iter::from_fn(|| self.server.poll_event()).collect()
    }

    /// The kinds of orders that were let through.
    pub fn orders(&mut self) -> Vec<String> {
        let events = self.events().into_iter();
        let orders = events.filter_map(|event| match event {
            Event::Order { order, .. } => Some(order.order),
            _ => None,
        });
        orders.collect()
    }

    /// Says values of `robot` with this number.
    pub fn say_now(&mut self, robot: u32, n: u64) {
        let now = values(robot, n, self.now);
        self.server.now(&now, self.now);
    }
}

impl Client {
    fn take_frames(&mut self) -> Vec<Frame> {
        let mut frames = Vec::new();
        while self.bytes.len() >= 2 {
            let (length, head) = match self.bytes[1] {
                126 if self.bytes.len() >= 4 => (
                    usize::from(u16::from_be_bytes([self.bytes[2], self.bytes[3]])),
                    4,
                ),
                127 if self.bytes.len() >= 10 => {
                    let length: [u8; 8] = self.bytes[2..10].try_into().unwrap();
                    (u64::from_be_bytes(length) as usize, 10)
                }
                length @ ..126 => (usize::from(length), 2),
                _ => break,
            };
            if self.bytes.len() < head + length {
                break;
            }
            let opcode = self.bytes[0] & 15;
            let payload = self.bytes[head..head + length].to_vec();
            self.bytes.drain(..head + length);
            frames.push((opcode, payload));
        }
        frames
    }
}

pub fn values(robot: u32, n: u64, now: MonotonicNs) -> Now {
    let age = Age {
        freshness: Freshness::Fresh,
        age_ms: Some(20),
    };
    Now {
        robot,
        n,
        sent_ms: now.0 / 1_000_000,
        telemetry: age.clone(),
        bridge: age,
        position: Some([48.1, 11.5]),
        lost_position: None,
        lost_position_age_ms: None,
        altitude_m: Some(500.0),
        height_m: None,
        attitude: None,
        ground_speed_mps: Some(f64::NAN),
        climb_mps: None,
        course_deg: None,
        battery_v: None,
        fuel_percent: None,
        fix: None,
        flying: None,
        left_out: 0,
    }
}
