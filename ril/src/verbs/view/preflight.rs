//! [`Preflight`]: `ril preflight` as a process of its own beside the server, which must not wait for what the checks look at: files, the
//! machine, the bridge's answer.

use std::io::{self, ErrorKind, Read};
use std::os::fd::{AsFd, BorrowedFd};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::Duration;

use ipc_types::{MonotonicNs, RobotId};
use runtime::signal::WITH_PARENT;
use serde::Deserialize;

/// Most that is taken of what it prints; the checks make a few kilobytes.
const MAX_BYTES: usize = 256 << 10;

/// How long it may take before it is killed: several of its own time limits.
const TIMEOUT: Duration = Duration::from_secs(20);

/// A check of the preflight.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub(super) struct PreflightCheck {
    /// Its name.
    pub id: String,
    /// `pass`, `warn` or `fail`; `None` if it could not be made, which is not ready either.
    pub verdict: Option<String>,
    /// What was found.
    pub value: String,
    /// What to do.
    pub next_step: Option<String>,
}

/// What the preflight prints.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct PrintedReport {
    checks: Vec<PreflightCheck>,
}

/// A preflight that runs. One that is dropped is killed.
pub(super) struct Preflight {
    child: Child,
    output: ChildStdout,
    text: Vec<u8>,
    give_up: MonotonicNs,
}

impl Preflight {
    /// Starts it for `robot`.
    pub fn start(robot: RobotId, now: MonotonicNs) -> io::Result<Preflight> {
        let mut child = Command::new(std::env::current_exe()?)
            .args(["preflight", "--json", "--robot", &robot.to_string()])
            .env(WITH_PARENT, "1")
            .env_remove("RIL_CONFIG")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()?;
        let output = child.stdout.take().ok_or(ErrorKind::BrokenPipe)?;
        rustix::io::ioctl_fionbio(&output, true)?;
        Ok(Preflight {
            child,
            output,
            text: Vec::new(),
            give_up: now + TIMEOUT,
        })
    }

    /// What to wait for.
    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.output.as_fd()
    }

    /// Takes what it has printed. When it has ended: its checks, or why there are none.
    pub fn take(&mut self, now: MonotonicNs) -> Option<Result<Vec<PreflightCheck>, String>> {
        let mut buffer = [0; 4096];
        loop {
            match self.output.read(&mut buffer) {
                Ok(0) => return Some(checks(&self.text)),
                Ok(count) if self.text.len() + count <= MAX_BYTES => {
                    self.text.extend_from_slice(&buffer[..count]);
                }
                Ok(_) => return Some(Err("`ril preflight` says too much".to_owned())),
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Some(Err(format!("`ril preflight`: {error}"))),
            }
        }
        (now >= self.give_up).then(|| Err("`ril preflight` does not end".to_owned()))
    }

    /// When it is to be looked at although it prints nothing.
    pub fn deadline(&self) -> MonotonicNs {
        self.give_up
    }
}

impl Drop for Preflight {
    fn drop(&mut self) {
        // It has ended, or is of no use any more; a killed process is reaped at once.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The checks, in the first line of what was printed.
fn checks(text: &[u8]) -> Result<Vec<PreflightCheck>, String> {
    let line = text.split(|byte| *byte == b'\n').next().unwrap_or_default();
    let report: PrintedReport = serde_json::from_slice(line)
        .map_err(|error| format!("`ril preflight` could not be run: {error}"))?;
    Ok(report.checks)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checks_are_read_and_what_is_none_says_why() {
        let text = br#"{"schema":"ril.Preflight.v1","checks":[{"id":"gps","verdict":"fail","checked":true,"value":"no fix","limit":null,"next_step":"wait"},{"id":"home","verdict":null,"value":"no telemetry came","next_step":null}]}
"#;
        let read = checks(text).unwrap();
        assert_eq!(read[0].verdict.as_deref(), Some("fail"));
        assert_eq!(
            (read[1].id.as_str(), read[1].verdict.as_deref()),
            ("home", None)
        );
        assert!(checks(b"").unwrap_err().contains("could not be run"));
    }
}
