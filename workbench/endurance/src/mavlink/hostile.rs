//! [`Hostile`]: programs that send from many ports what no station sends, and commands of stations that are not permitted.

use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use dsp_sim::random::Random;
use mavlink_gateway::message::{ALL, COMMAND_LONG};
use mavlink_gateway::wire::MessageWriter;

use super::station::heartbeat;

/// Threads that send, and sockets of each.
const SENDERS: u64 = 4;
const SOCKETS: usize = 16;

/// Datagrams that one sender sends in a row, before it looks at the clock again: all rows at once fit into the gateway's socket, because
/// what the kernel drops tries nothing.
const ROW: u32 = 20;

/// The system of those that are not permitted.
const STRANGER: u8 = 77;

/// See the module's documentation.
pub struct Hostile {
    over: Arc<AtomicBool>,
    sent: Arc<AtomicU64>,
    senders: Vec<JoinHandle<()>>,
}

impl Hostile {
    /// Sends `per_second` datagrams to `gateway`.
    ///
    /// # Panics
    ///
    /// When there are not enough free ports.
    pub fn start(gateway: SocketAddr, per_second: u32, seed: u64) -> Hostile {
        let over = Arc::new(AtomicBool::new(false));
        let sent = Arc::new(AtomicU64::new(0));
        let period = Duration::from_secs(1) * ROW * SENDERS as u32 / per_second.max(1);
        let senders = (0..SENDERS)
            .map(|number| {
                let (over, sent) = (Arc::clone(&over), Arc::clone(&sent));
                let mut chance = Random::new(seed, number);
                let socket = |_| UdpSocket::bind("127.0.0.1:0").expect("a free port");
                let sockets: Vec<UdpSocket> = (0..SOCKETS).map(socket).collect();
                thread::spawn(move || {
                    let mut next = Instant::now();
                    while !over.load(Ordering::Relaxed) {
                        for _ in 0..ROW {
                            let socket = &sockets[below(&mut chance, SOCKETS)];
                            let is_sent = socket.send_to(&datagram(&mut chance), gateway).is_ok();
                            sent.fetch_add(is_sent.into(), Ordering::Relaxed);
                        }
                        // What a stall of the machine has cost is not made up for.
                        next = (next + period).max(Instant::now());
                        thread::sleep(next.saturating_duration_since(Instant::now()));
                    }
                })
            })
            .collect();
        Hostile {
            over,
            sent,
            senders,
        }
    }

    /// Ends, and says how many datagrams were sent.
    ///
    /// # Panics
    ///
    /// When a sender has.
    pub fn end(self) -> u64 {
        self.over.store(true, Ordering::Relaxed);
        for sender in self.senders {
            sender.join().expect("a sender that ends");
        }
        self.sent.load(Ordering::Relaxed)
    }
}

fn below(chance: &mut Random, count: usize) -> usize {
    (chance.uniform() * count as f64) as usize
}

/// A sixth each: any bytes, any message cut short, any with a wrong checksum, any with any content, and a stranger's heartbeats and commands.
fn datagram(chance: &mut Random) -> Vec<u8> {
    let kind = below(chance, 6);
    if kind == 0 {
        let length = below(chance, 280);
        return (0..length).map(|_| chance.next_u64() as u8).collect();
    }
    let message = match kind {
        4 => heartbeat(),
        5 => command(chance),
        _ => any_message(chance),
    };
    let mut bytes = message.frame(0, STRANGER, 1 + below(chance, 200) as u8);
    match kind {
        1 => bytes.truncate(1 + below(chance, bytes.len() - 1)),
        2 => {
            let last = bytes.len() - 1;
            bytes[last] ^= 1;
        }
        _ => {}
    }
    bytes
}

fn any_message(chance: &mut Random) -> MessageWriter {
    let kind = ALL[below(chance, ALL.len())];
    let fields = below(chance, 60);
    (0..fields).fold(MessageWriter::new(kind), |message, _| {
        message.u8(chance.next_u64() as u8)
    })
}

/// Arms, takes off, holds, lands, returns, starts the mission, or changes the speed.
fn command(chance: &mut Random) -> MessageWriter {
    const COMMANDS: [u16; 7] = [400, 22, 193, 21, 20, 300, 178];
    let command = COMMANDS[below(chance, COMMANDS.len())];
    let value = chance.uniform() as f32;
    let message = MessageWriter::new(COMMAND_LONG).f32(value).f32s(0.0, 6);
    message.u16(command).u8(1).u8(1).u8(0)
}
