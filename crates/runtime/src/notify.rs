//! Readiness and watchdog messages for a supervisor (systemd's `sd_notify` protocol).
//!
//! Without a supervisor nothing happens, and no trouble with one ever disturbs the process.

use std::ffi::{OsStr, OsString};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::time::Duration;

/// Reports the state of this process to the supervisor.
#[derive(Debug)]
pub struct Notifier {
    supervisor: Option<(UnixDatagram, SocketAddr)>,
    watchdog: Option<Duration>,
}

impl Notifier {
    /// The supervisor that the environment names: `NOTIFY_SOCKET`, `WATCHDOG_USEC`, `WATCHDOG_PID`.
    pub fn from_env() -> Notifier {
        Notifier::new(|name| std::env::var_os(name), std::process::id())
    }

    fn new(variable: impl Fn(&str) -> Option<OsString>, own_pid: u32) -> Notifier {
        let number = |name| variable(name)?.to_str()?.parse::<u64>().ok();
        let meant_for_us = number("WATCHDOG_PID").is_none_or(|pid| pid == u64::from(own_pid));
        Notifier {
            supervisor: variable("NOTIFY_SOCKET").and_then(|name| connect(&name)),
            watchdog: number("WATCHDOG_USEC")
                .filter(|&period_us| period_us > 0 && meant_for_us)
                .map(Duration::from_micros),
        }
    }

    /// The process does its work from now on.
    pub fn ready(&self) {
        self.send("READY=1");
    }

    /// The process is ending.
    pub fn stopping(&self) {
        self.send("STOPPING=1");
    }

    /// The process is alive. Nothing is sent to a supervisor that does not watch: what it does not read would take the
    /// place of what it waits for.
    pub fn watchdog(&self) {
        if self.watchdog.is_some() {
            self.send("WATCHDOG=1");
        }
    }

    /// How often [`watchdog`](Self::watchdog) should be called: half of what the supervisor tolerates. `None` if it
    /// does not watch.
    pub fn watchdog_period(&self) -> Option<Duration> {
        self.watchdog.map(|tolerated| tolerated / 2)
    }

    fn send(&self, message: &str) {
        if let Some((socket, address)) = &self.supervisor {
            // A supervisor that does not listen is its own trouble.
            let _ = socket.send_to_addr(message.as_bytes(), address);
        }
    }
}

/// A datagram socket and the address `name`; a leading `@` means Linux's abstract namespace.
fn connect(name: &OsStr) -> Option<(UnixDatagram, SocketAddr)> {
    let address = match name.as_bytes() {
        [b'@', name @ ..] => SocketAddr::from_abstract_name(name),
        [b'/', ..] => SocketAddr::from_pathname(name),
        _ => return None,
    }
    .ok()?;
    let socket = UnixDatagram::unbound().ok()?;
    socket.set_nonblocking(true).ok()?;
    Some((socket, address))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn notifier(variables: &[(&str, &OsStr)]) -> Notifier {
        Notifier::new(
            |name| {
                let found = variables.iter().find(|(key, _)| *key == name);
                found.map(|(_, value)| value.to_os_string())
            },
            42,
        )
    }

    #[test]
    fn the_supervisor_gets_each_message_as_a_datagram() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notify");
        let supervisor = UnixDatagram::bind(&path).unwrap();
        let socket = ("NOTIFY_SOCKET", path.as_os_str());
        let watched = notifier(&[socket, ("WATCHDOG_USEC", OsStr::new("3000000"))]);
        let unwatched = notifier(&[socket]);
        for (notifier, messages) in [
            (watched, &["READY=1", "WATCHDOG=1", "STOPPING=1"][..]),
            (unwatched, &["READY=1", "STOPPING=1"]),
        ] {
            notifier.ready();
            notifier.watchdog();
            notifier.stopping();
            for expected in messages {
                let mut message = [0; 32];
                let length = supervisor.recv(&mut message).unwrap();
                assert_eq!(&message[..length], expected.as_bytes());
            }
        }
    }

    #[test]
    fn without_a_usable_supervisor_nothing_happens() {
        for name in ["", "relative", "/does/not/exist", "@"] {
            let notifier = notifier(&[("NOTIFY_SOCKET", OsStr::new(name))]);
            notifier.ready();
            assert_eq!(notifier.watchdog_period(), None);
        }
    }

    #[test]
    fn the_watchdog_is_fed_twice_as_often_as_needed_and_only_by_its_process() {
        for (period_us, pid, expected) in [
            ("3000000", "42", Some(Duration::from_millis(1500))),
            ("3000000", "43", None),
            ("0", "42", None),
            ("often", "42", None),
        ] {
            let notifier = notifier(&[
                ("WATCHDOG_USEC", OsStr::new(period_us)),
                ("WATCHDOG_PID", OsStr::new(pid)),
            ]);
            assert_eq!(notifier.watchdog_period(), expected, "{period_us} {pid}");
        }
    }
}
