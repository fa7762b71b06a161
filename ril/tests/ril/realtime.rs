//! `[realtime]` in real processes: what is refused is said and ends no flight; what is granted is the loop's alone, and
//! a process with locked memory has no page fault in flight.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use ipc_types::payload::HeroTelemetry;
use ril_tests::languages::skip;
use ril_tests::{Process, Sandbox};

use crate::common::{FOR_SLOW_MACHINES, end_all, sandbox};
use crate::doctor::{examine, texts, troubles};

/// What the kernel says of a thread.
#[derive(Clone, Copy, Debug)]
struct ThreadUse {
    minor_faults: u64,
    major_faults: u64,
    priority: u64,
    policy: u64,
}

const DEVICE: &str = "/dev/cpu_dma_latency";

/// `SCHED_FIFO` and `SCHED_BATCH`
const FIFO: u64 = 1;
const BATCH: u64 = 3;

/// The threads of a process, by name and number.
fn threads(process: &Process) -> BTreeMap<(String, u32), ThreadUse> {
    let tasks = fs::read_dir(format!("/proc/{}/task", process.id())).unwrap();
    let one = |task: std::io::Result<fs::DirEntry>| {
        let folder = task.ok()?.path();
        let stat = fs::read_to_string(folder.join("stat")).ok()?;
        let (name, fields) = stat.split_once('(')?.1.rsplit_once(')')?;
        // The field behind the name is the third.
        let fields: Vec<&str> = fields.split_whitespace().collect();
        let field = |number: usize| fields[number - 3].parse::<u64>().unwrap_or(0);
        let number = folder.file_name()?.to_str()?.parse().ok()?;
        let it = ThreadUse {
            minor_faults: field(10),
            major_faults: field(12),
            priority: field(40),
            policy: field(41),
        };
        Some(((name.to_owned(), number), it))
    };
    tasks.filter_map(one).collect()
}

/// How much of the memory that a loop may come to use is not there yet, KiB: its stack, its heap and the segments that
/// it shares.
fn absent_kib(process: &Process) -> u64 {
    let maps = fs::read_to_string(format!("/proc/{}/smaps", process.id())).unwrap();
    let (mut is_of_loop, mut absent) = (false, 0);
    for line in maps.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let kib = || words[1].parse::<u64>().unwrap();
        match words[0] {
            "Size:" if is_of_loop => absent += kib(),
            "Rss:" if is_of_loop => absent -= kib(),
            // A range of addresses begins, perhaps with the name of what is there.
            word if !word.ends_with(':') => {
                let name = words.get(5).unwrap_or(&"");
                is_of_loop = ["[stack]", "[heap]"].contains(name) || name.starts_with("/dev/shm");
            }
            _ => {}
        }
    }
    absent
}

/// Whether a process keeps the processors awake.
fn holds_latency(process: &Process) -> bool {
    let files = fs::read_dir(format!("/proc/{}/fd", process.id())).unwrap();
    let mut paths = files.flatten().map(|file| fs::read_link(file.path()));
    paths.any(|path| path.is_ok_and(|path| path == Path::new(DEVICE)))
}

fn configure(rig: &Sandbox, of_bridge: &str, of_status: &str) {
    let bridge = format!("{FOR_SLOW_MACHINES}\n[realtime]\n{of_bridge}");
    rig.write("bridge.toml", &bridge);
    rig.write("status.toml", &format!("[realtime]\n{of_status}"));
}

/// Below its limits, and on a processor that no computer has.
#[test]
fn what_is_refused_is_said_with_what_to_do_and_the_robot_flies() {
    if rustix::process::geteuid().is_root() {
        return skip("refusals of real time", "root is refused nothing");
    }
    let rig = sandbox();
    configure(
        &rig,
        "lock_memory = true\npriority = 30\nprocessors = [1023]\nlow_latency_processor = true",
        "priority = 20",
    );
    let sim = rig.sim(1, "--speed 4");
    let start = |args: &str| {
        let line = format!("ulimit -l 64 && ulimit -r 0 && exec \"$0\" run {args}");
        Process::spawn(&rig.domain, rig.shell(&line))
    };
    let mut bridge = start("bridge --port dsp-1");
    bridge.wait_for_text("ready");
    let mut status = start("status");
    status.wait_for_text("ready");
    rig.watch(1).until_ready();
    rig.run("start", 0);
    rig.run("takeoff --altitude 5", 0);
    // A live process is judged by what it has, which is not what this shell allows.
    let expected = [
        "realtime-lacking",
        "realtime-lacking",
        "realtime-lacking",
        "realtime-lacking",
        "realtime-latency",
    ];
    assert_eq!(troubles(&rig, "", 8), expected);
    let text = texts(&examine(&rig, "", 8));
    let of_bridge = format!(
        "bridge (process {}): the loop has no priority 30",
        bridge.id()
    );
    assert!(text.contains(&of_bridge), "{text}");
    rig.run("land", 0);
    let said = status.end();
    said.err_says(
        "the loop has no priority 20: the limit `rtprio` is 0; raise the limit: `ulimit -r 20`",
    );
    let said = bridge.end();
    said.err_says("no memory is locked: the limit `memlock` is 65536 bytes");
    said.err_says("the loop has no priority 30: the limit `rtprio` is 0");
    said.err_says("the loop does not get the processors 1023 for itself");
    said.err_says("/dev/cpu_dma_latency cannot be opened");
    let lines = said
        .stderr
        .iter()
        .filter(|line| line.contains("real time: "));
    assert_eq!(lines.count(), 4, "each is said once: {said:#?}");
    end_all([sim]);
}

mod as_root {
    use std::process::Command;

    use super::*;

    /// Frames until all is in place, which is more than a second of the flight, and frames that are counted.
    const WARM_UP: usize = 500;
    const FRAMES: usize = 2_500;

    /// At most so many windows of as many frames: the kernel may move a page in one, which is a minor fault as well.
    const WINDOWS: usize = 3;

    /// Flies on, and says for each loop how many page faults it had in the window with the fewest; prints them all.
    fn fewest_faults(both: [&Process; 2], mut fly: impl FnMut()) -> [u64; 2] {
        let mut fewest = [u64::MAX; 2];
        for _ in 0..WINDOWS {
            if fewest == [0; 2] {
                break;
            }
            let before = both.map(threads);
            fly();
            for (index, after) in both.map(threads).into_iter().enumerate() {
                for (thread, now) in after {
                    let then = before[index][&thread];
                    let minor = now.minor_faults - then.minor_faults;
                    let major = now.major_faults - then.major_faults;
                    eprintln!("{thread:?}: {minor} minor and {major} major page faults");
                    assert_eq!(major, 0, "{thread:?}");
                    if thread.1 == both[index].id() {
                        fewest[index] = fewest[index].min(minor);
                    }
                }
            }
        }
        fewest
    }

    #[test]
    fn a_loop_gets_what_it_asks_for_alone_and_has_no_page_fault_in_flight() {
        let mut probe = Command::new("chrt");
        probe.args(["-f", "1", "true"]);
        let is_permitted = probe.output().is_ok_and(|output| output.status.success());
        if !is_permitted || !rustix::process::geteuid().is_root() {
            return skip("real time", "no thread may be a real-time one here");
        }
        let rig = sandbox();
        let ask = |priority| {
            format!(
                "lock_memory = true\npriority = {priority}\nprocessors = [0]\nlow_latency_processor = true"
            )
        };
        configure(&rig, &ask(30), &ask(20));
        let robot = rig.start_robot(1, 10);
        rig.watch(1).until_ready();
        for (process, priority) in [(&robot.bridge, 30), (&robot.status, 20)] {
            let threads = threads(process);
            assert!(threads.len() > 2, "{threads:?}");
            for ((name, number), thread) in threads {
                let is_loop = number == process.id();
                let expected = if is_loop { priority } else { 0 };
                assert_eq!(thread.priority, expected, "{name}");
                let class = match name.as_str() {
                    _ if is_loop => FIFO,
                    "output" => BATCH,
                    _ => 0,
                };
                assert_eq!(thread.policy, class, "{name}");
            }
            let shown = Command::new("chrt")
                .args(["-p", &process.id().to_string()])
                .output();
            let shown = String::from_utf8(shown.unwrap().stdout).unwrap();
            assert!(shown.contains("SCHED_FIFO|SCHED_RESET_ON_FORK"), "{shown}");
        }
        let text = texts(&examine(&rig, "", 0));
        for (process, name) in [(&robot.bridge, "bridge"), (&robot.status, "status")] {
            let expected = format!("{name} (process {}) has what it asks for", process.id());
            assert!(text.contains(&expected), "{text}");
        }
        rig.run("start", 0);
        rig.run("takeoff --altitude 10", 0);
        let mut telemetry = rig.subscribe::<HeroTelemetry>(1);
        let mut fly = |frames| {
            for _ in 0..frames {
                telemetry.next_sample();
            }
        };
        fly(WARM_UP);
        let both = [&robot.bridge, &robot.status];
        let has_device = Path::new(DEVICE).exists();
        assert_eq!(both.map(holds_latency), [has_device; 2]);
        assert_eq!(both.map(absent_kib), [0; 2]);
        assert_eq!(fewest_faults(both, || fly(FRAMES)), [0; 2]);
        rig.run("land", 0);
        fly(WARM_UP);
        assert_eq!(both.map(holds_latency), [false; 2], "on the ground");
        robot.end();
    }
}
