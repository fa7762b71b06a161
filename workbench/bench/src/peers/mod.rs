//! The ways in which one sample of telemetry can get from one process to another.
//!
//! Each is a file of its own behind two small traits, written as its users would write it: the library's own settings,
//! but for those that trade latency for throughput. The sample is a whole [`HeroTelemetry`] wherever the way can carry
//! one.

pub mod ends;
mod futex;
pub mod iceoryx2;
#[cfg(feature = "peers")]
mod mavlink_udp;
pub mod ours;
mod unix_json;
mod unix_socket;
#[cfg(feature = "peers")]
mod zenoh;
#[cfg(feature = "peers")]
mod zeromq;

pub use ends::{Mark, Receiver, Sender};
pub use futex::segment;

use std::fmt;
use std::path::Path;

use anyhow::Result;
use clap::ValueEnum;
use ipc_types::payload::HeroTelemetry;
use ipc_types::{SchedulingRole, request_slice};

/// A way from one process to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Peer {
    /// The typed subscriber of `ipc-types`, blocking, its thread to be woken promptly.
    Ours,
    /// The typed subscriber of `ipc-types`, blocking, its thread as the scheduler has it.
    OursLongSlice,
    /// The typed subscriber of `ipc-types` on a core of its own.
    OursSpin,
    /// The typed subscriber of `ipc-types`, waited for together with a file descriptor.
    OursDescriptor,
    /// iceoryx2 alone; the receiver asks all the time.
    IceoryxSpin,
    /// iceoryx2 alone with its default event; the receiver blocks on its listener.
    IceoryxEvent,
    /// Shared memory with a slot and a futex.
    Futex,
    /// Shared memory with a slot and a futex, the receiver to be woken promptly.
    FutexShortSlice,
    /// A Unix datagram socket that carries the struct as it is.
    UnixSocket,
    /// A Unix datagram socket that carries the struct as it is, the receiver to be woken promptly.
    UnixSocketShortSlice,
    /// A Unix datagram socket that carries JSON.
    UnixJson,
    /// MAVLink over UDP.
    #[cfg(feature = "peers")]
    MavlinkUdp,
    /// ZeroMQ, publish/subscribe over `ipc://`.
    #[cfg(feature = "peers")]
    ZeroMq,
    /// Zenoh, peer to peer over a Unix socket.
    #[cfg(feature = "peers")]
    Zenoh,
}

impl Peer {
    /// All of them, in the order of the tables.
    pub fn all() -> &'static [Peer] {
        Peer::value_variants()
    }

    /// The name on the command line.
    pub fn key(self) -> String {
        let value = self.to_possible_value();
        value.map_or_else(String::new, |value| value.get_name().to_owned())
    }

    /// The name in tables and plots.
    pub fn title(self) -> &'static str {
        match self {
            Peer::Ours => "RIL, blocking",
            Peer::OursLongSlice => "RIL, default slice",
            Peer::OursSpin => "RIL, spinning",
            Peer::OursDescriptor => "RIL, with a descriptor",
            Peer::IceoryxSpin => "iceoryx2, spinning",
            Peer::IceoryxEvent => "iceoryx2, default event",
            Peer::Futex => "shared memory + futex",
            Peer::FutexShortSlice => "futex, short slice",
            Peer::UnixSocket => "Unix socket, struct",
            Peer::UnixSocketShortSlice => "Unix socket, short slice",
            Peer::UnixJson => "Unix socket, JSON",
            #[cfg(feature = "peers")]
            Peer::MavlinkUdp => "MAVLink over UDP",
            #[cfg(feature = "peers")]
            Peer::ZeroMq => "ZeroMQ",
            #[cfg(feature = "peers")]
            Peer::Zenoh => "Zenoh",
        }
    }

    /// Whether it is ours.
    pub fn is_ours(self) -> bool {
        matches!(
            self,
            Peer::Ours | Peer::OursLongSlice | Peer::OursSpin | Peer::OursDescriptor
        )
    }

    /// Whether the receiver asks the scheduler for a short slice. Ours do, because our contract tells them to; two of the
    /// others are measured both ways.
    fn is_prompt(self) -> bool {
        matches!(
            self,
            Peer::Ours | Peer::OursDescriptor | Peer::FutexShortSlice | Peer::UnixSocketShortSlice
        )
    }

    /// The receiving end, which is made first. `site` is a folder that both ends know and nobody else uses.
    pub fn receiver(self, site: &Path) -> Result<Box<dyn Receiver>> {
        if self.is_prompt() {
            request_slice(SchedulingRole::Consumer);
        }
        Ok(match self {
            Peer::Ours | Peer::OursLongSlice => Box::new(ours::Blocking::<HeroTelemetry>::new()?),
            Peer::OursSpin => Box::new(ours::Spinning::new()?),
            Peer::OursDescriptor => Box::new(ours::Waiting::new()?),
            Peer::IceoryxSpin => Box::new(iceoryx2::Spinning::new()?),
            Peer::IceoryxEvent => Box::new(iceoryx2::Blocking::new()?),
            Peer::Futex | Peer::FutexShortSlice => Box::new(futex::Reader::new(site)?),
            Peer::UnixSocket | Peer::UnixSocketShortSlice => {
                Box::new(unix_socket::Receiver::new(site)?)
            }
            Peer::UnixJson => Box::new(unix_json::Receiver::new(site)?),
            #[cfg(feature = "peers")]
            Peer::MavlinkUdp => Box::new(mavlink_udp::Receiver::new(site)?),
            #[cfg(feature = "peers")]
            Peer::ZeroMq => Box::new(zeromq::Receiver::new(site)?),
            #[cfg(feature = "peers")]
            Peer::Zenoh => Box::new(zenoh::Receiver::new(site)?),
        })
    }

    /// The sending end, which is made when the receiving one is there.
    pub fn sender(self, site: &Path) -> Result<Box<dyn Sender>> {
        Ok(match self {
            Peer::Ours | Peer::OursLongSlice | Peer::OursSpin | Peer::OursDescriptor => {
                Box::new(ours::Sender::new()?)
            }
            Peer::IceoryxSpin => Box::new(iceoryx2::Sender::without_event()?),
            Peer::IceoryxEvent => Box::new(iceoryx2::Sender::with_event()?),
            Peer::Futex | Peer::FutexShortSlice => Box::new(futex::Writer::new(site)?),
            Peer::UnixSocket | Peer::UnixSocketShortSlice => {
                Box::new(unix_socket::Sender::new(site)?)
            }
            Peer::UnixJson => Box::new(unix_json::Sender::new(site)?),
            #[cfg(feature = "peers")]
            Peer::MavlinkUdp => Box::new(mavlink_udp::Sender::new(site)?),
            #[cfg(feature = "peers")]
            Peer::ZeroMq => Box::new(zeromq::Sender::new(site)?),
            #[cfg(feature = "peers")]
            Peer::Zenoh => Box::new(zenoh::Sender::new(site)?),
        })
    }
}

impl fmt::Display for Peer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.title())
    }
}
