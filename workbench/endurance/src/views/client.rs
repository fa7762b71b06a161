//! [`Viewer`]: a page, or a client of Foxglove with all topics, on a thread of its own, and what it got.

use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use ipc_types::MonotonicNs;
use ipc_types::payload::{HeroTelemetry, SharedStruct};
use ril_tests::process::WAIT_LIMIT;
use rustix::net::{AddressFamily, SocketType, connect, socket, sockopt};
use serde_json::{Value, json};

use crate::outcome::Times;

/// Opcodes of frames.
const TEXT: u8 = 1;
const BINARY: u8 = 2;
const CLOSE: u8 = 8;
const PING: u8 = 9;
const PONG: u8 = 10;

/// What a throttled client reads at once, and how often: 50 kB/s.
const SIP: usize = 1_000;
const SIP_PERIOD: Duration = Duration::from_millis(20);

/// The receive buffer of a throttled client, bytes: what waits in it is as old as it takes to read it, 0.08 s.
const SMALL_BUFFER: usize = 4_096;

/// Who looks.
#[derive(Clone, Debug)]
pub enum Kind {
    /// A page with this token.
    Page(String),
    /// Foxglove, with all topics.
    Foxglove,
    /// The same, which reads 50 kB/s.
    Throttled,
}

/// What a viewer got.
#[derive(Default)]
pub struct Seen {
    /// Bytes of frames.
    pub bytes: u64,
    /// Values of telemetry.
    pub values: u64,
    /// Values that the server left out, as it says.
    pub left_out: u64,
    /// From the moment at which the bridge received the telemetry to that at which it was here.
    pub ages: Times,
    /// Whether the server closed the connection.
    pub is_closed: bool,
}

/// See the module's documentation.
pub struct Viewer {
    thread: JoinHandle<Seen>,
    over: Arc<AtomicBool>,
}

impl Viewer {
    /// Connects, and looks at robot 1.
    ///
    /// # Panics
    ///
    /// When the server does not take it.
    pub fn start(port: u16, kind: &Kind) -> Viewer {
        let over = Arc::new(AtomicBool::new(false));
        let mut client = Client::connect(port, kind);
        let is_over = Arc::clone(&over);
        let thread = thread::spawn(move || {
            let mut seen = Seen::default();
            while !is_over.load(Ordering::Relaxed) {
                let Some((opcode, payload)) = client.next_frame() else {
                    seen.is_closed = true;
                    break;
                };
                seen.bytes += payload.len() as u64;
                match opcode {
                    TEXT => client.text(&payload, &mut seen),
                    BINARY => client.sample(&payload, &mut seen),
                    _ => {}
                }
            }
            seen
        });
        Viewer { thread, over }
    }

    /// What it got so far; it goes.
    pub fn end(self) -> Seen {
        self.over.store(true, Ordering::Relaxed);
        self.thread.join().expect("a viewer that ends")
    }
}

/// A connection with a subprotocol.
pub struct Client {
    stream: TcpStream,
    /// Bytes that came behind the last frame.
    rest: Vec<u8>,
    /// The channel of telemetry, once it is known.
    telemetry: Option<u32>,
    /// When the next sip may be taken; `None` if the client reads all.
    sip: Option<Instant>,
}

impl Client {
    /// Connects as this kind, as soon as the server has room: it may not have seen yet that others went.
    ///
    /// # Panics
    ///
    /// When the server does not take it.
    pub fn connect(port: u16, kind: &Kind) -> Client {
        let begun = Instant::now();
        loop {
            if let Some(client) = Client::try_connect(port, kind) {
                return client;
            }
            assert!(begun.elapsed() < WAIT_LIMIT, "no room at the server");
        }
    }

    /// `None` if the server has too many others.
    fn try_connect(port: u16, kind: &Kind) -> Option<Client> {
        let is_throttled = matches!(kind, Kind::Throttled);
        let stream = open(port, is_throttled).expect("a server");
        stream
            .set_read_timeout(Some(WAIT_LIMIT))
            .expect("a time-out");
        let mut client = Client {
            stream,
            rest: Vec::new(),
            telemetry: None,
            sip: is_throttled.then(Instant::now),
        };
        let protocol = match kind {
            Kind::Page(_) => "hero.view.v1",
            Kind::Foxglove | Kind::Throttled => "foxglove.sdk.v1",
        };
        let head = format!(
            "GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
             Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: {protocol}\r\n\r\n"
        );
        client
            .stream
            .write_all(head.as_bytes())
            .expect("a server that reads");
        while !client.has_head() {
            assert!(client.fill(), "no upgrade to {protocol}");
            if client.rest.starts_with(b"HTTP/1.1 503 ") {
                return None;
            }
        }
        if let Kind::Page(token) = kind {
            client.send(&json!({"type": "open", "token": token, "robot": 1, "rate_hz": 20}));
        }
        Some(client)
    }

    /// Takes the head of the answer, once it is there.
    fn has_head(&mut self) -> bool {
        let end = self.rest.windows(4).position(|four| four == b"\r\n\r\n");
        let Some(end) = end else { return false };
        assert!(
            self.rest.starts_with(b"HTTP/1.1 101 "),
            "{}",
            String::from_utf8_lossy(&self.rest)
        );
        self.rest.drain(..end + 4);
        true
    }

    /// Sends a message.
    pub fn send(&mut self, message: &Value) {
        self.frame(TEXT, message.to_string().as_bytes());
    }

    /// The next message; `None` when the server has closed.
    pub fn next_message(&mut self) -> Option<Value> {
        loop {
            let (opcode, payload) = self.next_frame()?;
            if opcode == TEXT {
                return Some(serde_json::from_slice(&payload).expect("JSON"));
            }
        }
    }

    /// A message of the server, which is answered.
    fn text(&mut self, payload: &[u8], seen: &mut Seen) {
        let message: Value = serde_json::from_slice(payload).expect("JSON");
        if message["type"] == "now" {
            self.send(&json!({"type": "seen", "n": message["n"]}));
            seen.values += 1;
            seen.left_out += message["left_out"].as_u64().unwrap_or_default();
            let ms = |value: &Value| value.as_u64().unwrap_or_default();
            let age_ms = ms(&message["telemetry"]["age_ms"]);
            let on_the_way_ms =
                (MonotonicNs::now().0 / 1_000_000).saturating_sub(ms(&message["sent_ms"]));
            seen.ages
                .push(Duration::from_millis(age_ms + on_the_way_ms));
        }
        for channel in message["channels"].as_array().into_iter().flatten() {
            let id = &channel["id"];
            if channel["topic"] == "/robot1/hero/telemetry" {
                self.telemetry = id.as_u64().and_then(|id| u32::try_from(id).ok());
            }
            self.send(&json!({"op": "subscribe", "subscriptions": [{"id": id, "channelId": id}]}));
        }
    }

    /// A sample of Foxglove: an opcode, the subscription, the time, and the message behind the header of CDR.
    fn sample(&mut self, payload: &[u8], seen: &mut Seen) {
        const HEAD: usize = 1 + 4 + 8 + 4;
        let [1, a, b, c, d, ..] = *payload else {
            return;
        };
        if self.telemetry != Some(u32::from_le_bytes([a, b, c, d])) {
            return;
        }
        if let Some(sample) = payload.get(HEAD..).and_then(HeroTelemetry::from_bytes) {
            seen.values += 1;
            seen.ages.push(MonotonicNs::now().since(sample.received()));
        }
    }

    fn next_frame(&mut self) -> Option<(u8, Vec<u8>)> {
        loop {
            if let Some((opcode, payload)) = take_frame(&mut self.rest) {
                match opcode {
                    CLOSE => return None,
                    PING => self.frame(PONG, &payload),
                    _ => return Some((opcode, payload)),
                }
            } else if !self.fill() {
                return None;
            }
        }
    }

    /// Reads on; says whether the connection goes on.
    fn fill(&mut self) -> bool {
        let mut buffer = [0; 65_536];
        let most = match &mut self.sip {
            None => buffer.len(),
            Some(next) => {
                thread::sleep(next.saturating_duration_since(Instant::now()));
                *next += SIP_PERIOD;
                SIP
            }
        };
        match self.stream.read(&mut buffer[..most]) {
            Ok(count @ 1..) => {
                self.rest.extend_from_slice(&buffer[..count]);
                true
            }
            _ => false,
        }
    }

    /// A frame with the mask 0, which every client must have. A server that has closed reads nothing.
    fn frame(&mut self, opcode: u8, payload: &[u8]) {
        let mut frame = vec![0x80 | opcode];
        match payload.len() {
            length @ ..126 => frame.push(0x80 | length as u8),
            length => {
                let length = u16::try_from(length).expect("a short message");
                frame.push(0x80 | 126);
                frame.extend(length.to_be_bytes());
            }
        }
        frame.extend([0; 4]);
        frame.extend(payload);
        let _ = self.stream.write_all(&frame);
    }
}

/// Connects; `is_small` says whether little fits into the kernel's receive buffer.
fn open(port: u16, is_small: bool) -> io::Result<TcpStream> {
    let socket = socket(AddressFamily::INET, SocketType::STREAM, None)?;
    if is_small {
        sockopt::set_socket_recv_buffer_size(&socket, SMALL_BUFFER)?;
    }
    connect(&socket, &SocketAddr::from(([127, 0, 0, 1], port)))?;
    Ok(TcpStream::from(socket))
}

/// The first frame of the server, if it is whole.
fn take_frame(bytes: &mut Vec<u8>) -> Option<(u8, Vec<u8>)> {
    let (first, second) = (*bytes.first()?, *bytes.get(1)?);
    let (head, length) = match second {
        126 => (
            4,
            usize::from(u16::from_be_bytes(bytes.get(2..4)?.try_into().ok()?)),
        ),
        127 => {
            let length = u64::from_be_bytes(bytes.get(2..10)?.try_into().ok()?);
            (10, usize::try_from(length).ok()?)
        }
        length => (2, usize::from(length)),
    };
    let payload = bytes.get(head..head + length)?.to_vec();
    bytes.drain(..head + length);
    Some((first & 15, payload))
}
