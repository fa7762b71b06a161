//! What viewers cost `ril run view`, how old what they get is, and what a slow or hostile one does to the others and to
//! the robot.

use std::fs;
use std::io::{self, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use fastrand::Rng;
use ipc_types::payload::{HeroTelemetry, SharedStruct};
use ipc_types::{MonotonicNs, RobotId};
use ril_tests::Process;
use ril_tests::process::WAIT_LIMIT;
use ril_tests::sandbox::free_port;
use rustix::net::{AddressFamily, SocketType, connect, socket, sockopt};
use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::http::{HeaderValue, StatusCode};
use tungstenite::{Error, HandshakeError, Message, WebSocket};

use crate::hostile::Hostile;
use crate::listener::Listener;
use crate::site::{Site, count_lines, memory_mb, usage_of};
use measure::{Outcome, Times};

/// What a throttled client reads at once, and how often: 50 kB/s.
const SIP: usize = 1_000;
const SIP_PERIOD: Duration = Duration::from_millis(20);

/// The receive buffer of a throttled client, bytes: what waits in it is as old as it takes to read it, 0.08 s.
const SMALL_BUFFER: usize = 4_096;

/// Who looks.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// A page.
    Page,
    /// Foxglove, with all topics.
    Foxglove,
    /// Foxglove, with all topics, which reads 50 kB/s.
    Throttled,
}

/// Who looks at the robot at once: so many pages and one other, and whether the server is attacked meanwhile.
type Case = (&'static str, usize, Option<Kind>, bool);

const CASES: [Case; 7] = [
    ("no viewer", 0, None, false),
    ("1 page", 1, None, false),
    ("20 pages", 20, None, false),
    ("Foxglove, all topics", 0, Some(Kind::Foxglove), false),
    ("Foxglove at 50 kB/s", 0, Some(Kind::Throttled), false),
    (
        "20 pages, Foxglove at 50 kB/s",
        20,
        Some(Kind::Throttled),
        false,
    ),
    ("20 pages, attacked", 20, None, true),
];

/// The cases of the peer that is measured beside the view.
const PEER_CASES: [Case; 3] = [
    ("crate foxglove: none", 0, None, false),
    ("crate foxglove: all topics", 0, Some(Kind::Foxglove), false),
    (
        "crate foxglove: at 50 kB/s",
        0,
        Some(Kind::Throttled),
        false,
    ),
];

/// Each case, one after the other, of the same server.
pub fn run(site: &Site) {
    let mut chain = site.start_chain(1);
    site.ask("start");
    let port = free_port();
    let mut command = site.command(["run", "view", "--port", &port.to_string()]);
    command.env("XDG_RUNTIME_DIR", site.folder());
    let mut process = site.spawn(command);
    process.wait_for_text("ready");
    let file = site.path(&format!("ril/view-{port}.json"));
    let text = fs::read_to_string(file).expect("the file of the running view");
    let running: Value = serde_json::from_str(&text).expect("JSON");
    let token = running["token"].as_str().expect("a token").to_owned();
    let view = View {
        process,
        port,
        token,
    };
    let measure_all = |view: &View, cases: &[Case], bridge: &mut Process| {
        for case in cases {
            if site.goes_on() {
                site.show(measure(site, view, bridge, *case));
            }
        }
    };
    measure_all(&view, &CASES, &mut chain[1]);
    view.process.end();
    let beside = site.plan.beside.as_deref();
    if let Some(program) = beside.filter(|_| site.goes_on()) {
        let peer = View::start_peer(site, program);
        measure_all(&peer, &PEER_CASES, &mut chain[1]);
        // It handles no signals; what it leaves in shared memory is swept.
        site.kill(peer.process);
    }
    site.end(chain, beside.is_some());
}

/// The server that is measured: a view, or the peer that is measured beside it.
struct View {
    process: Process,
    port: u16,
    /// Of a view: with it a page may order.
    token: String,
}

impl View {
    /// Starts the program that is compared with the view.
    fn start_peer(site: &Site, program: &Path) -> View {
        let port = free_port();
        let mut command = Command::new(program);
        command.arg(port.to_string());
        let mut process = site.spawn(command);
        process.wait_for_text("ready");
        View {
            process,
            port,
            token: String::new(),
        }
    }
}

fn measure(site: &Site, view: &View, bridge: &mut Process, case: Case) -> Outcome {
    let (name, pages, other, is_attacked) = case;
    let kinds = [Kind::Page].into_iter().cycle().take(pages).chain(other);
    let viewers: Vec<Viewer> = kinds.map(|kind| Viewer::start(view, kind)).collect();
    let lands_before = count_lines(bridge, "command=\"land\"");
    let attack = is_attacked.then(|| attack(site, view.port));
    let telemetry = Listener::start(&site.domain, RobotId::DEFAULT, HeroTelemetry::received);
    let (before, begun) = (usage_of(&view.process), Instant::now());
    let first_report = is_attacked.then(|| land(view));
    let status = telemetry.until(MonotonicNs::now() + site.plan.duration(60));
    let seconds = begun.elapsed().as_secs_f64();
    let cpu = usage_of(&view.process).since(&before).all_percent;
    let memory_mb = memory_mb(&view.process);
    let attack = attack.map(|(silent, hostile)| (silent.len(), hostile.end()));
    telemetry.end();
    let seen: Vec<Seen> = viewers.into_iter().map(Viewer::end).collect();

    let mut outcome = Outcome::default();
    outcome.cell("viewers", name);
    outcome.cell("processor", format!("{cpu:.2} %"));
    outcome.cell("memory", format!("{memory_mb:.1} MB"));
    report_seen(&mut outcome, &seen, seconds);
    let ages = status.iter().map(|heard| heard.at.since(heard.kept));
    outcome.cell(
        "received by the bridge to a consumer of status",
        ages.collect::<Times>(),
    );
    let Some((connections, sent)) = attack else {
        outcome.cell("attack", "–");
        return outcome;
    };
    let report = first_report.flatten();
    let lands = count_lines(bridge, "command=\"land\"") - lands_before;
    outcome.cell(
        "attack",
        format!(
            "{connections} connections, {:.0} heads and frames a second, `land` answered after {} ms",
            sent as f64 / seconds,
            report.map_or_else(|| "–".to_owned(), |time| time.as_millis().to_string()),
        ),
    );
    outcome.require(
        lands == 1,
        format!("the bridge got {lands} requests to land"),
    );
    outcome.require(report.is_some(), "the order to land was not answered");
    outcome
}

/// What viewers got: all of them stay to the end, and each gets values.
fn report_seen(outcome: &mut Outcome, seen: &[Seen], seconds: f64) {
    let closed = seen.iter().filter(|one| one.is_closed).count();
    let empty = seen.iter().filter(|one| one.ages.count() == 0).count();
    outcome.require(closed == 0, format!("{closed} viewers were closed"));
    outcome.require(empty == 0, format!("{empty} viewers got no value"));
    let rate = |one: &Seen| format!("{:.1}", one.bytes as f64 / seconds / 1e3);
    let rates: Vec<String> = match seen {
        [] => vec!["–".to_owned()],
        [one] => vec![rate(one)],
        [first, .., last] => vec![rate(first), rate(last)],
    };
    outcome.cell("kB/s to the first and the last", rates.join(", "));
    outcome.cell(
        "values",
        seen.iter().map(|one| one.ages.count()).sum::<usize>(),
    );
    outcome.cell("left out", seen.iter().map(|one| one.left_out).sum::<u64>());
    let ages = |seen: &[Seen]| {
        seen.iter()
            .flat_map(|one| &one.ages.0)
            .copied()
            .collect::<Times>()
    };
    let (crowd, last) = seen.split_at(seen.len().saturating_sub(1));
    outcome.cell("age at the last viewer", ages(last));
    outcome.cell("at the others", ages(crowd));
}

/// Orders to land as a pilot at a page would; says after what time the first report was there.
fn land(view: &View) -> Option<Duration> {
    let mut page = Client::connect(view, Kind::Page);
    while page.next_text()?["type"] != "robot" {}
    let begun = Instant::now();
    page.send(&json!({"type": "order", "order": "l1", "robot": 1, "kind": "land", "seen": 0, "position": null,
        "altitude_m": null, "confirm": null}));
    loop {
        let message = page.next_text()?;
        if message["type"] == "order" && message["order"] == "l1" {
            return Some(begun.elapsed());
        }
    }
}

/// What a viewer got.
#[derive(Default)]
struct Seen {
    /// Bytes of frames.
    bytes: u64,
    /// Values that the server left out, as it says.
    left_out: u64,
    /// Of each value, from the moment at which the bridge received the telemetry to that at which it was here.
    ages: Times,
    /// Whether the server closed the connection.
    is_closed: bool,
}

/// A page, or a client of Foxglove with all topics, on a thread of its own.
struct Viewer {
    thread: JoinHandle<Seen>,
    over: Arc<AtomicBool>,
}

impl Viewer {
    /// Connects, and looks at robot 1.
    fn start(view: &View, kind: Kind) -> Viewer {
        let over = Arc::new(AtomicBool::new(false));
        let mut client = Client::connect(view, kind);
        let is_over = Arc::clone(&over);
        let thread = thread::spawn(move || {
            let mut seen = Seen::default();
            while !is_over.load(Ordering::Relaxed) {
                let Ok(message) = client.socket.read() else {
                    seen.is_closed = true;
                    break;
                };
                seen.bytes += message.len() as u64;
                match message {
                    Message::Text(text) => client.text(&text, &mut seen),
                    Message::Binary(bytes) => client.sample(&bytes, &mut seen),
                    _ => {}
                }
            }
            seen
        });
        Viewer { thread, over }
    }

    /// What it got so far; it goes.
    fn end(self) -> Seen {
        self.over.store(true, Ordering::Relaxed);
        self.thread.join().expect("a viewer that ends")
    }
}

/// A connection with a subprotocol.
struct Client {
    socket: WebSocket<Throttle>,
    /// The channel of telemetry, once it is known.
    telemetry: Option<u32>,
}

impl Client {
    /// Connects as this kind, as soon as the server has room: it may not have seen yet that others went.
    fn connect(view: &View, kind: Kind) -> Client {
        let begun = Instant::now();
        let mut client = loop {
            if let Some(client) = Client::try_connect(view.port, kind) {
                break client;
            }
            assert!(begun.elapsed() < WAIT_LIMIT, "no room at the server");
        };
        if kind == Kind::Page {
            client.send(&json!({"type": "open", "token": view.token, "robot": 1, "rate_hz": 20}));
        }
        client
    }

    /// `None` if the server has too many others.
    fn try_connect(port: u16, kind: Kind) -> Option<Client> {
        let is_throttled = kind == Kind::Throttled;
        let stream = open(port, is_throttled).expect("a server");
        let next = is_throttled.then(Instant::now);
        let protocol = match kind {
            Kind::Page => "hero.view.v1",
            Kind::Foxglove | Kind::Throttled => "foxglove.sdk.v1",
        };
        let url = format!("ws://127.0.0.1:{port}/");
        let mut request = url.into_client_request().expect("an address");
        let protocol = HeaderValue::from_static(protocol);
        request
            .headers_mut()
            .insert("Sec-WebSocket-Protocol", protocol);
        match tungstenite::client(request, Throttle { stream, next }) {
            Ok((socket, _)) => Some(Client {
                socket,
                telemetry: None,
            }),
            Err(HandshakeError::Failure(Error::Http(response)))
                if response.status() == StatusCode::SERVICE_UNAVAILABLE =>
            {
                None
            }
            Err(error) => panic!("no upgrade: {error}"),
        }
    }

    /// Sends a message. A server that has closed reads nothing.
    fn send(&mut self, message: &Value) {
        let _ = self.socket.send(Message::text(message.to_string()));
    }

    /// The next message of words; `None` when the server has closed.
    fn next_text(&mut self) -> Option<Value> {
        loop {
            if let Message::Text(text) = self.socket.read().ok()? {
                return Some(serde_json::from_str(&text).expect("JSON"));
            }
        }
    }

    /// A message of the server, which is answered.
    fn text(&mut self, text: &str, seen: &mut Seen) {
        let message: Value = serde_json::from_str(text).expect("JSON");
        if message["type"] == "now" {
            self.send(&json!({"type": "seen", "n": message["n"]}));
            let number = |value: &Value| value.as_u64().unwrap_or_default();
            seen.left_out += number(&message["left_out"]);
            let now_ms = MonotonicNs::now().0 / 1_000_000;
            let on_the_way_ms = now_ms.saturating_sub(number(&message["sent_ms"]));
            let age_ms = number(&message["telemetry"]["age_ms"]) + on_the_way_ms;
            seen.ages.push(Duration::from_millis(age_ms));
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
            seen.ages.push(MonotonicNs::now().since(sample.received()));
        }
    }
}

/// A stream of which a throttled client reads sips.
struct Throttle {
    stream: TcpStream,
    /// When the next sip may be taken; `None` if the client reads all.
    next: Option<Instant>,
}

impl Read for Throttle {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut most = buffer.len();
        if let Some(next) = &mut self.next {
            thread::sleep(next.saturating_duration_since(Instant::now()));
            *next += SIP_PERIOD;
            most = most.min(SIP);
        }
        self.stream.read(&mut buffer[..most])
    }
}

impl Write for Throttle {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.stream.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.stream.flush()
    }
}

/// Connects; `is_small` says whether little fits into the kernel's receive buffer.
fn open(port: u16, is_small: bool) -> io::Result<TcpStream> {
    let socket = socket(AddressFamily::INET, SocketType::STREAM, None)?;
    if is_small {
        sockopt::set_socket_recv_buffer_size(&socket, SMALL_BUFFER)?;
    }
    connect(&socket, &SocketAddr::from(([127, 0, 0, 1], port)))?;
    let stream = TcpStream::from(socket);
    stream.set_read_timeout(Some(WAIT_LIMIT))?;
    Ok(stream)
}

/// Heads and frames that one hostile sender sends in a row.
const ROW: u32 = 50;

/// How long a connection to the server may take while its backlog is full.
const CONNECT_LIMIT: Duration = Duration::from_secs(5);

/// Connections that say nothing, and others that send heads which are refused, or frames which are forbidden.
fn attack(site: &Site, port: u16) -> (Vec<TcpStream>, Hostile) {
    let (connections, per_second) = site.plan.either((100, 500), (1_000, 10_000));
    let silent = (0..connections)
        .filter_map(|_| connect_soon(port))
        .collect();
    let hostile = Hostile::start(site, per_second, ROW, || {
        move |chance: &mut Rng| row(port, chance)
    });
    (silent, hostile)
}

fn connect_soon(port: u16) -> Option<TcpStream> {
    let stream = TcpStream::connect_timeout(&([127, 0, 0, 1], port).into(), CONNECT_LIMIT).ok()?;
    stream.set_read_timeout(Some(CONNECT_LIMIT)).ok()?;
    stream.set_write_timeout(Some(CONNECT_LIMIT)).ok()?;
    Some(stream)
}

/// Sends a row with as few connections as the server allows; says how many were sent.
fn row(port: u16, chance: &mut Rng) -> u64 {
    let mut sent = 0;
    let mut stream = None;
    for _ in 0..ROW {
        if stream.is_none() {
            stream = connect_soon(port);
        }
        let Some(open) = &mut stream else { continue };
        match open.write_all(&garbage(port, chance)) {
            Ok(()) => sent += 1,
            Err(_) => stream = None,
        }
    }
    // What the server answers is not of interest; a connection that it has closed is done.
    if let Some(mut open) = stream {
        let _ = open.shutdown(Shutdown::Write);
        let _ = open.read(&mut [0; 512]);
    }
    sent
}

fn garbage(port: u16, chance: &mut Rng) -> Vec<u8> {
    let host = format!("Host: 127.0.0.1:{port}\r\n");
    let upgrade = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\
                   Sec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: hero.view.v1\r\n";
    let text = match chance.u8(..5) {
        0 => format!("GET / HTTP/1.1\r\n{host}Origin: http://evil.example\r\n{upgrade}\r\n"),
        1 => return b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03".to_vec(),
        2 => format!("POST /order HTTP/1.1\r\n{host}Content-Length: 10\r\n\r\n0123456789"),
        3 => {
            // A frame without a mask, and one of reserved bits, behind an upgrade.
            let upgraded = format!("GET / HTTP/1.1\r\n{host}{upgrade}\r\n");
            return [upgraded.as_bytes(), &[0x81, 0x02, b'{', b'}', 0xf3, 0x80]].concat();
        }
        _ => return (0..64).map(|_| chance.u8(..)).collect(),
    };
    text.into_bytes()
}
