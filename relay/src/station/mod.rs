//! The station's side: it provides the services of robots on this machine, publishes what comes from them, and sends them the
//! requests of clients.
//!
//! [`Link`] is how the link to one robot is, [`Mirrors`] are its services here, [`orders::station`](crate::orders::station)
//! decides about requests; here bytes move.

pub mod link;
mod mirror;
mod remote;

use std::os::fd::BorrowedFd;

use ipc_types::{Domain, Ipc, MonotonicNs, RobotId, WaitError, Wake};
use module_kit::process::{Process, Sources};

use crate::Failure;
use crate::config::{Config, RemoteRobot};
use crate::network::{Network, Side};
use crate::ports::PortSet;
pub use link::Link;
pub use mirror::Mirrors;
use remote::Remote;

/// The station's side of the relay.
pub struct StationSide {
    network: Network,
    remotes: Vec<Remote>,
    /// The ports of all robots.
    ports: PortSet,
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
        })
    }
}

impl Process for StationSide {
    type Error = WaitError;
    type Key = ();

    fn sources<'a>(&'a mut self, sources: &mut Sources<'a>) {
        sources.descriptor((), self.network.descriptor());
        sources.descriptor((), self.ports.descriptor());
    }

    fn drain(&mut self, _wake: Wake) -> Result<(), WaitError> {
        self.network.drained();
        for remote in &mut self.remotes {
            remote.step(&self.network, MonotonicNs::now());
        }
        Ok(())
    }

    fn deadline(&self) -> Option<MonotonicNs> {
        self.remotes.iter().map(Remote::deadline).min()
    }
}
