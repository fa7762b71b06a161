//! [`Async`]: a port in the event loop of tokio. Only with the feature `tokio`.
//!
//! ```no_run
//! use ipc_types::{Async, Ipc, payload::HeroTelemetry};
//!
//! # async fn f() -> Result<(), Box<dyn std::error::Error>> {
//! let mut telemetry = Async::new(Ipc::connect("altimeter")?.subscriber::<HeroTelemetry>()?)?;
//! loop {
//!     println!("{:.1} m", telemetry.recv().await?.geodetic.altitude_m);
//! }
//! # }
//! ```
//!
//! Everything can be cancelled, and loses nothing by it: what was not handed on comes with the next call.

use std::io;
use std::os::fd::OwnedFd;

use rustix::io::Errno;
use tokio::io::Interest;
use tokio::io::unix::AsyncFd;

use crate::forked::Owned;
use crate::port::{Core, Port};
use crate::service::Topic;
use crate::subscriber::{ReceiveError, Subscriber};
use crate::waiter::{WaitError, sealed};

/// Something asynchronous failed.
#[derive(Debug, thiserror::Error)]
pub enum AsyncError {
    /// See [`ReceiveError`].
    #[error(transparent)]
    Receive(#[from] ReceiveError),
    /// The event loop has ended.
    #[error("the event loop has ended ({0})")]
    EventLoop(#[from] io::Error),
}

/// A port whose waits are those of tokio's event loop.
pub struct Async<P> {
    // First, so that the event loop lets go of the descriptor before the port closes what is behind it.
    readiness: Owned<AsyncFd<OwnedFd>>,
    port: P,
}

impl<C: Core, P> Async<Port<C, P>> {
    /// Gives the port to the event loop of the runtime that the caller runs in.
    ///
    /// # Errors
    ///
    /// When the process has too many descriptors, or there is no runtime with I/O.
    pub fn new(port: Port<C, P>) -> Result<Async<Port<C, P>>, WaitError> {
        let descriptor = port.descriptor()?.try_clone_to_owned().map_err(failed)?;
        // SAFETY: the descriptor is open, and nothing but the `AsyncFd` owns it, which never gives it out.
        #[allow(unsafe_code)]
        let readiness = unsafe { AsyncFd::register_with_interest(descriptor, Interest::READABLE) };
        let readiness = readiness.map_err(|error| failed(error.into()))?;
        let readiness = Owned::new(readiness);
        Ok(Async { readiness, port })
    }

    /// The port, to send with, and to look at.
    pub fn get(&self) -> &Port<C, P> {
        &self.port
    }

    /// The port, to send with, and to receive what is there already.
    pub fn get_mut(&mut self) -> &mut Port<C, P> {
        &mut self.port
    }

    /// Sleeps until `take` gives something: it is called at once, and then whenever the port may have something.
    ///
    /// # Errors
    ///
    /// When the event loop has ended.
    pub async fn until<T>(
        &mut self,
        mut take: impl FnMut(&mut Port<C, P>) -> Option<T>,
    ) -> io::Result<T> {
        loop {
            let mut guard = self.readiness.readable().await?;
            sealed::Source::service(&mut self.port);
            if let Some(taken) = take(&mut self.port) {
                // There may be more: the descriptor still counts as readable.
                return Ok(taken);
            }
            guard.clear_ready();
        }
    }
}

impl<T: Topic> Async<Subscriber<T>> {
    /// The oldest sample that was not handed on yet, once there is one.
    ///
    /// # Errors
    ///
    /// See [`AsyncError`]; the next call tries again.
    pub async fn recv(&mut self) -> Result<T, AsyncError> {
        let sample = self.until(|port| port.try_recv().transpose()).await?;
        Ok(sample?)
    }
}

fn failed(error: io::Error) -> WaitError {
    let errno = error.raw_os_error().map(Errno::from_raw_os_error);
    WaitError::Failed(errno.unwrap_or(Errno::IO))
}
