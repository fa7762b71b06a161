//! The serial port around a run: one wait for bytes, for room, for a signal and for the next deadline. [`shown`]: how a
//! run is shown.

pub mod shown;

use std::io::{self, BufRead};
use std::os::fd::AsFd;
use std::process::Command;
use std::time::{Duration, Instant};

use bridge::shell::serial::SerialPort;
use operator::render::note;
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::output::standard_error;
use runtime::signal::Termination;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;

use crate::report::{Report, Verdict};
use crate::run::{Conformance, Player, Settings};

/// Bytes read at once: 0.3 s of a line of 115200 baud.
const READ_BYTES: usize = 4_096;

/// How the DSP is reset.
pub enum Resetter {
    /// By a command of a shell.
    Command(String),
    /// By the operator.
    ByHand,
}

/// A run that has ended.
pub struct Played {
    /// What it found.
    pub report: Report,
    /// The signal that ended it; `None` if it came to its end.
    pub interrupted_by: Option<i32>,
}

/// Plays a run at an open port.
pub fn play(
    settings: Settings,
    serial: &SerialPort,
    termination: &Termination,
    resetter: &Resetter,
) -> Result<Played, Failure> {
    let mut run = Conformance::new(settings);
    let mut said = 0;
    let interrupted_by = serve(&mut run, serial, termination, |run, began| {
        if run.wants_reset() {
            match reset(resetter, termination)? {
                true => {
                    // What came before the reset is not the DSP's answer to it.
                    let mut buffer = [0; READ_BYTES];
                    while serial.read(&mut buffer).or_fail(ExitCode::LinkDown)? > 0 {}
                    run.was_reset(began.elapsed());
                }
                false => run.decline_reset(began.elapsed()),
            }
        }
        said = say_progress(run, said);
        Ok(())
    })?;
    Ok(Played {
        report: run.report(),
        interrupted_by,
    })
}

/// Serves a player until it is done, and calls `between` after each step; gives the signal that ended it, or `None`.
pub fn serve<P: Player>(
    run: &mut P,
    serial: &SerialPort,
    termination: &Termination,
    mut between: impl FnMut(&mut P, Instant) -> Result<(), Failure>,
) -> Result<Option<i32>, Failure> {
    let began = Instant::now();
    let (mut pending, mut buffer) = (Vec::new(), [0; READ_BYTES]);
    while !run.is_finished() {
        if termination.requested() {
            return Ok(termination.signal());
        }
        let before = began.elapsed();
        let count = serial.read(&mut buffer).or_fail(ExitCode::LinkDown)?;
        // Nothing had come at the time before the read. A later time would let a deadline pass that bytes in the port
        // keep, after this computer stood still.
        let now = match count {
            0 => before,
            _ => began.elapsed(),
        };
        run.step(now, buffer.get(..count).unwrap_or_default());
        between(run, began)?;
        pending.extend(run.take_outbox());
        let written = serial.write(&pending).or_fail(ExitCode::LinkDown)?;
        pending.drain(..written.min(pending.len()));
        if count == 0 && !run.is_finished() {
            wait(run, serial, termination, !pending.is_empty(), began)?;
        }
    }
    Ok(None)
}

/// The one wait.
fn wait(
    run: &impl Player,
    serial: &SerialPort,
    termination: &Termination,
    needs_room: bool,
    began: Instant,
) -> Result<(), Failure> {
    let events = match needs_room {
        true => PollFlags::IN | PollFlags::OUT,
        false => PollFlags::IN,
    };
    let (port, signals) = (serial.as_fd(), termination.as_fd());
    let mut sources = [
        PollFd::new(&port, events),
        PollFd::new(&signals, PollFlags::IN),
    ];
    let left = run
        .next_deadline()
        .map(|deadline| deadline.saturating_sub(began.elapsed()));
    match poll(&mut sources, left.map(timespec).as_ref()) {
        Ok(_) | Err(Errno::INTR) => Ok(()),
        Err(errno) => Err(Failure::internal(errno)),
    }
}

fn timespec(wait: Duration) -> Timespec {
    // A wait of more seconds than the type holds is as good as none.
    Timespec {
        tv_sec: i64::try_from(wait.as_secs()).unwrap_or(i64::MAX),
        tv_nsec: i64::from(wait.subsec_nanos()),
    }
}

/// Resets the DSP; false when that was declined.
fn reset(resetter: &Resetter, termination: &Termination) -> Result<bool, Failure> {
    match resetter {
        Resetter::Command(command) => {
            let status = Command::new("sh").arg("-c").arg(command).status();
            let status = status.map_err(Failure::internal)?;
            match status.success() {
                true => Ok(true),
                false => Err(Failure::internal(format!(
                    "the reset command `{command}` failed: {status}"
                ))
                .with_next_step("run it by hand, and correct --reset-command")),
            }
        }
        Resetter::ByHand => {
            // Standard error may be closed; Enter counts all the same.
            let question = "Reset the DSP now, and press Enter at once (n: do not): ";
            standard_error().print(question);
            let (stdin, signals) = (io::stdin(), termination.as_fd());
            let descriptor = stdin.as_fd();
            let mut sources = [
                PollFd::new(&descriptor, PollFlags::IN),
                PollFd::new(&signals, PollFlags::IN),
            ];
            if poll(&mut sources, None).is_err() || termination.requested() {
                return Ok(false);
            }
            let mut line = String::new();
            let count = stdin.lock().read_line(&mut line).unwrap_or(0);
            Ok(count > 0 && !line.trim().eq_ignore_ascii_case("n"))
        }
    }
}

/// Says on standard error what was found broken since the last time.
fn say_progress(run: &Conformance, said: usize) -> usize {
    for index in said..run.done() {
        let Some(check) = run.check(index) else {
            continue;
        };
        if let Verdict::Broken { found } = &check.verdict {
            note(format_args!("broken: {}: {found}", check.id));
        }
    }
    run.done()
}
