//! A signal that comes at any moment of a process's start ends it: by itself, or as a wish that the process sees. Real
//! processes, because signals have one owner in each.

use std::env;
use std::io::{self, Read, Write};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use runtime::signal::Termination;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::process::{Pid, Signal, kill_process};

/// Enough that several signals come while the handlers are installed.
const ROUNDS: u64 = 3000;

/// Longest time from the child's word to its signal, ns.
const SPAN_NS: u64 = 60_000;

/// Tells a child of this test what it is.
const ROLE: &str = "RIL_TEST_SIGNALS";

/// A child that never saw its signal is given up, s.
const FORGOTTEN_S: i64 = 30;

/// Says that it begins, takes the signals, and waits for one. Ends with 7 when none came. It has one thread, as every
/// process of ours when it takes its signals; so this program is no ordinary test, whose harness has two.
fn child() {
    io::stderr().write_all(b"!").unwrap();
    let termination = Termination::install().unwrap();
    let mut sources = [PollFd::new(&termination, PollFlags::IN)];
    let timeout = rustix::time::Timespec {
        tv_sec: FORGOTTEN_S,
        tv_nsec: 0,
    };
    while !termination.requested() {
        if poll(&mut sources, Some(&timeout)) == Ok(0) {
            std::process::exit(7);
        }
    }
}

fn start() -> Child {
    let mut command = Command::new(env::current_exe().unwrap());
    command.env(ROLE, "1");
    command
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

fn main() {
    match env::var_os(ROLE) {
        Some(_) => child(),
        None => a_signal_that_comes_while_its_handlers_are_installed_is_not_forgotten(),
    }
}

fn a_signal_that_comes_while_its_handlers_are_installed_is_not_forgotten() {
    for round in 0..ROUNDS {
        let mut child = start();
        let mut word = [0; 1];
        child
            .stderr
            .as_mut()
            .unwrap()
            .read_exact(&mut word)
            .unwrap();
        let begin = Instant::now();
        let wait = Duration::from_nanos(round * 7919 % SPAN_NS);
        while begin.elapsed() < wait {}
        kill_process(Pid::from_child(&child), Signal::INT).unwrap();
        let status = child.wait().unwrap();
        assert_ne!(status.code(), Some(7), "round {round}");
    }
}
