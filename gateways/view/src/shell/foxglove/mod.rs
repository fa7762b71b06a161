//! [`Foxglove`]: what Foxglove and Lichtblick get of the robots.
//!
//! [`channels`]: the topics of processes; [`derived`]: those that are made here, of `geojson` among others.

mod channels;
mod derived;
mod geojson;

use operator::robot::clock::Clocks;

use self::channels::Channels;
use self::derived::Derived;
use super::fleet::Fleet;
use crate::Server;

/// What Foxglove clients get of the robots.
#[derive(Default)]
pub(crate) struct Foxglove {
    channels: Channels,
    derived: Derived,
}

impl Foxglove {
    /// Sends what has come of all robots.
    pub fn drain(&mut self, fleet: &mut Fleet, server: &mut Server, clock: Clocks) {
        for shown in fleet.iter_mut() {
            self.channels.drain(shown.ports.ipc(), server, clock);
            self.derived.drain(shown, server, clock);
        }
    }
}
