//! [`Sockets`]: the listeners and all connections in one epoll descriptor, which is one source of the process's wait.
//! Nothing here blocks.
//!
//! One port speaks both HTTP and TLS: the first byte says which. Where there is TLS, other machines are not served
//! without it.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{IpAddr, SocketAddr, TcpListener, TcpStream};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::time::Duration;

use rustix::event::{Timespec, epoll};
use rustix::io::Errno;
use socket2::{Domain, SockRef, Socket, Type};

use super::tls::{HANDSHAKE, Tls, TlsSession};
use crate::PLAIN;
use crate::config::MAX_LIST;

/// What the kernel may hold of a connection and has not sent: a viewer on a slow line gets what is new when the line is
/// free, not what was new when it was full.
const NOT_SENT_BYTES: u32 = 16 << 10;

/// How long sent bytes may stay without an acknowledgement before the connection is dropped.
const USER_TIMEOUT: Duration = Duration::from_secs(15);

/// Connections that are accepted at one wake; the others are accepted at the next, behind what the connected ones send.
const MAX_ACCEPTED: usize = 32;

/// Bytes that are read of one connection at one wake, so that none keeps the others waiting.
const READ_BYTES: usize = 16 << 10;

/// Events that are taken at one wake: all connections that there can be, and the listeners.
const MAX_EVENTS: usize = 256;

/// Connections that wait to be accepted, in the kernel.
const BACKLOG: i32 = 128;

/// The first key of a connection. Below are those of the listeners, loopback's among them.
const FIRST_CONNECTION: u64 = MAX_LIST as u64 + 1;

/// What a connection is called here.
pub(crate) type ConnectionKey = u64;

/// What came of a connection.
pub(crate) enum Arrived<'a> {
    /// Bytes, which TLS has hidden on their way if it `is_encrypted`.
    Bytes { bytes: &'a [u8], is_encrypted: bool },
    /// Its end.
    End,
}

/// A connection that came.
pub(crate) struct Accepted {
    pub key: ConnectionKey,
    pub peer: SocketAddr,
    pub own: SocketAddr,
}

/// What a connection speaks below HTTP.
enum Layer {
    /// Its first byte has not come.
    Unknown,
    Plain,
    Tls(TlsSession),
}

/// The listeners and all connections in one epoll descriptor.
pub(crate) struct Sockets {
    epoll: OwnedFd,
    listeners: Vec<TcpListener>,
    tls: Option<Tls>,
    /// Closed when there is no other descriptor left, so that a connection can be accepted and closed. `None` if it
    /// could not be opened again: until then no connection is accepted.
    spare: Option<File>,
    is_listening: bool,
    connections: BTreeMap<ConnectionKey, Connection>,
    next_key: ConnectionKey,
    /// Connections that came at this wake.
    came: usize,
    /// Connections that were closed at once because there was no descriptor for them.
    turned_away: u64,
}

struct Connection {
    stream: TcpStream,
    peer: IpAddr,
    layer: Layer,
    /// Whether the kernel is asked when the next bytes can be written.
    waits_to_write: bool,
}

impl Sockets {
    /// Listens at `addresses`, [`MAX_LIST`] and loopback at most. Gives the address that cannot be used, and why.
    pub fn listen(
        addresses: &[SocketAddr],
        tls: Option<Tls>,
    ) -> Result<Sockets, (SocketAddr, io::Error)> {
        let bound = addresses
            .iter()
            .map(|address| listener(*address).map_err(|error| (*address, error)));
        let listeners = bound.collect::<Result<Vec<_>, _>>()?;
        let first = addresses[0];
        Sockets::of(listeners, tls).map_err(|error| (first, error))
    }

    fn of(listeners: Vec<TcpListener>, tls: Option<Tls>) -> io::Result<Sockets> {
        let sockets = Sockets {
            epoll: epoll::create(epoll::CreateFlags::CLOEXEC)?,
            spare: Some(spare()?),
            listeners,
            tls,
            is_listening: true,
            connections: BTreeMap::new(),
            next_key: FIRST_CONNECTION,
            came: 0,
            turned_away: 0,
        };
        for (key, listener) in (0..).zip(&sockets.listeners) {
            let data = epoll::EventData::new_u64(key);
            epoll::add(&sockets.epoll, listener, data, epoll::EventFlags::IN)?;
        }
        Ok(sockets)
    }

    /// What to wait for.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.epoll.as_fd()
    }

    /// The connections that have something to read, and whether someone wants to connect.
    pub fn ready(&mut self) -> io::Result<(Vec<ConnectionKey>, bool)> {
        let mut events = Vec::with_capacity(MAX_EVENTS);
        let at_once = Timespec::default();
        let spare = rustix::buffer::spare_capacity(&mut events);
        match epoll::wait(&self.epoll, spare, Some(&at_once)) {
            Ok(_) | Err(Errno::INTR) => {}
            Err(error) => return Err(error.into()),
        }
        self.came = 0;
        let mut readable = Vec::new();
        let mut wants_to_connect = false;
        for event in &events {
            // What can be written is written at the end of each wake, whatever woke.
            let flags = event.flags;
            let comes = epoll::EventFlags::IN | epoll::EventFlags::HUP | epoll::EventFlags::ERR;
            match event.data.u64() {
                ..FIRST_CONNECTION => wants_to_connect = true,
                key if flags.intersects(comes) => readable.push(key),
                _ => {}
            }
        }
        Ok((readable, wants_to_connect))
    }

    /// Accepts the next connection; `None` if there is none, or enough came at this wake.
    pub fn accept(&mut self) -> Option<Accepted> {
        (0..self.listeners.len()).find_map(|index| self.accept_at(index))
    }

    fn accept_at(&mut self, index: usize) -> Option<Accepted> {
        while self.came < MAX_ACCEPTED {
            self.came += 1;
            match self.listeners[index].accept() {
                Ok((stream, peer)) => match self.add(stream, peer) {
                    Ok(accepted) => return Some(accepted),
                    Err(error) => tracing::debug!(%error, "a connection that came is gone"),
                },
                Err(error) if error.kind() == ErrorKind::WouldBlock => return None,
                Err(error) if is_out_of_descriptors(&error) => {
                    if !self.turn_away(index) {
                        return None;
                    }
                }
                Err(error) => {
                    // Of a connection that was given up before it was accepted; the listener goes on.
                    tracing::debug!(%error, "a connection could not be accepted");
                    return None;
                }
            }
        }
        None
    }

    fn add(&mut self, stream: TcpStream, peer: SocketAddr) -> io::Result<Accepted> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        let socket = SockRef::from(&stream);
        socket.set_tcp_notsent_lowat(NOT_SENT_BYTES)?;
        socket.set_tcp_user_timeout(Some(USER_TIMEOUT))?;
        let own = stream.local_addr()?;
        let key = self.next_key;
        let data = epoll::EventData::new_u64(key);
        epoll::add(&self.epoll, &stream, data, epoll::EventFlags::IN)?;
        self.next_key += 1;
        let waits_to_write = false;
        self.connections.insert(
            key,
            Connection {
                stream,
                peer: peer.ip().to_canonical(),
                layer: Layer::Unknown,
                waits_to_write,
            },
        );
        Ok(Accepted { key, peer, own })
    }

    /// Gives the spare descriptor away to accept a connection and close it. Says whether that can be done again.
    fn turn_away(&mut self, index: usize) -> bool {
        self.turned_away += 1;
        // One line for each doubling: a flood of connections must not fill the log.
        if self.turned_away.is_power_of_two() {
            let count = self.turned_away;
            tracing::warn!(
                count,
                "no file descriptor is left: connections are turned away"
            );
        }
        self.spare = None;
        let turned_away = self.listeners[index].accept().is_ok();
        self.spare = spare().ok();
        if self.spare.is_none() {
            self.set_listening(false);
        }
        turned_away && self.spare.is_some()
    }

    /// Accepts again after all descriptors were used up; to be called now and then.
    pub fn recover(&mut self) {
        if !self.is_listening {
            self.spare = spare().ok();
            self.set_listening(self.spare.is_some());
        }
    }

    fn set_listening(&mut self, is_listening: bool) {
        let flags = match is_listening {
            true => epoll::EventFlags::IN,
            false => epoll::EventFlags::empty(),
        };
        let mut is_set = true;
        for (key, listener) in (0..).zip(&self.listeners) {
            let data = epoll::EventData::new_u64(key);
            is_set &= epoll::modify(&self.epoll, listener, data, flags).is_ok();
        }
        self.is_listening = is_listening && is_set;
    }

    /// Reads what came of a connection, at most [`READ_BYTES`], or a record of TLS: the rest wakes again. `None` if
    /// nothing came.
    pub fn read<'a>(&mut self, key: ConnectionKey, buffer: &'a mut Vec<u8>) -> Option<Arrived<'a>> {
        let connection = self.connections.get_mut(&key)?;
        match connection.read(self.tls.as_ref(), buffer) {
            Ok(false) => Some(Arrived::End),
            Ok(true) => Some(Arrived::Bytes {
                bytes: buffer,
                is_encrypted: matches!(connection.layer, Layer::Tls(_)),
            }),
            Err(error) if is_for_later(&error) => None,
            Err(error) => {
                tracing::debug!(%error, peer = %connection.peer, "a connection broke");
                Some(Arrived::End)
            }
        }
    }

    /// Writes what the kernel takes, and says how much that was; `None` if the connection has ended.
    pub fn write(&mut self, key: ConnectionKey, bytes: &[u8]) -> Option<usize> {
        let connection = self.connections.get_mut(&key)?;
        let written = match &mut connection.layer {
            Layer::Tls(session) => session.write(&mut connection.stream, bytes),
            _ => connection.stream.write(bytes),
        };
        match written {
            Ok(count) => Some(count),
            Err(error) if is_for_later(&error) => Some(0),
            Err(_) => None,
        }
    }

    /// Whether all that was written is gone to the kernel; `None` if the connection has ended.
    pub fn flush(&mut self, key: ConnectionKey) -> Option<bool> {
        let connection = self.connections.get_mut(&key)?;
        match &mut connection.layer {
            Layer::Tls(session) => session.flush(&mut connection.stream).ok(),
            _ => Some(true),
        }
    }

    /// Whether the process is to be woken when the connection can be written to.
    pub fn wait_to_write(&mut self, key: ConnectionKey, waits: bool) {
        let Some(connection) = self.connections.get_mut(&key) else {
            return;
        };
        if connection.waits_to_write != waits {
            let flags = match waits {
                true => epoll::EventFlags::IN | epoll::EventFlags::OUT,
                false => epoll::EventFlags::IN,
            };
            let data = epoll::EventData::new_u64(key);
            let set = epoll::modify(&self.epoll, &connection.stream, data, flags);
            connection.waits_to_write = waits && set.is_ok();
        }
    }

    /// Closes a connection, which takes it out of the wait.
    pub fn close(&mut self, key: ConnectionKey) {
        self.connections.remove(&key);
    }
}

impl Connection {
    /// Reads what has come. False at the end.
    fn read(&mut self, tls: Option<&Tls>, buffer: &mut Vec<u8>) -> io::Result<bool> {
        if matches!(self.layer, Layer::Unknown) {
            let mut first = [0];
            if self.stream.peek(&mut first)? == 0 {
                return Ok(false);
            }
            self.layer = match tls {
                Some(tls) if first == [HANDSHAKE] => Layer::Tls(tls.session()?),
                _ => Layer::Plain,
            };
            let must_hide = tls.is_some() && !self.peer.is_loopback();
            if must_hide && matches!(self.layer, Layer::Plain) {
                // What came is read, so that the end does not take the answer back.
                buffer.resize(READ_BYTES, 0);
                let _ = self.stream.read(buffer)?;
                let _ = self.stream.write(PLAIN)?;
                return Ok(false);
            }
        }
        match &mut self.layer {
            Layer::Tls(session) => session.read(&mut self.stream, buffer),
            _ => {
                buffer.resize(READ_BYTES, 0);
                let count = self.stream.read(buffer)?;
                buffer.truncate(count);
                Ok(count > 0)
            }
        }
    }
}

/// Listens at an address, which may come later, as that of a Wi-Fi that is not there at boot.
fn listener(address: SocketAddr) -> io::Result<TcpListener> {
    let socket = Socket::new(Domain::for_address(address), Type::STREAM, None)?;
    socket.set_nonblocking(true)?;
    socket.set_reuse_address(true)?;
    match address {
        SocketAddr::V4(_) => socket.set_freebind_v4(true)?,
        SocketAddr::V6(_) => {
            // Otherwise `::` would be all of IPv4 as well, loopback's listener included.
            socket.set_only_v6(true)?;
            socket.set_freebind_v6(true)?;
        }
    }
    socket.bind(&address.into())?;
    socket.listen(BACKLOG)?;
    Ok(socket.into())
}

fn spare() -> io::Result<File> {
    File::open("/dev/null")
}

fn is_for_later(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

fn is_out_of_descriptors(error: &io::Error) -> bool {
    let errno = error.raw_os_error().map(Errno::from_raw_os_error);
    matches!(errno, Some(Errno::MFILE | Errno::NFILE))
}
