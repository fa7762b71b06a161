//! Who is at the other end of a connection: the user of a loopback peer, as `/proc/net/tcp` names it.
//!
//! A loopback port is open to every user of the machine. A peer of another machine, or of another network namespace
//! such as a container's, is not in the table and is no own user.

use std::collections::HashSet;
use std::fs::{self, File};
use std::io::Read;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::path::{Path, PathBuf};

use operator::robot::domain::{PROC, open_files};

/// Most bytes that are read of a table: 55,000 connections. What lies beyond is not found, and so is not taken for this
/// user's.
const MAX_TABLE_BYTES: u64 = 8 << 20;

/// The state of a socket that listens, as the kernel numbers it.
const LISTENS: u8 = 0x0a;

/// A row of the table.
struct SocketRow {
    local: SocketAddr,
    remote: SocketAddr,
    state: u8,
    uid: u32,
    inode: u64,
}

/// The connections of this user's processes: local and remote address. Read once for all connections that came
/// together, because a table is as long as the machine has connections.
pub(crate) struct OwnConnections(HashSet<(SocketAddr, SocketAddr)>);

impl OwnConnections {
    /// The connections at this moment.
    pub fn read() -> OwnConnections {
        let uid = rustix::process::getuid().as_raw();
        OwnConnections(tables().flat_map(|table| of_user(&table, uid)).collect())
    }

    /// Whether the process at the other end of the connection from `peer` to `own` is this user's.
    pub fn has(&self, peer: SocketAddr, own: SocketAddr) -> bool {
        peer.ip().to_canonical().is_loopback()
            && self.0.contains(&(canonical(peer), canonical(own)))
    }
}

/// Who listens at `port`, in words; `None` if no process does.
pub fn holder(port: u16) -> Option<String> {
    let (uid, inode) = tables().find_map(|table| {
        let mut rows = rows(&table);
        rows.find(|row| row.state == LISTENS && row.local.port() == port)
            .map(|row| (row.uid, row.inode))
    })?;
    Some(match process_with(inode) {
        Some((pid, name)) => format!("{name} (process {pid})"),
        None => format!("a process of user {uid}"),
    })
}

/// The process that has the socket of this inode open, and its name; those of other users cannot be looked at.
fn process_with(inode: u64) -> Option<(u32, String)> {
    let socket = PathBuf::from(format!("socket:[{inode}]"));
    let processes = fs::read_dir(PROC).ok()?.flatten();
    processes.into_iter().find_map(|process| {
        let pid: u32 = process.file_name().to_str()?.parse().ok()?;
        let open = open_files(&process.path()).ok()?;
        open.iter().find(|(_, path)| *path == socket)?;
        let name = fs::read_to_string(process.path().join("comm")).ok()?;
        Some((pid, name.trim_end().to_owned()))
    })
}

fn tables() -> impl Iterator<Item = String> {
    ["net/tcp", "net/tcp6"].into_iter().filter_map(|name| {
        let mut table = String::new();
        let file = File::open(Path::new(PROC).join(name)).ok()?;
        let mut file = file.take(MAX_TABLE_BYTES);
        file.read_to_string(&mut table).ok()?;
        Some(table)
    })
}

/// The connections of a user in a table of the kernel.
fn of_user(table: &str, uid: u32) -> HashSet<(SocketAddr, SocketAddr)> {
    let of_user = rows(table).filter(|row| row.uid == uid);
    of_user.map(|row| (row.local, row.remote)).collect()
}

fn rows(table: &str) -> impl Iterator<Item = SocketRow> {
    table.lines().skip(1).filter_map(|line| {
        let mut words = line.split_ascii_whitespace().skip(1);
        Some(SocketRow {
            local: address(words.next()?)?,
            remote: address(words.next()?)?,
            state: u8::from_str_radix(words.next()?, 16).ok()?,
            // Queues, timer and retransmissions stand between; then a time.
            uid: words.nth(3)?.parse().ok()?,
            inode: words.nth(1)?.parse().ok()?,
        })
    })
}

fn canonical(address: SocketAddr) -> SocketAddr {
    SocketAddr::new(address.ip().to_canonical(), address.port())
}

/// Reads `0100007F:1F90`: words of 32 bits in the order of this machine, and a port.
fn address(text: &str) -> Option<SocketAddr> {
    let (ip, port) = text.split_once(':')?;
    let word = |at: usize| u32::from_str_radix(ip.get(at..at + 8)?, 16).ok();
    let ip = match ip.len() {
        8 => IpAddr::V4(Ipv4Addr::from(word(0)?.to_ne_bytes())),
        32 => {
            let mut bytes = [0; 16];
            for (index, bytes) in bytes.chunks_exact_mut(4).enumerate() {
                bytes.copy_from_slice(&word(index * 8)?.to_ne_bytes());
            }
            IpAddr::V6(Ipv6Addr::from(bytes))
        }
        _ => return None,
    };
    let port = u16::from_str_radix(port, 16).ok()?;
    Some(canonical(SocketAddr::new(ip, port)))
}

#[cfg(test)]
mod tests {
    use std::net::{TcpListener, TcpStream};

    use super::*;

    const TABLE: &str = "\
  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode
   0: 0100007F:223D 00000000:0000 0A 00000000:00000000 00:00000000 00000000  1000        0 1 1
   1: 0100007F:C350 0100007F:223D 01 00000000:00000000 00:00000000 00000000  1001        0 2 1
   2: 0000000000000000FFFF00000100007F:C351 0000000000000000FFFF00000100007F:223D 01 00000000:00000000 00:00000000 00000000  1002 0 3 1
   3: 00000000000000000000000001000000:C352 00000000000000000000000001000000:223D 01 00000000:00000000 00:00000000 00000000  1003 0 4 1
   4: garbage
";

    #[test]
    #[cfg(target_endian = "little")]
    fn the_user_of_the_other_end_is_found_in_either_table() {
        for (local, remote, uid) in [
            ("127.0.0.1:50000", "127.0.0.1:8765", 1001),
            ("127.0.0.1:50001", "127.0.0.1:8765", 1002),
            ("[::ffff:127.0.0.1]:50001", "127.0.0.1:8765", 1002),
            ("[::1]:50002", "[::1]:8765", 1003),
        ] {
            let address = |text: &str| text.parse().unwrap();
            let [local, remote] = [local, remote].map(address);
            for other in [1000, 1001, 1002, 1003] {
                let own = OwnConnections(of_user(TABLE, other));
                assert_eq!(own.has(local, remote), other == uid, "{local} of {other}");
                assert!(!own.has(remote, local));
            }
        }
        assert_eq!(address("7F:1"), None);
        assert_eq!(address(""), None);
    }

    #[test]
    fn a_connection_of_this_process_is_this_user_s() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let own = listener.local_addr().unwrap();
        let stream = TcpStream::connect(own).unwrap();
        let peer = stream.local_addr().unwrap();
        assert!(OwnConnections::read().has(peer, own));
        let holder = holder(own.port()).unwrap();
        assert!(
            holder.ends_with(&format!("(process {})", std::process::id())),
            "{holder}"
        );
        assert!(!OwnConnections::read().has("10.0.0.1:5".parse().unwrap(), own));
    }
}
