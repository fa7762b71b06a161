//! Lets bridge and status fly with RealtimeSanitizer, and compares each stack that it reports of their loops with a
//! [list](list::STEADY).
//!
//! The program is `ril` when its first argument says so: then SIGUSR1 lets the thread with the loop enter what the
//! sanitizer calls a real-time context, and SIGUSR2 leave it. So the processes themselves know nothing of this. First
//! the flight is steady: a path is flown, and samples are read. Then clients come, go and are killed, and give orders.
//! Exit code 1 when a stack is not on the list.

mod list;

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::process::ExitCode;
use std::thread;
use std::time::Duration;

use ril_tests::process::Signal;
use ril_tests::{Process, Sandbox};

use list::{CLIENTS, Row, STEADY, row_of};

/// How long the steady flight is watched, after what its beginning has left to do.
const WATCHED: Duration = Duration::from_secs(20);
const SETTLES: Duration = Duration::from_secs(3);

/// After this time the watchdog ends the program.
const LIMIT: Duration = Duration::from_secs(600);

const PROCESSES: [(&str, &str); 2] = [
    ("bridge", "run bridge --port dsp-1"),
    ("status", "run status"),
];

unsafe extern "C" {
    fn __rtsan_realtime_enter();
    fn __rtsan_realtime_exit();
}

extern "C" fn enter(_signal: libc::c_int) {
    // SAFETY: it changes a number of this thread.
    unsafe { __rtsan_realtime_enter() };
}

extern "C" fn leave(_signal: libc::c_int) {
    // SAFETY: it changes a number of this thread.
    unsafe { __rtsan_realtime_exit() };
}

fn main() -> ExitCode {
    let mut args: Vec<OsString> = std::env::args_os().skip(1).collect();
    if args.first().is_some_and(|first| first == "ril") {
        let handlers: [(_, extern "C" fn(libc::c_int)); 2] =
            [(libc::SIGUSR1, enter), (libc::SIGUSR2, leave)];
        for (signal, handler) in handlers {
            // SAFETY: the handler calls nothing that a handler must not. The kernel gives a signal to the first thread,
            // which has the loop.
            unsafe { libc::signal(signal, handler as libc::sighandler_t) };
        }
        return ril::main(args);
    }
    let all = args.pop().is_some_and(|word| word == "--all");
    match fly(all) {
        0 => ExitCode::SUCCESS,
        _ => ExitCode::FAILURE,
    }
}

/// Flies, prints the figures, and says how many stacks are not on the list; with `all`, prints an example of each row
/// too.
fn fly(all: bool) -> usize {
    let program = std::env::current_exe().expect("this program's path");
    let rig = Sandbox::new([program.into_os_string(), "ril".into()], "rtsan", LIMIT);
    rig.write("bridge.toml", ril_tests::sandbox::FOR_SLOW_MACHINES);
    let sim = rig.sim(1, "");
    let watched: Vec<Process> = PROCESSES
        .iter()
        .map(|(name, args)| {
            let line = format!(
                "RTSAN_OPTIONS=halt_on_error=false exec \"$0\" \"$@\" {args} 2>{name}.stacks"
            );
            rig.spawn(rig.shell(&line))
        })
        .collect();
    // It follows both journals, which so are recorded.
    let mut record = rig.start("record");
    record.wait_for_text("recording");
    rig.watch(1).until_ready();
    rig.run("start", 0);
    rig.run("takeoff 5m", 0);
    let far = "goto 37.44,-6.001,25 --no-wait";
    rig.run(far, 0);
    let mut reader = rig.start("echo hero --json");
    reader.wait_for_text("{");
    thread::sleep(SETTLES);
    watched
        .iter()
        .for_each(|process| process.signal(Signal::USR1));
    thread::sleep(WATCHED);
    let read =
        |name: &str| fs::read_to_string(rig.path(&format!("{name}.stacks"))).expect("a file");
    let steady = PROCESSES.map(|(name, _)| read(name).len());
    drop(rig.kill(reader));
    rig.run("echo dsp --count 3", 0);
    rig.run("hold", 0);
    rig.run("param list", 0);
    rig.run("fence reload", 0);
    rig.run(far, 0);
    rig.run("land --preempt", 0);
    watched
        .iter()
        .for_each(|process| process.signal(Signal::USR2));
    record.end();
    watched
        .into_iter()
        .rev()
        .for_each(|process| drop(process.end()));
    sim.end();
    let mut others = 0;
    for ((name, _), steady) in PROCESSES.into_iter().zip(steady) {
        let text = read(name);
        let (before, after) = text.split_at(steady);
        others += judge(name, "steady flight", before, &[STEADY], all);
        others += judge(
            name,
            "clients that come and go",
            after,
            &[STEADY, CLIENTS],
            all,
        );
    }
    others
}

/// Prints what became of the stacks of a process, and says how many are not on the list.
fn judge(process: &str, when: &str, text: &str, lists: &[&'static [Row]], all: bool) -> usize {
    let mut rows: BTreeMap<&str, (&Row, usize, &str)> = BTreeMap::new();
    let mut others = Vec::new();
    let stacks: Vec<&str> = text.split("ERROR: RealtimeSanitizer: ").skip(1).collect();
    for stack in &stacks {
        match row_of(stack, lists) {
            Some(row) => rows.entry(row.why).or_insert((row, 0, *stack)).1 += 1,
            None => others.push(*stack),
        }
    }
    println!(
        "{process}, {when}: {} stacks, {} not on the list",
        stacks.len(),
        others.len()
    );
    for (row, count, example) in rows.into_values() {
        println!("    {count}: {}", row.why);
        if all {
            println!("{example}");
        }
    }
    others.iter().for_each(|stack| println!("{stack}"));
    others.len()
}
