//! A ground station with a UDP socket. Its frames are read and written with the gateway's own `wire`; the judge in Python has another.

use std::collections::VecDeque;
use std::net::{SocketAddr, UdpSocket};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use ipc_types::code::Reason;
use mavlink_gateway::message::{ALL, COMMAND_INT, COMMAND_LONG, HEARTBEAT};
use mavlink_gateway::wire::{MessageWriter, frames};
use ril_tests::process::WAIT_LIMIT;

/// How often the station says that it is there.
const HEARTBEAT_PERIOD: Duration = Duration::from_millis(500);

/// A message of the helicopter.
#[derive(Clone, Debug)]
pub struct Received {
    id: u32,
    payload: Vec<u8>,
}

impl Received {
    pub fn is(&self, id: u32) -> bool {
        self.id == id
    }

    pub fn u8(&self, at: usize) -> u8 {
        self.payload.get(at).copied().unwrap_or(0)
    }

    pub fn u16(&self, at: usize) -> u16 {
        u16::from_le_bytes([self.u8(at), self.u8(at + 1)])
    }

    pub fn i32(&self, at: usize) -> i32 {
        i32::from_le_bytes(std::array::from_fn(|index| self.u8(at + index)))
    }

    /// A part of the payload, with the zeros that do not travel.
    pub fn part(&self, range: std::ops::Range<usize>) -> Vec<u8> {
        range.map(|at| self.u8(at)).collect()
    }
}

pub struct Station {
    socket: UdpSocket,
    vehicle: Option<SocketAddr>,
    next_heartbeat: Instant,
    waiting: VecDeque<Received>,
    /// What the line loses, in percent of the datagrams of each direction, by chance.
    loss: Option<(u8, fastrand::Rng)>,
}

impl Station {
    pub fn new() -> Station {
        let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
        socket
            .set_read_timeout(Some(HEARTBEAT_PERIOD))
            .expect("a timeout");
        Station {
            socket,
            vehicle: None,
            next_heartbeat: Instant::now(),
            waiting: VecDeque::new(),
            loss: None,
        }
    }

    pub fn port(&self) -> u16 {
        self.socket.local_addr().expect("an address").port()
    }

    /// Waits for the helicopter, which appears unasked, and for its telemetry.
    #[track_caller]
    pub fn connect(&mut self) {
        self.until("a heartbeat", |message| message.is(0));
        self.until("telemetry", |message| message.is(30));
    }

    /// The same with another gateway, after the messages of the one before.
    #[track_caller]
    pub fn reconnect(&mut self) {
        let before = self.vehicle;
        self.waiting.clear();
        let give_up = Instant::now() + WAIT_LIMIT;
        while self.vehicle == before {
            assert!(Instant::now() < give_up, "no other gateway came");
            self.next();
        }
        self.waiting.clear();
        self.connect();
    }

    /// From here on the line loses so much, in each direction.
    pub fn lose(&mut self, percent: u8, seed: u64) {
        self.loss = Some((percent, fastrand::Rng::with_seed(seed)));
    }

    fn is_lost(&mut self) -> bool {
        let chance = |(percent, rng): &mut (u8, fastrand::Rng)| rng.u8(0..100) < *percent;
        self.loss.as_mut().is_some_and(chance)
    }

    pub fn send(&mut self, message: &MessageWriter) {
        if self.is_lost() {
            return;
        }
        let vehicle = self.vehicle.expect("it was heard");
        let frame = message.frame(0, 255, 190);
        self.socket.send_to(&frame, vehicle).expect("it is sent");
    }

    /// The next message, if one comes within the period of the heartbeat.
    pub fn next(&mut self) -> Option<Received> {
        if self.vehicle.is_some() && Instant::now() >= self.next_heartbeat {
            self.next_heartbeat = Instant::now() + HEARTBEAT_PERIOD;
            self.send(
                &MessageWriter::new(HEARTBEAT)
                    .u32(0)
                    .u8(6)
                    .u8(8)
                    .u8(0)
                    .u8(4)
                    .u8(3),
            );
        }
        if self.waiting.is_empty() {
            let mut buffer = [0; 2048];
            let (length, from) = self.socket.recv_from(&mut buffer).ok()?;
            self.vehicle = Some(from);
            if self.is_lost() {
                return None;
            }
            for frame in frames(&buffer[..length]) {
                let frame = frame.expect("a frame");
                self.waiting.push_back(Received {
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
            if let Some(message) = self.next()
                && is_right(&message)
            {
                return message;
            }
        }
        panic!("{what} did not come");
    }

    #[track_caller]
    pub fn until_mode(&mut self, mode: u32) {
        let what = format!("mode {mode:08x}");
        self.until(&what, |message| {
            message.is(0) && message.i32(0) as u32 == mode
        });
    }

    #[track_caller]
    pub fn until_text(&mut self, text: &str) {
        self.until(text, |message| {
            message.is(253) && message.payload[1..].starts_with(text.as_bytes())
        });
    }

    /// The answer to the command that was sent.
    #[track_caller]
    fn answer(&mut self, command: u16) -> Received {
        let what = format!("the answer to {command}");
        self.until(&what, |message| {
            message.is(77) && message.i32(0) as u16 == command
        })
    }

    fn send_command(&mut self, command: u16, params: [f32; 7]) {
        let message = params
            .iter()
            .fold(MessageWriter::new(COMMAND_LONG), |message, param| {
                message.f32(*param)
            });
        self.send(&message.u16(command).u8(1).u8(1).u8(0));
    }

    /// Commands, and gives the result.
    #[track_caller]
    pub fn command(&mut self, command: u16, params: [f32; 7]) -> u8 {
        self.send_command(command, params);
        self.answer(command).u8(2)
    }

    /// Commands once a second until it is answered, and gives the result and how often it was sent.
    #[track_caller]
    pub fn command_again_and_again(&mut self, command: u16, params: [f32; 7]) -> (u8, usize) {
        let give_up = Instant::now() + WAIT_LIMIT;
        let (mut next, mut copies) = (Instant::now(), 0);
        while Instant::now() < give_up {
            if Instant::now() >= next {
                self.send_command(command, params);
                copies += 1;
                next = Instant::now() + Duration::from_secs(1);
            }
            if let Some(message) = self.next()
                && message.is(77)
                && message.i32(0) as u16 == command
            {
                return (message.u8(2), copies);
            }
        }
        panic!("{command} was not answered");
    }

    /// Another program sends so many datagrams of all kinds to the helicopter.
    pub fn flood(&self, count: u32) -> JoinHandle<()> {
        let vehicle = self.vehicle.expect("it was heard");
        let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
        thread::spawn(move || {
            for number in 0..count {
                let bits = number.wrapping_mul(2_654_435_761);
                let kind = ALL[bits as usize % ALL.len()];
                let message = (0..20).fold(MessageWriter::new(kind), |message, at| {
                    message.u32(bits.rotate_left(at))
                });
                let mut bytes = message.frame(number as u8, 77, 1);
                match number % 4 {
                    0 => bytes[0] = 0x55,
                    1 => bytes[11] ^= 1,
                    _ => {}
                }
                let _ = socket.send_to(&bytes, vehicle);
            }
        })
    }

    /// Commands a return again and again, until that is refused because the helicopter is not heard: before, because it is on the ground.
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

    /// Commands to fly to a place, in 10⁻⁷ degrees.
    #[track_caller]
    pub fn reposition(&mut self, frame: u8, x: i32, y: i32, z: f32) -> u8 {
        let message = MessageWriter::new(COMMAND_INT)
            .f32(-1.0)
            .f32(0.0)
            .f32(0.0)
            .f32(f32::NAN);
        let message = message.i32(x).i32(y).f32(z).u16(192).u8(1).u8(1);
        self.send(&message.u8(frame).u8(0).u8(0));
        self.answer(192).u8(2)
    }
}
