//! [`Hostile`]: programs that open connections and send what no viewer sends, as fast as they are told.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use dsp_sim::random::Random;

/// Threads that send.
const SENDERS: u64 = 4;

/// Heads and frames that one sender sends in a row, before it looks at the clock again.
const ROW: u32 = 50;

/// How long a connection to the server may take while its backlog is full.
const CONNECT_LIMIT: Duration = Duration::from_secs(5);

/// See the module's documentation.
pub struct Hostile {
    over: Arc<AtomicBool>,
    sent: Arc<AtomicU64>,
    senders: Vec<JoinHandle<()>>,
    /// Connections that say nothing.
    silent: Vec<TcpStream>,
}

impl Hostile {
    /// Opens `connections` that say nothing, and sends `per_second` heads and frames.
    pub fn start(port: u16, connections: u32, per_second: u32, seed: u64) -> Hostile {
        let over = Arc::new(AtomicBool::new(false));
        let sent = Arc::new(AtomicU64::new(0));
        let silent = (0..connections).filter_map(|_| connect(port)).collect();
        let period = Duration::from_secs(1) * ROW * SENDERS as u32 / per_second.max(1);
        let senders = (0..SENDERS)
            .map(|number| {
                let (over, sent) = (Arc::clone(&over), Arc::clone(&sent));
                let mut chance = Random::new(seed, number);
                thread::spawn(move || {
                    while !over.load(Ordering::Relaxed) {
                        let begun = Instant::now();
                        sent.fetch_add(row(port, &mut chance), Ordering::Relaxed);
                        thread::sleep(period.saturating_sub(begun.elapsed()));
                    }
                })
            })
            .collect();
        Hostile {
            over,
            sent,
            senders,
            silent,
        }
    }

    /// Ends, and says how many connections there were, and how many heads and frames were sent.
    pub fn end(self) -> (usize, u64) {
        self.over.store(true, Ordering::Relaxed);
        for sender in self.senders {
            sender.join().expect("a sender that ends");
        }
        (self.silent.len(), self.sent.load(Ordering::Relaxed))
    }
}

fn connect(port: u16) -> Option<TcpStream> {
    let stream = TcpStream::connect_timeout(&([127, 0, 0, 1], port).into(), CONNECT_LIMIT).ok()?;
    stream.set_read_timeout(Some(CONNECT_LIMIT)).ok()?;
    stream.set_write_timeout(Some(CONNECT_LIMIT)).ok()?;
    Some(stream)
}

/// Sends a row of heads that are refused, or of frames that are forbidden, with as few connections as the server allows; says how many
/// were sent.
fn row(port: u16, chance: &mut Random) -> u64 {
    let mut sent = 0;
    let mut stream = None;
    for _ in 0..ROW {
        if stream.is_none() {
            stream = connect(port);
        }
        let Some(open) = &mut stream else { continue };
        match open.write_all(&garbage(port, chance)) {
            Ok(()) => sent += 1,
            Err(_) => stream = None,
        }
    }
    // What the server answers is not of interest; a connection that it has closed is done.
    if let Some(mut open) = stream {
        let _ = open.shutdown(std::net::Shutdown::Write);
        let _ = open.read(&mut [0; 512]);
    }
    sent
}

fn garbage(port: u16, chance: &mut Random) -> Vec<u8> {
    let host = format!("Host: 127.0.0.1:{port}\r\n");
    let upgrade = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\
                   Sec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: hero.view.v1\r\n";
    match (chance.uniform() * 5.0) as u32 {
        0 => format!("GET / HTTP/1.1\r\n{host}Origin: http://evil.example\r\n{upgrade}\r\n")
            .into_bytes(),
        1 => b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03".to_vec(),
        2 => format!("POST /order HTTP/1.1\r\n{host}Content-Length: 10\r\n\r\n0123456789")
            .into_bytes(),
        3 => {
            // A frame without a mask, and one of reserved bits, behind an upgrade.
            let mut bytes = format!("GET / HTTP/1.1\r\n{host}{upgrade}\r\n").into_bytes();
            bytes.extend([0x81, 0x02, b'{', b'}', 0xf3, 0x80]);
            bytes
        }
        _ => (0..64).map(|_| (chance.uniform() * 256.0) as u8).collect(),
    }
}
