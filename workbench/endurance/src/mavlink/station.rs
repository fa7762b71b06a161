//! [`Station`]: a ground station with a UDP socket. Its frames are read and written with the gateway's own `wire`; the
//! judges in Python have another. Each wait ends with a panic after [`WAIT_LIMIT`], as does what is sent to a
//! helicopter that was not heard.

use std::collections::VecDeque;
use std::net::{SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

use fastrand::Rng;
use ipc_types::MonotonicNs;
use ipc_types::code::Reason;
use mavlink_gateway::message::{COMMAND_ACK, COMMAND_INT, COMMAND_LONG, HEARTBEAT};
use mavlink_gateway::wire::{MessageWriter, frames};
use ril_tests::process::WAIT_LIMIT;

/// How often the station says that it is there.
const HEARTBEAT_PERIOD: Duration = Duration::from_millis(500);

/// How long [`Station::next_message`] waits for a datagram.
const NEXT_LIMIT: Duration = Duration::from_millis(20);

/// When a station sends a command again that was not answered, as MAVSDK does.
const COMMAND_RETRY: Duration = Duration::from_millis(500);

/// The heartbeat of a ground station.
pub fn heartbeat() -> MessageWriter {
    let message = MessageWriter::new(HEARTBEAT).u32(0).u8(6).u8(8);
    message.u8(0).u8(4).u8(3)
}

/// A command for the helicopter.
pub fn long(command: u16, params: [f32; 7]) -> MessageWriter {
    let message = MessageWriter::new(COMMAND_LONG);
    let message = params
        .iter()
        .fold(message, |message, param| message.f32(*param));
    message.u16(command).u8(1).u8(1).u8(0)
}

/// DO_REPOSITION: the command to fly to a place, in 10⁻⁷ degrees.
pub fn reposition(frame: u8, x: i32, y: i32, z: f32) -> MessageWriter {
    let message = MessageWriter::new(COMMAND_INT)
        .f32(-1.0)
        .f32(0.0)
        .f32(0.0)
        .f32(f32::NAN);
    let message = message.i32(x).i32(y).f32(z).u16(192).u8(1).u8(1);
    message.u8(frame).u8(0).u8(0)
}

/// A message of the helicopter.
#[derive(Clone, Debug)]
pub struct Received {
    /// When its datagram was read.
    pub at: MonotonicNs,
    id: u32,
    payload: Vec<u8>,
}

impl Received {
    /// Whether it is the message of this number.
    pub fn is(&self, id: u32) -> bool {
        self.id == id
    }

    /// The byte at this place.
    pub fn u8(&self, at: usize) -> u8 {
        self.payload.get(at).copied().unwrap_or(0)
    }

    /// Two bytes.
    pub fn u16(&self, at: usize) -> u16 {
        u16::from_le_bytes([self.u8(at), self.u8(at + 1)])
    }

    /// Four bytes with a sign.
    pub fn i32(&self, at: usize) -> i32 {
        i32::from_le_bytes(std::array::from_fn(|index| self.u8(at + index)))
    }

    /// A part of the payload, with the zeros that do not travel.
    pub fn part(&self, range: std::ops::Range<usize>) -> Vec<u8> {
        range.map(|at| self.u8(at)).collect()
    }
}

/// A ground station with a UDP socket. Each wait ends with a panic after [`WAIT_LIMIT`].
pub struct Station {
    socket: UdpSocket,
    vehicle: Option<SocketAddr>,
    next_heartbeat: Instant,
    waiting: VecDeque<Received>,
    /// Which share of the datagrams of each direction the line loses, by chance.
    loss: Option<(f64, Rng)>,
    /// Datagrams that have come, and their bytes.
    pub received: (u64, u64),
}

impl Station {
    /// One that has heard nothing yet, on a port of its own.
    #[allow(clippy::new_without_default)]
    pub fn new() -> Station {
        let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
        socket
            .set_read_timeout(Some(NEXT_LIMIT))
            .expect("a timeout");
        Station {
            socket,
            vehicle: None,
            next_heartbeat: Instant::now(),
            waiting: VecDeque::new(),
            loss: None,
            received: (0, 0),
        }
    }

    /// Its port on this machine.
    pub fn port(&self) -> u16 {
        self.socket.local_addr().expect("an address").port()
    }

    /// Waits for the helicopter, which appears unasked, and for its telemetry.
    #[track_caller]
    pub fn connect(&mut self) {
        self.until("a heartbeat", |message| message.is(0));
        self.until("telemetry", |message| message.is(30));
    }

    /// Waits for another gateway's helicopter and telemetry, after the messages of the one before.
    #[track_caller]
    pub fn reconnect(&mut self) {
        let before = self.vehicle;
        self.waiting.clear();
        let give_up = Instant::now() + WAIT_LIMIT;
        while self.vehicle == before {
            assert!(Instant::now() < give_up, "no other gateway came");
            self.next_message();
        }
        self.waiting.clear();
        self.connect();
    }

    /// Where the helicopter is reached.
    pub fn vehicle(&self) -> SocketAddr {
        self.vehicle.expect("it was heard")
    }

    /// From here on the line loses this share of the datagrams, 0 … 1, in each direction.
    pub fn lose(&mut self, share: f64, seed: u64) {
        self.loss = (share > 0.0).then(|| (share, Rng::with_seed(seed)));
    }

    fn is_lost(&mut self) -> bool {
        let chance = |(share, random): &mut (f64, Rng)| random.f64() < *share;
        self.loss.as_mut().is_some_and(chance)
    }

    /// Sends a message to the helicopter.
    pub fn send(&mut self, message: &MessageWriter) {
        if self.is_lost() {
            return;
        }
        let frame = message.frame(0, 255, 190);
        let sent = self.socket.send_to(&frame, self.vehicle());
        sent.expect("it is sent");
    }

    /// The next message, if one comes soon: within 20 ms.
    pub fn next_message(&mut self) -> Option<Received> {
        if self.vehicle.is_some() && Instant::now() >= self.next_heartbeat {
            self.next_heartbeat = Instant::now() + HEARTBEAT_PERIOD;
            self.send(&heartbeat());
        }
        if self.waiting.is_empty() {
            let mut buffer = [0; 2048];
            let (length, from) = self.socket.recv_from(&mut buffer).ok()?;
            let at = MonotonicNs::now();
            self.vehicle = Some(from);
            if self.is_lost() {
                return None;
            }
            self.received.0 += 1;
            self.received.1 += length as u64;
            for frame in frames(&buffer[..length]) {
                let frame = frame.expect("a frame");
                self.waiting.push_back(Received {
                    at,
                    id: frame.kind.id,
                    payload: frame.payload.0.to_vec(),
                });
            }
        }
        self.waiting.pop_front()
    }

    /// Waits for a message; the others are dropped.
    #[track_caller]
    pub fn until(&mut self, what: &str, mut is_right: impl FnMut(&Received) -> bool) -> Received {
        let give_up = Instant::now() + WAIT_LIMIT;
        while Instant::now() < give_up {
            if let Some(message) = self.next_message()
                && is_right(&message)
            {
                return message;
            }
        }
        panic!("{what} did not come");
    }

    /// Waits for a heartbeat with this mode.
    #[track_caller]
    pub fn until_mode(&mut self, mode: u32) {
        let what = format!("mode {mode:08x}");
        self.until(&what, |message| {
            message.is(0) && message.i32(0) as u32 == mode
        });
    }

    /// Waits for a text that begins with `text`.
    #[track_caller]
    pub fn until_text(&mut self, text: &str) {
        self.until(text, |message| {
            message.is(253) && message.payload[1..].starts_with(text.as_bytes())
        });
    }

    /// The answer to the command that was sent.
    #[track_caller]
    pub fn answer(&mut self, command: u16) -> Received {
        let what = format!("the answer to {command}");
        self.until(&what, |message| {
            message.is(77) && message.i32(0) as u16 == command
        })
    }

    fn send_command(&mut self, command: u16, params: [f32; 7]) {
        self.send(&long(command, params));
    }

    /// Sends a command until it is answered, as stations do, and looks at all that comes meanwhile. Gives the result
    /// and how often it was sent.
    #[track_caller]
    pub fn send_until_answered(
        &mut self,
        message: &MessageWriter,
        command: u16,
        mut look: impl FnMut(&Received),
    ) -> (u8, usize) {
        let give_up = Instant::now() + WAIT_LIMIT;
        let (mut next, mut copies) = (Instant::now(), 0);
        while Instant::now() < give_up {
            if Instant::now() >= next {
                self.send(message);
                (copies, next) = (copies + 1, next + COMMAND_RETRY);
            }
            if let Some(received) = self.next_message() {
                look(&received);
                if received.is(COMMAND_ACK.id) && received.u16(0) == command {
                    return (received.u8(2), copies);
                }
            }
        }
        panic!("{command} was not answered");
    }

    /// Commands, and gives the result.
    #[track_caller]
    pub fn command(&mut self, command: u16, params: [f32; 7]) -> u8 {
        self.send_command(command, params);
        self.answer(command).u8(2)
    }

    /// Commands a return again and again, until that is refused because the helicopter is not heard: before, because it
    /// is on the ground.
    #[track_caller]
    pub fn until_not_heard(&mut self) {
        let give_up = Instant::now() + WAIT_LIMIT;
        let mut reason = None;
        while reason != Some(Reason::LinkDown) {
            assert!(Instant::now() < give_up, "it is heard: {reason:?}");
            self.send_command(20, [0.0; 7]);
            let answer = self.answer(20);
            assert_eq!(answer.u8(2), 1, "{answer:?}");
            reason = Reason::from_code(answer.i32(4) as u32);
        }
    }

    /// Everything that comes until a command is answered.
    #[track_caller]
    pub fn between_command(&mut self, command: u16, params: [f32; 7]) -> Vec<Received> {
        let mut between = Vec::new();
        self.send_command(command, params);
        self.until("an answer", |message| {
            between.push(message.clone());
            message.is(77) && message.i32(0) as u16 == command
        });
        between
    }

    /// Commands to fly to a place, in 10⁻⁷ degrees, and gives the result.
    #[track_caller]
    pub fn reposition(&mut self, frame: u8, x: i32, y: i32, z: f32) -> u8 {
        self.send(&reposition(frame, x, y, z));
        self.answer(192).u8(2)
    }
}
