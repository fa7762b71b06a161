//! What a process prints on standard error: all of it, in order, when somebody reads; and an end all the same when
//! nobody does. Real processes, because a process has one standard error.

use std::env;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::os::fd::{AsFd, OwnedFd};
use std::process::{Child, Command, Stdio};
use std::time::Instant;

use clap::Parser;
use runtime::exit::{self, ExitCode, Failure};
use runtime::logging::{self, Verbosity};
use runtime::output::END_LIMIT;
use runtime::signal::Termination;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::pipe::{fcntl_setpipe_size, pipe};
use rustix::process::{Pid, PidfdFlags, Signal, kill_process, pidfd_open};
use tracing::level_filters::LevelFilter;

/// Tells a child of this test what it does.
const ROLE: &str = "RIL_TEST_OUTPUT";

/// More than queue and pipe hold.
const MANY: u64 = 50_000;

/// How often an end is tried.
const ENDS: usize = 5;

/// A child that does not end in this time is held up, s.
const LIMIT_S: i64 = 60;

/// No option is right.
#[derive(Parser)]
struct Args {}

fn child(role: &str) -> std::process::ExitCode {
    exit::main_of(|_: Args| {
        logging::init(Verbosity::Level(LevelFilter::INFO))?;
        match role {
            "ok" => tracing::info!("before"),
            "failure" => {
                tracing::info!("before");
                return Err(Failure::new(ExitCode::Refused, "on purpose"));
            }
            "panic" => {
                tracing::info!("before");
                panic!("on purpose");
            }
            "signal" => {
                let termination = Termination::install().map_err(Failure::internal)?;
                (0..MANY).for_each(|number| tracing::info!(number, "many"));
                println!("ready");
                let _ = poll(&mut [PollFd::new(&termination, PollFlags::IN)], None);
            }
            _ => (0..MANY).for_each(|number| tracing::info!(number, "many")),
        }
        Ok(())
    })
}

fn start(role: &str, stderr: OwnedFd) -> Child {
    let mut command = Command::new(env::current_exe().unwrap());
    if role == "usage" {
        command.arg("--wrong");
    }
    command.env(ROLE, role).env("RUST_BACKTRACE", "0");
    command.stdout(Stdio::piped()).stderr(stderr);
    command.spawn().unwrap()
}

/// The exit code of a child, which must end.
fn code(mut child: Child) -> Option<i32> {
    let process = pidfd_open(Pid::from_child(&child), PidfdFlags::empty()).unwrap();
    let limit = Timespec {
        tv_sec: LIMIT_S,
        tv_nsec: 0,
    };
    let ended = poll(&mut [PollFd::new(&process, PollFlags::IN)], Some(&limit));
    let has_ended = ended == Ok(1);
    if !has_ended {
        child.kill().unwrap();
    }
    let status = child.wait().unwrap();
    assert!(has_ended, "it does not end while nobody reads");
    status.code()
}

const TESTS: &[fn()] = &[
    last_words_arrive_in_order_when_somebody_reads,
    a_process_ends_while_nobody_reads_its_standard_error,
    what_is_missing_is_said_where_it_is_missing,
];

fn main() -> std::process::ExitCode {
    if let Ok(role) = env::var(ROLE) {
        return child(&role);
    }
    TESTS.iter().for_each(|test| test());
    std::process::ExitCode::SUCCESS
}

fn last_words_arrive_in_order_when_somebody_reads() {
    for (role, expected, last) in [
        ("ok", 0, "before\n"),
        ("failure", 5, "before\nerror: on purpose\n"),
        ("usage", 2, "For more information, try '--help'.\n"),
    ] {
        let (reader, writer) = pipe().unwrap();
        let child = start(role, writer);
        let mut text = String::new();
        File::from(reader).read_to_string(&mut text).unwrap();
        assert!(text.ends_with(last), "{role}: {text}");
        assert_eq!(code(child), Some(expected), "{role}");
    }
    let (reader, writer) = pipe().unwrap();
    let child = start("panic", writer);
    let mut text = String::new();
    File::from(reader).read_to_string(&mut text).unwrap();
    let (_, panic) = text.split_once("before\n\nthread 'main' ").expect(&text);
    assert!(panic.starts_with("panicked at "), "{text}");
    assert!(panic.contains(":\non purpose\nnote: run with"), "{text}");
    assert_eq!(code(child), Some(1));
}

fn a_process_ends_while_nobody_reads_its_standard_error() {
    for (role, expected) in [
        ("ok", 0),
        ("failure", 5),
        ("usage", 2),
        ("panic", 1),
        ("many", 0),
        ("signal", 0),
    ] {
        let is_told = role == "signal";
        // The shortest of some: a machine that stalls makes one end longer, and a second wait all of them.
        let ends = (0..if is_told { ENDS } else { 1 }).map(|_| {
            let (_reader, writer) = pipe().unwrap();
            fcntl_setpipe_size(writer.as_fd(), 4096).unwrap();
            rustix::io::write(&writer, &[b'x'; 4096]).unwrap();
            let mut child = start(role, writer);
            if is_told {
                let mut line = String::new();
                let stdout = child.stdout.as_mut().unwrap();
                BufReader::new(stdout).read_line(&mut line).unwrap();
                kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
            }
            let begin = Instant::now();
            assert_eq!(code(child), Some(expected), "{role}");
            begin.elapsed()
        });
        let shortest = ends.min().unwrap();
        let is_in_time = shortest < 2 * END_LIMIT;
        assert!(is_in_time || !is_told, "{role}: {shortest:?}");
    }
}

/// Of a flood a reader misses some lines, and each gap has its size before the next line.
fn what_is_missing_is_said_where_it_is_missing() {
    let (reader, writer) = pipe().unwrap();
    let child = start("many", writer);
    let mut next = 0;
    for line in BufReader::new(File::from(reader)).lines() {
        let line = line.unwrap();
        let (text, number) = line.rsplit_once('=').expect(&line);
        let number: u64 = number.parse().expect(&line);
        if text.ends_with(" missing") {
            assert!(text.contains(" WARN runtime::output: lines are missing here"));
            next += number;
        } else {
            assert_eq!(number, next, "{line}");
            next += 1;
        }
    }
    assert!(next > 0);
    assert_eq!(code(child), Some(0));
}
