//! [`Air`]: a slow radio between two relays that speak TCP. What goes through it arrives after half a round trip, and some of it after
//! the time in addition in which a lost packet is repeated.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

/// One way.
const DELAY: Duration = Duration::from_millis(300);

/// How long a lost packet is late: TCP repeats it after two to three round trips.
const REPETITION: Duration = Duration::from_millis(1500);

/// One of so many packets is lost, in each direction by a count of its own.
const LOST_OF: usize = 5;

/// The radio. It ends with the test.
pub struct Air {
    /// Where the station connects.
    pub endpoint: String,
    open: Arc<Mutex<Vec<TcpStream>>>,
}

impl Air {
    /// From an endpoint of its own to `endpoint`, which is one of TCP.
    pub fn to(endpoint: &str) -> Air {
        let far = endpoint.strip_prefix("tcp/").expect("TCP").to_owned();
        let listener = TcpListener::bind(("127.0.0.1", 0)).expect("a free port");
        let near = listener.local_addr().expect("an address");
        let open = Arc::new(Mutex::new(Vec::new()));
        let all = Arc::clone(&open);
        thread::spawn(move || {
            for near in listener.incoming().flatten() {
                let Ok(far) = TcpStream::connect(&far) else {
                    continue;
                };
                carry(&near, &far);
                carry(&far, &near);
                all.lock()
                    .expect("no panic while it is held")
                    .extend([near, far]);
            }
        });
        Air {
            endpoint: format!("tcp/{near}"),
            open,
        }
    }
}

impl Drop for Air {
    fn drop(&mut self) {
        for end in self
            .open
            .lock()
            .expect("no panic while it is held")
            .drain(..)
        {
            let _ = end.shutdown(Shutdown::Both);
        }
    }
}

/// Carries what comes from one end to the other, until either is closed.
fn carry(from: &TcpStream, to: &TcpStream) {
    let clones = (from.try_clone(), to.try_clone());
    let (Ok(mut from), Ok(to)) = clones else {
        return;
    };
    let (packets, under_way) = mpsc::channel();
    thread::spawn(move || deliver(&under_way, &to));
    thread::spawn(move || {
        let mut packet = [0; 1500];
        for number in 1.. {
            let Ok(length @ 1..) = from.read(&mut packet) else {
                return;
            };
            let is_lost = number % LOST_OF == 0;
            let late = if is_lost { REPETITION } else { Duration::ZERO };
            let arrival = Instant::now() + DELAY + late;
            if packets.send((arrival, packet[..length].to_vec())).is_err() {
                return;
            }
        }
    });
}

/// Gives each packet to `to` at its time, and none before those that were sent before it.
fn deliver(under_way: &Receiver<(Instant, Vec<u8>)>, mut to: &TcpStream) {
    let (_never, wait) = mpsc::channel::<()>();
    for (arrival, packet) in under_way {
        let left = arrival.saturating_duration_since(Instant::now());
        assert_eq!(wait.recv_timeout(left), Err(RecvTimeoutError::Timeout));
        if to.write_all(&packet).is_err() {
            break;
        }
    }
    let _ = to.shutdown(Shutdown::Both);
}
