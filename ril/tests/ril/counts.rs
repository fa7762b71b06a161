//! What a frame and a second of silence cost, counted instead of timed: instructions by valgrind, system calls by
//! strace. The numbers stand in a table of `docs/performance.md`; what grows by more than 5 % without its number being
//! changed fails here.
//!
//! `RIL_COUNTS_IDLE=1 cargo test --release -p ril --test ril -- --nocapture counts::` makes the column of the release
//! build.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, SystemTime};

use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState};
use ipc_types::{Ipc, Publisher, StateOf, StatusModule, Subscriber, Topic};
use ril_tests::languages::skip;
use ril_tests::process::{Signal, WAIT_LIMIT};
use ril_tests::{Process, Sandbox, pty};

use crate::common::{end, sandbox};

/// By how much a number may exceed that of the table, and by how much that of a silent second, or of a frame that comes
/// in pieces, unless the machine is idle: beside other work the bridge wakes apart for its command (four calls, every
/// 0.9 s) and its state (two, every second), not once for both.
const MARGIN: f64 = 1.05;
const MARGIN_OF_BUSY_SECOND: f64 = 1.4;

/// Frames of one window, four seconds at 50 Hz, and seconds of a silent one.
const FRAMES: u64 = 200;
const SECONDS: u64 = 5;

/// How much earlier than the samples at its ends a window of system calls lies: a silent process has done all that
/// belongs to one wake-up by then, and the next has not come.
const EARLIER: Duration = Duration::from_millis(300);

/// Windows of what is compared, of which the least counts: whatever else the machine does only adds.
const WINDOWS: usize = 3;

/// Samples that are published and taken under callgrind.
const HOPS: u64 = 500;

/// The variable by which this program, started again, learns that it is the counted process, and the test that is its
/// work.
const CHILD: &str = "RIL_COUNTS_CHILD";
const THIS_TEST: &str = "counts::this_is_the_counted_process";

/// The column of the table that this build fills.
const COLUMN: usize = if cfg!(debug_assertions) { 3 } else { 2 };

/// The file with the table.
fn page() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/performance.md")
}

/// The numbers of this build in the table, by what they count.
fn table() -> BTreeMap<String, f64> {
    let text = fs::read_to_string(page()).unwrap();
    let (_, from) = text.split_once("<!-- counts -->").expect("the table");
    let (table, _) = from.split_once("<!-- end of counts -->").expect("its end");
    let rows = table.lines().filter(|line| line.starts_with('|')).skip(2);
    rows.filter_map(|row| {
        let cells: Vec<_> = row.split('|').map(str::trim).collect();
        let number = cells[COLUMN].replace(',', "");
        // A column that was not made yet has none.
        Some((cells[1].to_owned(), number.parse().ok()?))
    })
    .collect()
}

/// The variable that says that the machine is idle: then the instructions of whole processes are counted, too, and all
/// windows.
const IDLE: &str = "RIL_COUNTS_IDLE";

fn is_idle() -> bool {
    std::env::var_os(IDLE).is_some()
}

/// Whether the instructions of whole processes can be counted. They grow with what else the machine does, because a
/// frame takes longer and more timers expire in it. A line on standard error says when they cannot.
fn counts_whole_processes() -> bool {
    if !is_idle() {
        skip(
            "instructions of whole processes",
            &format!("they are counted with {IDLE}=1 on an idle machine"),
        );
    }
    is_idle() && has(&["valgrind", "vgdb"])
}

/// Prints a number and compares it with the table.
#[track_caller]
fn judge(name: &str, counted: f64, margin: f64) {
    println!("| {name} | {counted:.1} |");
    if let Some(most) = most(name, margin) {
        assert!(
            counted <= most,
            "{name}: {counted:.1}, more than {most:.1}; is it worth that? Then change its number in docs/performance.md"
        );
    }
}

/// How much may be counted; `None` if the table has no number.
fn most(name: &str, margin: f64) -> Option<f64> {
    Some(table().get(name)? * margin)
}

/// Whether the tools are there. A line on standard error says when they are not, also when tests that pass print
/// nothing.
fn has(tools: &[&str]) -> bool {
    let missing: Vec<_> = tools.iter().filter(|tool| !is_there(tool)).collect();
    if !missing.is_empty() {
        skip("counts", &format!("this machine has no {missing:?}"));
    }
    missing.is_empty()
}

fn is_there(tool: &str) -> bool {
    let mut command = Command::new(tool);
    command.arg("--version").stdout(Stdio::null());
    command.stderr(Stdio::null()).status().is_ok()
}

/// What counts.
#[derive(Clone, Copy)]
enum Counter {
    Instructions,
    SystemCalls,
    /// The one wait of a process with descriptors.
    Wakes,
}

/// A process that is counted.
struct Counted {
    process: Process,
    counter: Counter,
    file: PathBuf,
}

impl Counted {
    /// Starts `ril` with these arguments.
    fn start(rig: &Sandbox, counter: Counter, name: &str, args: &str) -> Counted {
        let file = rig.folder().join(format!("{name}.out"));
        let ril = env!("CARGO_BIN_EXE_ril");
        let line = match counter {
            Counter::Instructions => format!(
                "exec valgrind -q --tool=callgrind --callgrind-out-file={} {ril} {args}",
                file.display()
            ),
            Counter::SystemCalls | Counter::Wakes => {
                let what = match counter {
                    Counter::Wakes => "ppoll",
                    _ => "all",
                };
                format!(
                    "exec strace -D -f -qq -ttt -e trace={what} -o {} {ril} {args}",
                    file.display()
                )
            }
        };
        let mut process = Process::spawn(&rig.domain, rig.shell(&line));
        process.wait_for_text("ready");
        Counted {
            process,
            counter,
            file,
        }
    }

    /// Begins a window.
    fn begin(&self) -> Duration {
        if let Counter::Instructions = self.counter {
            self.tell("zero");
        }
        now()
    }

    /// Ends the window that began then, and says what was counted in it.
    fn end(&self, begun: Duration) -> f64 {
        match self.counter {
            Counter::Instructions => self.dump(),
            Counter::SystemCalls | Counter::Wakes => {
                let window = [begun, now()].map(|edge| (edge - EARLIER).as_secs_f64());
                let text = fs::read_to_string(&self.file).unwrap();
                let calls = text.lines().filter(|line| !line.contains(" resumed>"));
                let times = calls.filter_map(|line| line.split_whitespace().nth(1)?.parse().ok());
                times
                    .filter(|at: &f64| (window[0]..window[1]).contains(at))
                    .count() as f64
            }
        }
    }

    fn tell(&self, what: &str) {
        let pid = format!("--pid={}", self.process.id());
        let mut command = Command::new("vgdb");
        command.args([pid.as_str(), what]);
        let output = command.output().unwrap();
        assert!(output.status.success(), "{output:?}");
    }

    /// What was counted since it was set to zero.
    fn dump(&self) -> f64 {
        self.tell("dump");
        let folder = self.file.parent().unwrap();
        let name = self.file.file_name().unwrap().to_str().unwrap();
        let dumps = fs::read_dir(folder).unwrap().filter_map(|entry| {
            let path = entry.unwrap().path();
            let number = path
                .file_name()?
                .to_str()?
                .strip_prefix(name)?
                .strip_prefix('.')?;
            Some((number.parse::<u32>().ok()?, path))
        });
        let (_, newest) = dumps.max().expect("a dump");
        total(&newest)
    }
}

/// The instructions of a file of callgrind.
fn total(file: &Path) -> f64 {
    let text = fs::read_to_string(file).unwrap();
    let line = text.lines().find_map(|line| line.strip_prefix("totals: "));
    line.expect("a total").trim().parse().unwrap()
}

/// The time as strace writes it.
fn now() -> Duration {
    SystemTime::now()
        .duration_since(SystemTime::UNIX_EPOCH)
        .unwrap()
}

/// Waits for so many samples more.
fn wait_for<T: Topic>(samples: &mut Subscriber<T>, count: u64) {
    for _ in 0..count {
        assert!(samples.recv_timeout(WAIT_LIMIT).unwrap().is_some());
    }
}

/// What the windows are divided by.
#[derive(Clone, Copy)]
enum Per {
    Sample,
    /// Of a line that brings it in pieces, of which the last one is late while the machine is busy, and then wakes by
    /// itself.
    SampleInPieces,
    Second,
}

/// Compares the least of the windows, each of which lasts for `count` samples, with the table. Unless the machine is
/// idle, a window that is within the table is the last.
#[track_caller]
fn judge_windows<T: Topic>(name: &str, counted: &Counted, ipc: &Ipc, count: u64, per: Per) {
    let mut samples = ipc.subscriber::<T>().unwrap();
    wait_for(&mut samples, count / 2);
    let margin = match per {
        Per::Second | Per::SampleInPieces if !is_idle() => MARGIN_OF_BUSY_SECOND,
        _ => MARGIN,
    };
    let mut least = f64::INFINITY;
    for _ in 0..WINDOWS {
        while samples.try_recv().unwrap().is_some() {}
        let before = samples.losses();
        let begun = counted.begin();
        wait_for(&mut samples, count);
        let seconds = (now() - begun).as_secs_f64();
        let sum = counted.end(begun);
        while samples.try_recv().unwrap().is_some() {}
        let after = samples.losses();
        let passed = match per {
            Per::Sample | Per::SampleInPieces => {
                ((after.received + after.lost) - (before.received + before.lost)) as f64
            }
            Per::Second => seconds,
        };
        least = least.min(sum / passed);
        if !is_idle() && most(name, margin).is_some_and(|most| least <= most) {
            break;
        }
    }
    judge(name, least, margin);
}

fn frames(counter: Counter, of: &str) {
    let rig = sandbox();
    // Frames that come in one piece: how many pieces of a paced line are read together is a matter of how busy the
    // machine is.
    rig.write("sim.toml", "[serial]\nbaud_rate = 0\n");
    let sim = rig.sim(1, "--config sim.toml");
    let ipc = rig.domain.join("test");
    let bridge = Counted::start(&rig, counter, "bridge", "run bridge --port dsp-1");
    let status = Counted::start(&rig, counter, "status", "run status");
    let name = |who| format!("{who}, {of}, a frame at 50 Hz");
    judge_windows::<DspTelemetry>(&name("bridge"), &bridge, &ipc, FRAMES, Per::Sample);
    judge_windows::<HeroTelemetry>(&name("status"), &status, &ipc, FRAMES, Per::Sample);
    end(status.process, Signal::TERM);
    end(bridge.process, Signal::TERM);
    end(sim, Signal::TERM);
}

/// What the bridge takes for a frame on a line that brings it in pieces, as the simulator does at its default speed.
fn paced_frames(counter: Counter, of: &str) {
    let rig = sandbox();
    let sim = rig.sim(1, "");
    let ipc = rig.domain.join("test");
    let bridge = Counted::start(&rig, counter, "bridge", "run bridge --port dsp-1");
    let name = format!("bridge, {of}, a frame at 115200 baud");
    judge_windows::<DspTelemetry>(&name, &bridge, &ipc, FRAMES, Per::SampleInPieces);
    end(bridge.process, Signal::TERM);
    end(sim, Signal::TERM);
}

fn silence(counter: Counter, of: &str) {
    let rig = sandbox();
    let (_line, port) = pty::open();
    let port = port.display();
    let ipc = rig.domain.join("test");
    let bridge = Counted::start(
        &rig,
        counter,
        "bridge",
        &format!("run bridge --port {port}"),
    );
    let status = Counted::start(&rig, counter, "status", "run status");
    let name = |who| format!("{who}, {of}, a silent second");
    // Each is published once a second.
    judge_windows::<ModuleState>(&name("bridge"), &bridge, &ipc, SECONDS, Per::Second);
    judge_windows::<StateOf<StatusModule>>(&name("status"), &status, &ipc, SECONDS, Per::Second);
    end(status.process, Signal::TERM);
    end(bridge.process, Signal::TERM);
}

#[test]
fn the_instructions_of_a_frame_stay() {
    if counts_whole_processes() {
        frames(Counter::Instructions, "instructions");
    }
}

#[test]
fn the_instructions_of_a_frame_that_comes_in_pieces_stay() {
    if counts_whole_processes() {
        paced_frames(Counter::Instructions, "instructions");
    }
}

#[test]
fn a_frame_that_comes_in_pieces_wakes_the_bridge_for_its_beginning_and_its_end() {
    if has(&["strace"]) {
        paced_frames(Counter::Wakes, "wakes");
        paced_frames(Counter::SystemCalls, "system calls");
    }
}

#[test]
fn the_instructions_of_a_silent_second_stay() {
    if counts_whole_processes() {
        silence(Counter::Instructions, "instructions");
    }
}

#[test]
fn the_system_calls_of_a_frame_stay() {
    if has(&["strace"]) {
        frames(Counter::SystemCalls, "system calls");
    }
}

#[test]
fn the_system_calls_of_a_silent_second_stay() {
    if has(&["strace"]) {
        silence(Counter::SystemCalls, "system calls");
    }
}

#[test]
fn the_instructions_of_a_hop_stay() {
    if !has(&["valgrind"]) {
        return;
    }
    let rig = sandbox();
    let file = rig.folder().join("hop.out");
    let mut command = Command::new("valgrind");
    command.args(["-q", "--tool=callgrind", "--compress-strings=no"]);
    command.arg(format!("--callgrind-out-file={}", file.display()));
    command.arg(std::env::current_exe().unwrap());
    command.args(["--exact", THIS_TEST]);
    command.env(CHILD, "yes");
    Process::spawn(&rig.domain, rig.place(command)).exits(0);
    let profile = fs::read_to_string(&file).unwrap();
    judge(
        "publish, instructions",
        per_call(&profile, "publish_once"),
        MARGIN,
    );
    judge(
        "take, instructions",
        per_call(&profile, "take_once"),
        MARGIN,
    );
}

/// The instructions of a call of this function, with all that it calls, in a file of callgrind.
fn per_call(profile: &str, function: &str) -> f64 {
    // `cfn=name`, `calls=count position`, and a line with the position of the call and the instructions of all of these
    // calls.
    let mut lines = profile.lines();
    let called = |line: &str| line.starts_with("cfn=") && line.ends_with(function);
    lines.find(|line| called(line)).expect("its calls");
    let mut number = |of: usize| -> f64 {
        let line = lines.next().unwrap().trim_start_matches("calls=");
        line.split(' ').nth(of).unwrap().parse().unwrap()
    };
    let calls = number(0);
    number(1) / calls
}

/// Publishes to a subscriber in the same process, which takes each sample.
#[test]
fn this_is_the_counted_process() {
    if std::env::var_os(CHILD).is_none() {
        return;
    }
    let ipc = Ipc::connect("counted").unwrap();
    let mut publisher = ipc.publisher::<HeroTelemetry>().unwrap();
    let mut subscriber = ipc.subscriber::<HeroTelemetry>().unwrap();
    // The first hop makes the connection, and isn't counted.
    publisher.publish(|_| {}).unwrap();
    assert!(subscriber.try_recv().unwrap().is_some());
    for _ in 0..HOPS {
        publish_once(&mut publisher);
        take_once(&mut subscriber);
    }
}

#[inline(never)]
fn publish_once(publisher: &mut Publisher<HeroTelemetry>) {
    publisher.publish(|sample| sample.flying = 1).unwrap();
}

#[inline(never)]
fn take_once(subscriber: &mut Subscriber<HeroTelemetry>) {
    assert!(subscriber.try_recv().unwrap().is_some());
}
