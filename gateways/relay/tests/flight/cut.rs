//! A link that is cut between an order and a later one: the older order is not carried out after the later one.

use std::io;
use std::net::{Shutdown, TcpListener, TcpStream};
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::thread;

use ipc_types::code::Functionality;
use ipc_types::payload::{DspTelemetry, ModuleState, RelayLink};
use ril_tests::chain::beside_or_skip;

use crate::machine::{Crew, Machine, end, free_endpoint};
use crate::rig::RELAY;

/// How often the link is cut.
const CUTS: usize = 3;

/// A cable for TCP that can be cut. It ends with the test.
struct Cable {
    endpoint: String,
    ends: Arc<Mutex<Ends>>,
}

#[derive(Default)]
struct Ends {
    is_cut: bool,
    open: Vec<TcpStream>,
}

impl Cable {
    /// From an endpoint of its own to this one.
    fn to(endpoint: &str) -> Cable {
        let far = address(endpoint).to_owned();
        let listener = TcpListener::bind(("127.0.0.1", 0)).expect("a free port");
        let near = listener.local_addr().expect("an address");
        let ends = Arc::new(Mutex::new(Ends::default()));
        let shared = Arc::clone(&ends);
        thread::spawn(move || {
            for near in listener.incoming().flatten() {
                let mut ends = shared.lock().expect("no panic while it is held");
                if ends.is_cut {
                    continue;
                }
                let Ok(far) = TcpStream::connect(&far) else {
                    continue;
                };
                carry(&near, &far);
                carry(&far, &near);
                ends.open.extend([near, far]);
            }
        });
        Cable {
            endpoint: format!("tcp/{near}"),
            ends,
        }
    }

    /// Ends all connections, and takes no other. What was under way is lost.
    fn cut(&self) {
        let mut ends = self.ends.lock().expect("no panic while it is held");
        ends.is_cut = true;
        for end in ends.open.drain(..) {
            let _ = end.shutdown(Shutdown::Both);
        }
    }

    /// Takes connections again.
    fn join(&self) {
        self.ends.lock().expect("no panic while it is held").is_cut = false;
    }
}

fn address(endpoint: &str) -> &str {
    endpoint.strip_prefix("tcp/").expect("an endpoint of TCP")
}

/// Carries what comes from one end to the other, until either is closed.
fn carry(from: &TcpStream, to: &TcpStream) {
    let clones = (from.try_clone(), to.try_clone());
    let (Ok(mut from), Ok(mut to)) = clones else {
        return;
    };
    thread::spawn(move || {
        let _ = io::copy(&mut from, &mut to);
        let _ = to.shutdown(Shutdown::Both);
    });
}

#[test]
fn a_path_that_was_ordered_before_a_hold_is_not_flown_after_it_when_the_link_comes_back() {
    let Some(ril) = beside_or_skip(Path::new(RELAY)) else {
        return;
    };
    let (robot, station) = (Machine::new(&ril, "cut"), Machine::new(&ril, "cut"));
    // A request that comes while the link is cut is not refused: the station does not know yet that it is down.
    station.write("relay.toml", "[network]\nsilent_after_ms = 60000\n");
    let crew = Crew::start(&robot, 1);
    let endpoint = free_endpoint();
    let robot_relay = robot.start_ready(&format!(
        "relay robot --listen {endpoint} --may-command gcs"
    ));
    let cable = Cable::to(&endpoint);
    let station_relay = station.start_ready(&format!(
        "relay station --name gcs --connect {}",
        cable.endpoint
    ));
    station.await_link(1);
    station.run("start", 0);
    station.run("takeoff --altitude 5", 0);
    let place = station.subscribe::<DspTelemetry>(1).next().geographic;
    let far = format!(
        "goto {},{},{}",
        place.latitude_deg + 0.02,
        place.longitude_deg,
        place.altitude_m
    );
    let mut links = station.subscribe::<RelayLink>(1);
    let mut states = robot.subscribe::<ModuleState>(1);
    for _ in 0..CUTS {
        let sent = links.next().orders_sent;
        cable.cut();
        let mut path = station.start(&far);
        links.until("the path is ordered", |link| link.orders_sent > sent);
        let mut hold = station.start("hold");
        links.until("the hold is ordered", |link| link.orders_sent > sent + 1);
        cable.join();
        let held = hold.wait_exit();
        assert_eq!(held.code(), Some(0), "{held:#?}");
        let ended = path.wait_exit();
        assert_ne!(ended.code(), Some(0), "{ended:#?}");
        let state = states.next();
        let is_flown = state.functionality == Functionality::FollowingPath.code();
        assert!(!is_flown, "after the hold: {ended:#?}\n{state:#?}");
    }
    station.run("land", 0);
    end(station_relay);
    end(robot_relay);
    crew.end();
}
