//! [`Air`]: a radio between two relays of one machine, narrow, far and lossy as a test says. It carries TCP and UDP
//! over loopback, and needs no right that a normal user does not have.
//!
//! Packets leave at the [`Weather`]'s rate and arrive after its delay. Of UDP a packet is lost that finds the queue
//! full, and each of so many. TCP is carried as a stream: a full queue holds up the side that sends, and a lost packet
//! is late by its repetition.

use std::io::{self, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use rustix::net::sockopt::set_socket_recv_buffer_size;

/// Longest packet of TCP, bytes: what fits into an interface's 1500.
const SEGMENT: usize = 1400;

/// Longest packet of UDP, bytes.
const DATAGRAM: usize = 2048;

/// Headers of a packet, bytes: IP and TCP.
const HEADERS: usize = 40;

/// Bytes that wait in the kernel before the radio has them: as few as it allows.
const RECEIVED: usize = 2048;

/// What the air does in each direction.
#[derive(Clone, Copy, Debug)]
pub struct Weather {
    /// Bytes a second; `None` if there is no bound.
    pub bytes_per_s: Option<u32>,
    /// One way.
    pub delay: Duration,
    /// Bytes that may wait to leave.
    pub queue: usize,
    /// One of so many packets is lost, by a count; `None` if none is.
    pub lost_of: Option<usize>,
    /// By how much a packet of TCP is late that was lost.
    pub repetition: Duration,
}

impl Weather {
    /// Nothing but a delay.
    pub const fn far(delay: Duration) -> Weather {
        Weather {
            bytes_per_s: None,
            delay,
            queue: usize::MAX,
            lost_of: None,
            repetition: Duration::ZERO,
        }
    }

    /// So many kbit/s, with a delay, and a queue of a second.
    pub const fn narrow(kbit_per_s: u32, delay: Duration) -> Weather {
        let bytes_per_s = kbit_per_s * 125;
        Weather {
            bytes_per_s: Some(bytes_per_s),
            queue: bytes_per_s as usize,
            ..Weather::far(delay)
        }
    }
}

/// One direction. A pure value.
#[derive(Clone, Copy, Debug)]
pub struct Way {
    weather: Weather,
    /// When all that was taken has left.
    free: Instant,
    taken: usize,
}

impl Way {
    /// Nothing was sent yet.
    pub fn new(weather: Weather) -> Way {
        Way {
            weather,
            free: Instant::now(),
            taken: 0,
        }
    }

    fn takes(&self, length: usize) -> Duration {
        match self.weather.bytes_per_s {
            Some(rate) => Duration::from_secs_f64((length + HEADERS) as f64 / f64::from(rate)),
            None => Duration::ZERO,
        }
    }

    /// How long the queue has no room for more.
    pub fn full_for(&self, now: Instant) -> Duration {
        let waits = self.free.saturating_duration_since(now);
        let longest = match self.weather.bytes_per_s {
            Some(rate) => Duration::from_secs_f64(self.weather.queue as f64 / f64::from(rate)),
            None => Duration::MAX,
        };
        waits.saturating_sub(longest)
    }

    /// A packet is sent: when it leaves, and whether the air loses it.
    pub fn take(&mut self, length: usize, now: Instant) -> (Instant, bool) {
        self.free = self.free.max(now) + self.takes(length);
        self.taken += 1;
        let is_lost = self
            .weather
            .lost_of
            .is_some_and(|count| self.taken.is_multiple_of(count));
        (self.free, is_lost)
    }
}

/// The weather of all ways of a radio, and by how much it has become farther since, ns.
#[derive(Clone)]
struct Sky {
    weather: Weather,
    farther_ns: Arc<AtomicU64>,
}

impl Sky {
    fn delay(&self) -> Duration {
        self.weather.delay + Duration::from_nanos(self.farther_ns.load(Ordering::Relaxed))
    }
}

/// What is under way: when it arrives, and what it is.
type Packets = Receiver<(Instant, Vec<u8>)>;

/// The radio. Connections end with it.
pub struct Air {
    /// Where the station connects.
    pub endpoint: String,
    ends: Arc<Mutex<Ends>>,
    farther_ns: Arc<AtomicU64>,
}

/// The ends of connections of TCP.
#[derive(Default)]
struct Ends {
    is_cut: bool,
    open: Vec<TcpStream>,
}

impl Ends {
    fn close(&mut self) {
        for end in self.open.drain(..) {
            let _ = end.shutdown(Shutdown::Both);
        }
    }
}

impl Air {
    /// From an endpoint of its own to `endpoint`, of TCP, TLS, UDP or QUIC on loopback.
    ///
    /// # Panics
    ///
    /// When the endpoint is none, or there is no free port.
    pub fn to(endpoint: &str, weather: Weather) -> Air {
        let (protocol, far) = endpoint.split_once('/').expect("protocol/address");
        let far: SocketAddr = far.parse().expect("an address");
        let ends = Arc::default();
        let farther_ns = Arc::default();
        let sky = Sky {
            weather,
            farther_ns: Arc::clone(&farther_ns),
        };
        let near = match protocol {
            "tcp" | "tls" => streams(far, sky, Arc::clone(&ends)),
            _ => datagrams(far, &sky),
        };
        let near = near.expect("a free port");
        Air {
            endpoint: format!("{protocol}/{near}"),
            ends,
            farther_ns,
        }
    }

    /// From now on each way takes longer by `by` than at first, as after a change from Wi-Fi to a mobile network: what
    /// is sent is later, and nothing is lost.
    pub fn lengthen(&self, by: Duration) {
        let by = u64::try_from(by.as_nanos()).unwrap_or(u64::MAX);
        self.farther_ns.store(by, Ordering::Relaxed);
    }

    /// Ends all connections of TCP, and takes no other. What was under way is lost.
    ///
    /// # Panics
    ///
    /// When a thread of the radio has failed.
    pub fn cut(&self) {
        let mut ends = self.ends.lock().expect("no panic while it is held");
        ends.is_cut = true;
        ends.close();
    }

    /// Takes connections again.
    ///
    /// # Panics
    ///
    /// When a thread of the radio has failed.
    pub fn join(&self) {
        self.ends.lock().expect("no panic while it is held").is_cut = false;
    }
}

impl Drop for Air {
    fn drop(&mut self) {
        self.ends.lock().expect("no panic while it is held").close();
    }
}

fn streams(far: SocketAddr, sky: Sky, ends: Arc<Mutex<Ends>>) -> io::Result<SocketAddr> {
    let listener = TcpListener::bind(("127.0.0.1", 0))?;
    let near = listener.local_addr()?;
    // Accepted connections have it from the listener.
    set_socket_recv_buffer_size(&listener, RECEIVED)?;
    thread::spawn(move || {
        for near in listener.incoming().flatten() {
            let mut ends = ends.lock().expect("no panic while it is held");
            if ends.is_cut {
                continue;
            }
            let Ok(far) = TcpStream::connect(far) else {
                continue;
            };
            let _ = set_socket_recv_buffer_size(&far, RECEIVED);
            let carried = carry_stream(&near, &far, &sky);
            if carried.and(carry_stream(&far, &near, &sky)).is_ok() {
                ends.open.extend([near, far]);
            }
        }
    });
    Ok(near)
}

fn carry_stream(from: &TcpStream, to: &TcpStream, sky: &Sky) -> io::Result<()> {
    let (mut from, mut to) = (from.try_clone()?, to.try_clone()?);
    to.set_nodelay(true)?;
    let end = to.try_clone()?;
    let packets = way(sky, SEGMENT, true, move |packet| from.read(packet));
    thread::spawn(move || {
        deliver(&packets, |packet| to.write_all(packet));
        let _ = end.shutdown(Shutdown::Both);
    });
    Ok(())
}

fn datagrams(far_address: SocketAddr, sky: &Sky) -> io::Result<SocketAddr> {
    let near = Arc::new(UdpSocket::bind(("127.0.0.1", 0))?);
    let far = Arc::new(UdpSocket::bind(("127.0.0.1", 0))?);
    far.connect(far_address)?;
    let address = near.local_addr()?;
    // Whoever has sent last gets what comes back: a relay that connects anew has another address.
    let sender = Arc::new(Mutex::new(None));
    let there = {
        let (near, sender) = (Arc::clone(&near), Arc::clone(&sender));
        way(sky, DATAGRAM, false, move |packet| {
            let (length, from) = near.recv_from(packet)?;
            *sender.lock().expect("no panic while it is held") = Some(from);
            Ok(length)
        })
    };
    let back = {
        let far = Arc::clone(&far);
        way(sky, DATAGRAM, false, move |packet| {
            loop {
                // While the relay there does not run, the kernel refuses.
                match far.recv(packet) {
                    Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => {}
                    received => return received,
                }
            }
        })
    };
    thread::spawn(move || {
        deliver(&there, |packet| {
            let _ = far.send(packet);
            Ok(())
        });
    });
    thread::spawn(move || {
        deliver(&back, |packet| {
            let to = *sender.lock().expect("no panic while it is held");
            to.map_or(Ok(()), |to| near.send_to(packet, to).map(drop))
        });
    });
    Ok(address)
}

/// Takes packets on a thread of its own, and says when each arrives. A stream is held up by a full queue, and gets all.
fn way(
    sky: &Sky,
    longest: usize,
    is_stream: bool,
    mut read: impl FnMut(&mut [u8]) -> io::Result<usize> + Send + 'static,
) -> Packets {
    let (sender, packets) = mpsc::channel();
    let sky = sky.clone();
    thread::spawn(move || {
        let mut way = Way::new(sky.weather);
        let mut packet = vec![0; longest];
        while let Ok(length) = read(&mut packet)
            && (length > 0 || !is_stream)
        {
            let full_for = way.full_for(Instant::now());
            if !is_stream && !full_for.is_zero() {
                continue;
            }
            wait(full_for);
            let (leaves, is_lost) = way.take(length, Instant::now());
            let mut arrives = leaves + sky.delay();
            if is_lost && is_stream {
                arrives += sky.weather.repetition;
            }
            if (is_stream || !is_lost) && !send(&sender, arrives, &packet[..length]) {
                return;
            }
        }
    });
    packets
}

fn send(sender: &Sender<(Instant, Vec<u8>)>, arrives: Instant, packet: &[u8]) -> bool {
    sender.send((arrives, packet.to_vec())).is_ok()
}

/// Hands each packet on at its time, and none before those that were sent before it.
fn deliver(packets: &Packets, mut write: impl FnMut(&[u8]) -> io::Result<()>) {
    for (arrives, packet) in packets {
        wait(arrives.saturating_duration_since(Instant::now()));
        if write(&packet).is_err() {
            return;
        }
    }
}

fn wait(time: Duration) {
    let (_never, nothing) = mpsc::channel::<()>();
    if !time.is_zero() {
        assert_eq!(nothing.recv_timeout(time), Err(RecvTimeoutError::Timeout));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_leave_at_the_rate_the_queue_is_bounded_and_the_air_loses_by_a_count() {
        let now = Instant::now();
        let weather = Weather {
            lost_of: Some(3),
            ..Weather::narrow(64, Duration::ZERO)
        };
        let mut way = Way {
            weather,
            free: now,
            taken: 0,
        };
        // 1,000 bytes with their headers are 130 ms of 64 kbit/s.
        let takes = Duration::from_millis(130);
        let left: Vec<_> = (0..9).map(|_| way.take(1000, now)).collect();
        for (number, (leaves, is_lost)) in (1..).zip(left) {
            assert_eq!(leaves, now + takes * number);
            assert_eq!(is_lost, number % 3 == 0);
        }
        // A second is what the queue holds.
        assert_eq!(way.full_for(now), Duration::from_millis(170));
        assert_eq!(
            way.full_for(now + Duration::from_millis(170)),
            Duration::ZERO
        );
    }

    #[test]
    fn without_a_rate_nothing_waits() {
        let now = Instant::now();
        let mut way = Way {
            weather: Weather::far(Duration::from_millis(300)),
            free: now,
            taken: 0,
        };
        assert_eq!(way.take(1_000_000, now), (now, false));
        assert_eq!(way.full_for(now), Duration::ZERO);
    }
}
