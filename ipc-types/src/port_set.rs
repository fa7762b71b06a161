//! [`PortSet`]: one descriptor for any number of ports, so that one wait has room for all topics of a robot.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};

use rustix::event::epoll;
use rustix::io::Errno;

use crate::source::WaitError;

/// A descriptor that can be read when one of its members can. A [`Waiter`](crate::Waiter) takes 16 sources; a process that follows
/// every topic of a robot, as the relay and the recorder do, has one source with this.
#[derive(Debug)]
pub struct PortSet {
    set: OwnedFd,
}

impl PortSet {
    /// A set without members.
    ///
    /// # Errors
    ///
    /// When the process has too many descriptors.
    pub fn new() -> Result<PortSet, Errno> {
        Ok(PortSet {
            set: epoll::create(epoll::CreateFlags::CLOEXEC)?,
        })
    }

    /// Adds a member, a port's descriptor for example. Closing a member takes it out.
    ///
    /// # Errors
    ///
    /// When the port has no descriptor, or the kernel no room.
    pub fn add(&self, member: Result<BorrowedFd<'_>, WaitError>) -> Result<(), WaitError> {
        let data = epoll::EventData::new_u64(0);
        let added = epoll::add(&self.set, member?, data, epoll::EventFlags::IN);
        match added {
            Ok(()) | Err(Errno::EXIST) => Ok(()),
            Err(errno) => Err(WaitError::from(errno)),
        }
    }

    /// What to wait for.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.set.as_fd()
    }
}
