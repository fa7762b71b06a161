//! The station's side: it provides the services of robots on this machine, publishes what comes from them, and sends them the
//! requests of clients.
//!
//! [`Link`] is how the link to one robot is, [`Mirrors`] are its services here, [`orders::station`](crate::orders::station)
//! decides about requests; here bytes move.

pub mod catalog;
pub mod link;
mod mirrors;
pub mod moments;
mod remote;

use std::os::fd::BorrowedFd;

use ipc_types::waiter::SAFETY_BOUND;
use ipc_types::{Domain, Ipc, MonotonicNs, PortSet, RobotId, WaitError, Wake};
use module_kit::process::{Process, Sources};

use crate::Failure;
use crate::config::{Config, RemoteRobot, Side};
use crate::network::Network;
pub use link::Link;
pub use mirrors::Mirrors;
use remote::Remote;

/// What wakes the station's side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Source {
    /// A port of a robot's services on this machine.
    #[default]
    Port,
    /// Something from a robot.
    Network,
}

/// The station's side of the relay.
pub struct StationSide {
    network: Network,
    remotes: Vec<Remote>,
    /// The ports of all robots.
    ports: PortSet,
    /// When all ports are looked at though none has woken the process, because a wake-up can be lost.
    next_look: MonotonicNs,
}

impl StationSide {
    /// Opens the ports and the network. `robots` are those of the configuration, or the one of the command line.
    ///
    /// # Errors
    ///
    /// Another relay provides one of the robots here, or shared memory or the network cannot be used.
    pub fn open(
        domain: &Domain,
        robots: &[RemoteRobot],
        name: &str,
        config: &Config,
        end: BorrowedFd<'_>,
    ) -> Result<StationSide, Failure> {
        let mut joined = Vec::new();
        for robot in robots {
            joined.push((
                *robot,
                Ipc::join(domain, RobotId::from(robot.here()), "relay")?,
            ));
        }
        let network = Network::open(config, Side::Station, end)?;
        let ports = PortSet::new()?;
        let mut remotes = Vec::new();
        for (robot, ipc) in joined {
            let remote = Remote::open(robot, ipc, name, config, &network)?;
            for port in remote.ports() {
                ports.add(port)?;
            }
            remotes.push(remote);
        }
        Ok(StationSide {
            network,
            remotes,
            ports,
            next_look: MonotonicNs(0),
        })
    }
}

impl Process for StationSide {
    type Error = WaitError;
    type Key = Source;

    fn sources<'a>(&'a mut self, sources: &mut Sources<'a, Source>) {
        sources.descriptor(Source::Network, self.network.descriptor());
        sources.descriptor(Source::Port, self.ports.descriptor());
    }

    fn drain(&mut self, wake: Wake<Source>) -> Result<(), WaitError> {
        self.network.drained();
        // A look at a port takes two system calls, and a sample of one robot would pay for the ports of all.
        let now = MonotonicNs::now();
        let looks = !wake.is_only(Source::Network) || now >= self.next_look;
        if looks {
            self.next_look = now + SAFETY_BOUND;
        }
        for remote in &mut self.remotes {
            remote.step(&self.network, MonotonicNs::now(), looks);
        }
        Ok(())
    }

    fn deadline(&self) -> Option<MonotonicNs> {
        self.remotes.iter().map(Remote::deadline).min()
    }
}
