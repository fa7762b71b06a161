//! The ways in which one sample of telemetry can get from one process to another.
//!
//! Each is a function for the sender and one for the receiver, written as its users would write them: the library's own
//! settings, but for those that trade latency for throughput. The sample is a whole [`HeroTelemetry`] wherever the way
//! can carry one.

pub mod ends;
mod futex;
pub mod iceoryx2;
#[cfg(feature = "peers")]
pub mod network;

use std::fmt;
use std::os::fd::AsFd;
use std::os::unix::net::{UnixDatagram, UnixStream};
use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::ValueEnum;
use ipc_types::payload::{HeroTelemetry, SharedStruct};
use ipc_types::{Descriptor, Domain, Ipc, RobotId, SchedulingRole, Waiter, request_slice};

pub use ends::{Mark, Receive, Send, TIMEOUT};
pub use futex::segment;

use ends::SOCKET;

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
    /// A Unix datagram socket that carries the struct as it is.
    UnixSocket,
    /// MAVLink over UDP.
    #[cfg(feature = "peers")]
    MavlinkUdp,
    /// Zenoh, peer to peer over a Unix socket.
    #[cfg(feature = "peers")]
    Zenoh,
}

impl Peer {
    /// The name on the command line.
    pub fn key(self) -> String {
        let value = self.to_possible_value();
        value.map_or_else(String::new, |value| value.get_name().to_owned())
    }

    /// Whether it is ours.
    pub fn is_ours(self) -> bool {
        use Peer::{Ours, OursDescriptor, OursLongSlice, OursSpin};
        matches!(self, Ours | OursLongSlice | OursSpin | OursDescriptor)
    }

    /// The receiving end, which is made first.
    pub fn receiver(self) -> Result<Receive> {
        // Ours ask the scheduler for a short slice, because our contract tells them to.
        if matches!(self, Peer::Ours | Peer::OursDescriptor) {
            request_slice(SchedulingRole::Consumer);
        }
        match self {
            Peer::Ours | Peer::OursLongSlice => blocking(),
            Peer::OursSpin => spinning(),
            Peer::OursDescriptor => with_descriptor(),
            Peer::IceoryxSpin => iceoryx2::spinning(),
            Peer::IceoryxEvent => iceoryx2::blocking(),
            Peer::Futex => futex::receiver(),
            Peer::UnixSocket => socket_receiver(),
            #[cfg(feature = "peers")]
            Peer::MavlinkUdp => network::mavlink_receiver(),
            #[cfg(feature = "peers")]
            Peer::Zenoh => network::zenoh_receiver(),
        }
    }

    /// The sending end, which is made when the receiving one is there.
    pub fn sender(self) -> Result<Send> {
        match self {
            ours if ours.is_ours() => publishing(),
            Peer::IceoryxSpin => iceoryx2::sender(false),
            Peer::IceoryxEvent => iceoryx2::sender(true),
            Peer::Futex => futex::sender(),
            #[cfg(feature = "peers")]
            Peer::MavlinkUdp => network::mavlink_sender(),
            #[cfg(feature = "peers")]
            Peer::Zenoh => network::zenoh_sender(),
            _ => socket_sender(),
        }
    }
}

impl fmt::Display for Peer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Peer::Ours => "RIL, blocking",
            Peer::OursLongSlice => "RIL, default slice",
            Peer::OursSpin => "RIL, spinning",
            Peer::OursDescriptor => "RIL, with a descriptor",
            Peer::IceoryxSpin => "iceoryx2, spinning",
            Peer::IceoryxEvent => "iceoryx2, default event",
            Peer::Futex => "shared memory + futex",
            Peer::UnixSocket => "Unix socket, struct",
            #[cfg(feature = "peers")]
            Peer::MavlinkUdp => "MAVLink over UDP",
            #[cfg(feature = "peers")]
            Peer::Zenoh => "Zenoh",
        })
    }
}

/// Joins the domain of the environment as robot 1.
pub fn join(process: &str) -> Result<Ipc> {
    let domain = Domain::from_environment()?;
    Ok(Ipc::join(&domain, RobotId::DEFAULT, process)?)
}

/// Publishes robot telemetry as status does.
fn publishing() -> Result<Send> {
    let mut publisher = join("bench-sender")?.publisher::<HeroTelemetry>()?;
    Ok(Box::new(move |sample| {
        publisher.publish(|slot| *slot = *sample)?;
        Ok(())
    }))
}

/// A consumer that does nothing else.
fn blocking() -> Result<Receive> {
    let mut subscriber = join("bench-receiver")?.subscriber::<HeroTelemetry>()?;
    Ok(Box::new(move |take| {
        subscriber.wait(TIMEOUT)?;
        subscriber.drain(|sample| take(Mark::of(sample)))?;
        Ok(())
    }))
}

/// A consumer with a core of its own.
fn spinning() -> Result<Receive> {
    let mut subscriber = join("bench-receiver")?.subscriber::<HeroTelemetry>()?;
    Ok(Box::new(move |take| {
        subscriber.spin(TIMEOUT);
        subscriber.drain(|sample| take(Mark::of(sample)))?;
        Ok(())
    }))
}

/// A consumer that waits for a file descriptor as well, which never becomes readable here.
fn with_descriptor() -> Result<Receive> {
    let mut subscriber = join("bench-receiver")?.subscriber::<HeroTelemetry>()?;
    let waiter = Waiter::new();
    let (other, far_end) = UnixStream::pair()?;
    Ok(Box::new(move |take| {
        // It would be readable if the far end were closed.
        let _open = &far_end;
        let mut other = Descriptor::new(other.as_fd());
        waiter.wait(
            &mut [((), &mut subscriber), ((), &mut other)],
            Some(TIMEOUT),
        )?;
        subscriber.drain(|sample| take(Mark::of(sample)))?;
        Ok(())
    }))
}

fn socket_sender() -> Result<Send> {
    let socket = UnixDatagram::unbound()?;
    socket.connect(SOCKET)?;
    Ok(Box::new(move |sample| {
        socket.send(sample.bytes())?;
        Ok(())
    }))
}

fn socket_receiver() -> Result<Receive> {
    let socket = UnixDatagram::bind(PathBuf::from(SOCKET))?;
    socket.set_read_timeout(Some(TIMEOUT))?;
    Ok(Box::new(move |take| {
        let mut bytes = [0; size_of::<HeroTelemetry>()];
        let count = socket.recv(&mut bytes)?;
        let sample = HeroTelemetry::from_bytes(&bytes[..count]).context("another message")?;
        take(Mark::of(&sample));
        Ok(())
    }))
}
