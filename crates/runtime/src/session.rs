//! Which session a process belongs to: the terminal, or the service, that it was started from.

use rustix::process::Pid;

/// The number of the process that leads the session of this process, or of the caller's for `None`.
///
/// `None` if there is no such process, or if the leader's number is not known here: a process that entered a PID
/// namespace keeps a session whose leader is outside, and the kernel then says 0. `rustix` takes that for a number of a
/// process.
#[allow(unsafe_code)]
pub fn session_of(process: Option<Pid>) -> Option<Pid> {
    // SAFETY: the call takes a number and gives a number.
    let leader = unsafe { libc::getsid(Pid::as_raw(process)) };
    // Below 0 is an error, and no number of a process either.
    Pid::from_raw(leader.max(0))
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use super::*;

    #[test]
    fn a_session_whose_leader_is_in_another_pid_namespace_is_not_known() {
        const INSIDE: &str = "SESSION_OF_INSIDE";
        if std::env::var_os(INSIDE).is_some() {
            assert_eq!(session_of(None), None);
            return;
        }
        // Who is not root becomes root of a user namespace, which may make another.
        let flags = match rustix::process::geteuid().is_root() {
            true => "-pf",
            false => "-rpf",
        };
        let inside = |program: &std::ffi::OsStr| {
            let mut command = Command::new("unshare");
            command.arg(flags).arg(program).env(INSIDE, "1");
            command
        };
        let attempt = inside("true".as_ref()).output();
        if !attempt.as_ref().is_ok_and(|output| output.status.success()) {
            eprintln!("SKIPPED: no PID namespace of its own: {attempt:?}");
            return;
        }
        let program = std::env::current_exe().unwrap();
        let output = inside(program.as_os_str())
            .arg("a_session_whose_leader")
            .output()
            .unwrap();
        assert!(output.status.success(), "{output:?}");
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(said.contains("1 passed"), "{said}");
    }

    #[test]
    fn a_child_is_of_its_parent_s_session_and_the_dead_are_of_none() {
        let mut child = Command::new("true").spawn().unwrap();
        let pid = Pid::from_child(&child);
        assert_eq!(session_of(Some(pid)), session_of(None));
        child.wait().unwrap();
        assert_eq!(session_of(Some(pid)), None);
    }
}
