//! [`StampedSocket`]: a UDP socket that says of each datagram when the kernel received it, so that a process which
//! stood still does not take for new what has waited in the socket.
//!
//! The kernel stamps by the wall clock (`SO_TIMESTAMPNS`). The stamp is turned into a moment of `CLOCK_MONOTONIC` by
//! its age, and kept between two moments that are certain: a datagram came after the socket was last seen empty, and
//! before it is read. So a wall clock that is set meanwhile makes no datagram older than that. The kernel begins to
//! stamp a moment after the first socket of the machine has asked for it; what comes before that counts from when it is
//! read.

use std::io::{self, ErrorKind};
use std::mem;
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr, SocketAddrV6, UdpSocket};
use std::os::fd::{AsFd, AsRawFd, BorrowedFd};
use std::time::Duration;

use rustix::time::{ClockId, Timespec, clock_gettime};

/// A UDP socket that says of each datagram when the kernel received it. It never waits.
#[derive(Debug)]
pub struct StampedSocket {
    socket: UdpSocket,
    /// When it was last seen empty, in `CLOCK_MONOTONIC`.
    empty_at: Duration,
}

/// A datagram that was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Datagram {
    /// How many bytes of the buffer it has; what is longer is cut off.
    pub length: usize,
    /// Who has sent it.
    pub from: SocketAddr,
    /// When the kernel received it, in `CLOCK_MONOTONIC`.
    pub came: Duration,
}

impl StampedSocket {
    /// Binds a socket.
    ///
    /// # Errors
    ///
    /// Those of the operating system, such as that the port is in use.
    pub fn bind(address: SocketAddr) -> io::Result<StampedSocket> {
        let socket = UdpSocket::bind(address)?;
        socket.set_nonblocking(true)?;
        ask_for_stamps(&socket)?;
        Ok(StampedSocket {
            socket,
            empty_at: now(ClockId::Monotonic),
        })
    }

    /// The address that it is bound to.
    ///
    /// # Errors
    ///
    /// Those of the operating system.
    pub fn local_addr(&self) -> io::Result<SocketAddr> {
        self.socket.local_addr()
    }

    /// Sends a datagram.
    ///
    /// # Errors
    ///
    /// `WouldBlock` if the socket is full, and others of the operating system.
    pub fn send_to(&self, bytes: &[u8], to: SocketAddr) -> io::Result<usize> {
        self.socket.send_to(bytes, to)
    }

    /// Reads the oldest datagram that waits.
    ///
    /// # Errors
    ///
    /// `WouldBlock` if none waits; others are about what was sent before, such as that its receiver is gone.
    pub fn receive(&mut self, buffer: &mut [u8]) -> io::Result<Datagram> {
        let before = now(ClockId::Monotonic);
        match receive(&self.socket, buffer) {
            Ok((length, from, stamp)) => {
                let read = now(ClockId::Monotonic);
                let age = stamp.map(|stamp| now(ClockId::Realtime).saturating_sub(stamp));
                let came = read.saturating_sub(age.unwrap_or_default());
                Ok(Datagram {
                    length,
                    from,
                    came: came.clamp(self.empty_at.min(read), read),
                })
            }
            Err(error) => {
                if error.kind() == ErrorKind::WouldBlock {
                    self.empty_at = before;
                }
                Err(error)
            }
        }
    }
}

/// Readable when a datagram waits.
impl AsFd for StampedSocket {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }
}

fn now(clock: ClockId) -> Duration {
    let Timespec { tv_sec, tv_nsec } = clock_gettime(clock);
    duration(tv_sec, i128::from(tv_nsec))
}

/// A time of the kernel; one before 1970 is none.
fn duration(seconds: i64, nanoseconds: i128) -> Duration {
    let nanoseconds = u32::try_from(nanoseconds).unwrap_or(0).min(999_999_999);
    Duration::new(u64::try_from(seconds).unwrap_or(0), nanoseconds)
}

#[allow(unsafe_code)]
fn ask_for_stamps(socket: &UdpSocket) -> io::Result<()> {
    let on: libc::c_int = 1;
    // SAFETY: the kernel reads the one integer, whose length it is told, and the socket is open.
    let result = unsafe {
        libc::setsockopt(
            socket.as_raw_fd(),
            libc::SOL_SOCKET,
            libc::SO_TIMESTAMPNS,
            (&raw const on).cast(),
            size_of_val(&on) as libc::socklen_t,
        )
    };
    match result {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}

/// Length, sender, and the kernel's stamp.
#[allow(unsafe_code)]
fn receive(
    socket: &UdpSocket,
    buffer: &mut [u8],
) -> io::Result<(usize, SocketAddr, Option<Duration>)> {
    // SAFETY: zeros are a value of each of these structures of C.
    let (mut name, mut message): (libc::sockaddr_storage, libc::msghdr) =
        unsafe { (mem::zeroed(), mem::zeroed()) };
    let mut place = libc::iovec {
        iov_base: buffer.as_mut_ptr().cast(),
        iov_len: buffer.len(),
    };
    // More than one stamp with its header, aligned as headers are.
    let mut control = [0_u64; 16];
    message.msg_name = (&raw mut name).cast();
    message.msg_namelen = size_of_val(&name) as libc::socklen_t;
    message.msg_iov = &raw mut place;
    message.msg_iovlen = 1;
    message.msg_control = control.as_mut_ptr().cast();
    message.msg_controllen = size_of_val(&control) as _;
    // SAFETY: all that the message points to lives until the end of this function, with the lengths that it says.
    let length = unsafe { libc::recvmsg(socket.as_raw_fd(), &raw mut message, 0) };
    let length = usize::try_from(length).map_err(|_| io::Error::last_os_error())?;
    let mut stamp = None;
    // SAFETY: the macros walk the headers that the kernel has written, within the length that it has set; a header of
    // this kind is followed by a time, which is read wherever it lies. A name of this family is a structure of this
    // type, which the storage has room for.
    let from = unsafe {
        let mut header = libc::CMSG_FIRSTHDR(&raw const message);
        while let Some(found) = header.as_ref() {
            if (found.cmsg_level, found.cmsg_type) == (libc::SOL_SOCKET, libc::SCM_TIMESTAMPNS) {
                let time = libc::CMSG_DATA(header).cast::<libc::timespec>();
                let libc::timespec { tv_sec, tv_nsec } = time.read_unaligned();
                #[allow(clippy::useless_conversion)]
                let (seconds, nanoseconds) = (i64::from(tv_sec), i128::from(tv_nsec));
                stamp = Some(duration(seconds, nanoseconds));
            }
            header = libc::CMSG_NXTHDR(&raw const message, header);
        }
        match i32::from(name.ss_family) {
            libc::AF_INET => {
                let name = *(&raw const name).cast::<libc::sockaddr_in>();
                let ip = Ipv4Addr::from(u32::from_be(name.sin_addr.s_addr));
                Some(SocketAddr::from((ip, u16::from_be(name.sin_port))))
            }
            libc::AF_INET6 => {
                let name = *(&raw const name).cast::<libc::sockaddr_in6>();
                let (ip, port) = (Ipv6Addr::from(name.sin6_addr.s6_addr), name.sin6_port);
                let (flow, scope) = (name.sin6_flowinfo, name.sin6_scope_id);
                Some(SocketAddrV6::new(ip, u16::from_be(port), flow, scope).into())
            }
            _ => None,
        }
    };
    let from = from.ok_or(ErrorKind::InvalidData)?;
    Ok((length, from, stamp))
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{RecvTimeoutError, channel};

    use super::*;

    fn receive(socket: &mut StampedSocket) -> (Datagram, Vec<u8>) {
        let mut buffer = [0; 8];
        loop {
            match socket.receive(&mut buffer) {
                Ok(datagram) => return (datagram, buffer[..datagram.length].to_vec()),
                Err(error) => assert_eq!(error.kind(), ErrorKind::WouldBlock),
            }
        }
    }

    /// This process stands still; nothing ever comes over the channel.
    fn stand_still(ms: u64) {
        let (_keep, nothing) = channel::<()>();
        let stood_still = nothing.recv_timeout(Duration::from_millis(ms));
        assert_eq!(stood_still, Err(RecvTimeoutError::Timeout));
    }

    /// Returns when the kernel stamps what comes.
    fn await_stamps(socket: &mut StampedSocket, sender: &UdpSocket, to: SocketAddr) {
        loop {
            sender.send_to(b"probe", to).unwrap();
            stand_still(20);
            let (probe, _) = receive(socket);
            if probe.came + Duration::from_millis(10) < now(ClockId::Monotonic) {
                return;
            }
        }
    }

    #[test]
    fn a_datagram_is_as_old_as_the_time_for_which_it_has_waited() {
        for loopback in ["127.0.0.1:0", "[::1]:0"] {
            let address: SocketAddr = loopback.parse().unwrap();
            let (Ok(mut socket), Ok(sender)) =
                (StampedSocket::bind(address), UdpSocket::bind(address))
            else {
                assert!(address.is_ipv6(), "this machine has no IPv6");
                continue;
            };
            let to = socket.local_addr().unwrap();
            await_stamps(&mut socket, &sender, to);
            let mut none = [0; 8];
            let empty = socket.receive(&mut none).unwrap_err();
            assert_eq!(empty.kind(), ErrorKind::WouldBlock);
            let sent = now(ClockId::Monotonic);
            sender.send_to(b"first", to).unwrap();
            stand_still(300);
            let resumed = now(ClockId::Monotonic);
            sender.send_to(b"second", to).unwrap();
            let (first, bytes) = receive(&mut socket);
            assert_eq!(
                (first.from, &bytes[..]),
                (sender.local_addr().unwrap(), &b"first"[..])
            );
            // A clock that is slewed between two readings of it is a little off.
            let slack = Duration::from_millis(50);
            assert!(
                first.came + slack > sent && first.came < resumed,
                "{first:?}"
            );
            let (second, bytes) = receive(&mut socket);
            assert_eq!(bytes, b"second");
            assert!(second.came + slack > resumed, "{second:?}");
        }
    }
}
