//! Relays: real processes of robots and stations, over good links and bad ones.
//!
//! | file | links |
//! |---|---|
//! | [`relays`] | two networks on this machine (`networks`), between which packets are lost; the robot's monotonic clock is hours ahead |
//! | [`narrow`] | a radio on loopback ([`ril_tests::air`]) |
//! | [`fleet`] | loopback as it is, and many robots |
//!
//! Times are printed and not judged.

pub mod fleet;
pub mod narrow;
mod networks;
pub mod relays;

use std::time::Duration;

use ipc_types::code::ControlCommand;
use ipc_types::payload::{ModuleControl, RequestReport};
use ipc_types::{Client, Domain, Ipc, MonotonicNs, RobotId, fresh_request_id};
use ril_tests::Sandbox;
use ril_tests::relayed::STATION;

/// Nothing but this program reaches the networks that it makes, and the loopback interface's address that it takes.
const OPEN: &str = "[security]\ninsecure = true\n";

/// The name of the robot's certificate.
const ROBOT: &str = "robot-1";

/// An order that has no final report by then hangs.
const LONGEST: Duration = Duration::from_secs(90);

/// Writes the `relay.toml` of both machines: with certificates where the protocol is encrypted. The robot's relay is at
/// `address`.
fn secure(protocol: &str, address: &str, robot: &Sandbox, station: &Sandbox) {
    let is_encrypted = ["tls", "quic"].contains(&protocol);
    if is_encrypted {
        robot.run(&format!("relay certify pki {ROBOT}={address} {STATION}"), 0);
    }
    let folder = robot.path("pki");
    let folder = folder.display();
    for (machine, name) in [(robot, ROBOT), (station, STATION)] {
        let certificates = format!(
            "[security]\nauthority = \"{folder}/ca.pem\"\ncertificate = \"{folder}/{name}.pem\"\nkey = \"{folder}/{name}-key.pem\"\n\
             robots = {{ {ROBOT} = 1 }}\n"
        );
        machine.write(
            "relay.toml",
            if is_encrypted { &certificates } else { OPEN },
        );
    }
}

/// A client at the station whose orders change nothing.
struct Operator {
    client: Client<ModuleControl>,
    _ipc: Ipc,
}

/// An order that was sent.
struct Ordered {
    id: u64,
    /// Until its final report.
    took: Duration,
    /// `None` if it had none in [`LONGEST`].
    end: Option<RequestReport>,
    /// Reports that belong to none of this client's orders.
    strays: usize,
}

impl Operator {
    fn join(domain: &Domain, robot: RobotId) -> Operator {
        let ipc = Ipc::join(domain, robot, "operator").expect("a part");
        Operator {
            client: ipc.client().expect("a client"),
            _ipc: ipc,
        }
    }

    /// Orders a stop, and waits for its final report; `None` if it could not be sent.
    fn order(&mut self) -> Option<Ordered> {
        let id = fresh_request_id();
        let sent = MonotonicNs::now();
        let stop = ModuleControl::new(id, ControlCommand::Stop);
        self.client.send(&stop).ok()?;
        let (mut end, mut strays) = (None, 0);
        loop {
            self.client.drain(|report| {
                let is_own = report.request_id == id;
                strays += usize::from(!is_own);
                end = end.or((is_own && report.is_final()).then_some(*report));
            });
            let took = MonotonicNs::now().since(sent);
            if end.is_some() || took >= LONGEST {
                return Some(Ordered {
                    id,
                    took,
                    end,
                    strays,
                });
            }
            self.client.wait(LONGEST - took).expect("a wait");
        }
    }
}
