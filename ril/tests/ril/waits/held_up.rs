//! What a process calls beside its loop is held up: each call of a kind by three seconds, or a file that never comes.
//! The tables' rows are the kinds.

use std::fs;
use std::path::PathBuf;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use endurance::mavlink::mission::{mission, upload_until};
use endurance::mavlink::station::Station;
use ipc_types::code::{ControlCommand, Reason, Stage};
use ipc_types::payload::{HeroTelemetry, ModuleControl, MovementData, RequestReport};
use ipc_types::{Client, MonotonicNs, Request};
use ril_tests::languages::skip;
use ril_tests::process::{Signal, WAIT_LIMIT};
use ril_tests::{Process, Sandbox, TestDomain};

use super::has_strace;
use crate::common::{Pace, sandbox};

/// Longest time between two samples, until an order is acknowledged, and until a process has ended.
pub const GAP: Duration = Duration::from_millis(300);
pub const ACKNOWLEDGED: Duration = Duration::from_secs(1);
pub const ENDED: Duration = Duration::from_secs(3);

/// For how long a call is held up.
const HELD_UP: Duration = Duration::from_secs(3);

/// A sample or an answer passes at most so many processes, each of which has to wait for a processor.
const HOPS: u32 = 4;

/// For how long telemetry is watched: while at least one call is held up from its beginning to its end.
const WATCHED: Duration = Duration::from_secs(4);

/// How often a row is tried, of which the best counts: what waits for a call that is held up does so each time. The
/// machine's own stalls, and those of its terminals, which are measured beside it, are taken off; an attempt in which
/// it stood still for so long that a call that is held up would not be seen says nothing.
const ATTEMPTS: usize = 5;

/// One attempt at most may take so many times its limit.
const FAR: u32 = 2;

/// Holds up by three seconds from now on: each of these calls of a process, or those that are about one of the files.
/// Nothing if this user may not do that to a process that runs: then the row says only what it does without.
fn hold_up(rig: &Sandbox, process: &Process, calls: &str, files: &[PathBuf]) -> Option<Process> {
    let mut command = Command::new("strace");
    command.args(["-f", "-o", "/dev/null", "-p", &process.id().to_string()]);
    for file in files {
        command.arg("-P").arg(file);
    }
    command.args([
        "-e",
        &format!("trace={calls}"),
        "-e",
        &format!("inject={calls}:delay_enter=3000000"),
    ]);
    let mut strace = rig.spawn(command);
    let told = strace.wait_for_line(|line| line.text.contains("attach"));
    let is_attached = told.text.contains(" attached");
    if !is_attached {
        skip("calls that are held up", &told.text);
    }
    is_attached.then_some(strace)
}

/// An operator's client in this process.
struct Orders<'a> {
    domain: &'a TestDomain,
    last: u64,
}

impl Orders<'_> {
    /// Sends an order. How long until its first report, and which that is.
    fn give<R: Request>(&mut self, order: impl FnOnce(u64) -> R) -> (Duration, RequestReport) {
        self.last += 1;
        let mut client: Client<R> = self.domain.join("operator").client().expect("a client");
        let sent = MonotonicNs::now();
        let mut request = client.request(&order(self.last)).expect("a bridge");
        let report = request.recv_timeout(WAIT_LIMIT).expect("a wait");
        (MonotonicNs::now().since(sent), report.expect("a report"))
    }

    /// The longest that both took in the time of [`WATCHED`].
    fn watch(&mut self) -> Duration {
        let (begun, mut longest) = (Instant::now(), Duration::ZERO);
        while begun.elapsed() < WATCHED {
            longest = longest.max(self.hold_and_land());
        }
        longest
    }

    /// How long until both are acknowledged, whatever the answer is.
    fn hold_and_land(&mut self) -> Duration {
        let (hold, _) = self.give(MovementData::hold);
        let (land, _) = self.give(MovementData::land);
        hold.max(land)
    }
}

/// The longest time between two samples while `work` is done.
fn longest_gap(domain: &TestDomain, work: impl FnOnce()) -> Duration {
    let is_over = AtomicBool::new(false);
    thread::scope(|scope| {
        let watch = scope.spawn(|| {
            let mut samples = domain
                .join("watcher")
                .subscriber::<HeroTelemetry>()
                .expect("a subscriber");
            assert!(samples.recv_timeout(WAIT_LIMIT).expect("a wait").is_some());
            let (mut longest, mut last) = (Duration::ZERO, Instant::now());
            while !is_over.load(Ordering::Relaxed) {
                samples.wait(Duration::from_secs(5)).expect("a wait");
                samples.drain(|_| {}).expect("samples");
                longest = longest.max(last.elapsed());
                last = Instant::now();
            }
            longest
        });
        work();
        is_over.store(true, Ordering::Relaxed);
        watch.join().expect("a watcher")
    })
}

/// How long a process takes to end, until its last words: strace lets no thread go before its three seconds are over.
fn ends(mut process: Process) -> Duration {
    let asked = Instant::now();
    process.signal(Signal::TERM);
    process
        .wait_for_line(|line| line.text.contains(" ended") || line.text.contains("the disk did"));
    let ended = asked.elapsed();
    process.wait_exit();
    ended
}

/// The best of what attempts measured, each by itself, must be within the limits, and no two may be far outside of
/// them: a fault that comes and goes is not the machine's.
pub fn judge<const N: usize>(
    what: &str,
    limits: [Duration; N],
    mut attempt: impl FnMut(&Pace) -> [Duration; N],
) {
    let mut best = [Duration::MAX; N];
    let (mut attempts, mut far) = (Vec::new(), 0);
    for _ in 0..ATTEMPTS {
        let pace = Pace::start();
        let measured = attempt(&pace);
        let (stall, line) = pace.end();
        attempts.push((measured, stall, line));
        let stall = HOPS * stall + line;
        if stall + ACKNOWLEDGED >= HELD_UP {
            continue;
        }
        let own = measured.map(|it| it.saturating_sub(stall));
        best.iter_mut()
            .zip(own)
            .for_each(|(best, it)| *best = it.min(*best));
        let mut own = own.into_iter().zip(limits);
        far += u32::from(own.any(|(it, limit)| it >= FAR * limit));
        assert!(far < 2, "{what}: {attempts:?}, and not near {limits:?}");
        if best.iter().zip(limits).all(|(best, limit)| *best <= limit) {
            println!(
                "{what}: {measured:?}, of which {stall:?} are the machine's; attempts: {attempts:?}"
            );
            return;
        }
    }
    if best[0] == Duration::MAX {
        return skip(
            what,
            &format!("this machine stands still for too long: {attempts:?}"),
        );
    }
    panic!("{what}: {best:?}, and not within {limits:?}; each attempt and its stall: {attempts:?}");
}

/// A robot with a process that is held up; the others are in order.
struct Rig {
    sandbox: Sandbox,
    sim: Process,
    others: Vec<Process>,
}

impl Rig {
    fn new() -> Rig {
        let sandbox = sandbox();
        sandbox.write("bridge.toml", "");
        let sim = sandbox.sim(1, "");
        Rig {
            sandbox,
            sim,
            others: Vec::new(),
        }
    }

    fn orders(&self) -> Orders<'_> {
        Orders {
            domain: &self.sandbox.domain,
            last: 0,
        }
    }

    fn end(self) {
        self.others
            .into_iter()
            .rev()
            .for_each(|process| drop(process.end()));
        self.sim.end();
    }
}

#[test]
fn a_geofence_that_cannot_be_read_holds_the_bridge_up_for_nothing() {
    if !has_strace("a geofence whose file is held up") {
        return;
    }
    judge(
        "bridge, `fence reload`",
        [GAP, ACKNOWLEDGED, ENDED],
        |pace| {
            let mut rig = Rig::new();
            let config = rig.sandbox.path("bridge.toml");
            let bridge = format!("run bridge --port dsp-1 --config {}", config.display());
            let bridge = rig.sandbox.start_ready(&bridge);
            pace.of_line(&bridge);
            rig.others.push(rig.sandbox.status(1));
            rig.sandbox.watch(1).until_ready();
            let strace = hold_up(
                &rig.sandbox,
                &bridge,
                "openat,statx,read",
                std::slice::from_ref(&config),
            );
            let operator = rig.sandbox.domain.join("operator");
            let mut reloads = operator.client::<ModuleControl>().expect("a client");
            let reload = ModuleControl::new(1 << 40, ControlCommand::ReloadFence);
            let mut reload = reloads.request(&reload).expect("a bridge");
            let mut acknowledged = Duration::ZERO;
            let gap = longest_gap(&rig.sandbox.domain, || acknowledged = rig.orders().watch());
            let answer = reload.result().expect("a report");
            let expected = match strace {
                Some(_) => (Some(Stage::Refused), Some(Reason::FenceUnread)),
                None => (Some(Stage::Done), Some(Reason::None)),
            };
            assert_eq!((answer.stage(), answer.reason()), expected);
            drop(reload);
            drop((reloads, operator));
            let ended = ends(bridge);
            rig.end();
            [gap, acknowledged, ended]
        },
    );
}

#[test]
fn looking_for_who_uses_the_port_holds_the_bridge_up_for_nothing() {
    if !has_strace("a look through /proc that is held up") {
        return;
    }
    judge(
        "bridge, the look through /proc",
        [ACKNOWLEDGED, ENDED],
        |pace| {
            let mut rig = Rig::new();
            let bridge = rig.sandbox.start_ready("run bridge --port dsp-1");
            pace.of_line(&bridge);
            rig.sandbox.watch(1).until_ready();
            let _strace = hold_up(
                &rig.sandbox,
                &bridge,
                "openat,getdents64",
                &["/proc".into()],
            );
            // Another terminal, at which the bridge looks for others before it opens it.
            let next = rig.sandbox.start_ready("run sim --link next --seed 1");
            fs::rename(rig.sandbox.path("next"), rig.sandbox.path("dsp-1")).expect("a link");
            std::mem::replace(&mut rig.sim, next).end();
            let acknowledged = rig.orders().watch();
            let ended = ends(bridge);
            rig.end();
            [acknowledged, ended]
        },
    );
}

#[test]
fn looking_who_sends_holds_the_bridge_up_for_nothing() {
    if !has_strace("a look at a sender that is held up") {
        return;
    }
    judge(
        "bridge, the look at a sender",
        [GAP, ACKNOWLEDGED, ACKNOWLEDGED, ENDED],
        |pace| {
            let mut rig = Rig::new();
            let bridge = rig.sandbox.start_ready("run bridge --port dsp-1");
            pace.of_line(&bridge);
            rig.others.push(rig.sandbox.status(1));
            rig.sandbox.watch(1).until_ready();
            // The sender is this process.
            let files = format!("/proc/{}/fd", std::process::id());
            let calls = "openat,getdents64,readlink,readlinkat,statx";
            let _strace = hold_up(&rig.sandbox, &bridge, calls, &[files.into()]);
            let (mut acknowledged, mut started) = (Duration::ZERO, Duration::ZERO);
            let gap = longest_gap(&rig.sandbox.domain, || {
                let mut orders = rig.orders();
                // It waits for the look, and goes on without it.
                let start = |id| ModuleControl::new(id, ControlCommand::Start);
                started = orders.give(start).0;
                acknowledged = orders.watch();
            });
            let ended = ends(bridge);
            rig.end();
            [gap, started, acknowledged, ended]
        },
    );
}

/// What a disk does for what a process writes, and for what it keeps.
const WRITES: &str = "write,pwrite64,fsync,fdatasync,ftruncate";
const KEEPS: &str = "openat,write,fsync,fdatasync,rename,mkdir,statx,flock";

/// Items of a mission that a station uploads: the last one lets the gateway keep it.
const UPLOADED: u16 = 3;

/// A process whose disk is held up.
struct DiskRow {
    args: &'static str,
    /// What it says when its files are there.
    begun: &'static str,
    calls: &'static str,
    /// Its files, and the folder with others.
    files: &'static [&'static str],
    folder: &'static str,
}

const DISKS: [DiskRow; 3] = [
    DiskRow {
        args: "run status --config status.toml",
        begun: "log opened",
        calls: WRITES,
        files: &[],
        folder: "log",
    },
    DiskRow {
        args: "record",
        begun: "recording",
        calls: WRITES,
        files: &[],
        folder: "log",
    },
    DiskRow {
        args: "run mavlink",
        begun: "ready",
        calls: KEEPS,
        files: &[
            "state",
            "state/robot-1.home",
            "state/.robot-1.home.new",
            "state/robot-1.mission",
            "state/.robot-1.mission.new",
            "state/.robot-1.progress.new",
            "state/.robot-1.timestamp.new",
        ],
        folder: "state",
    },
];

#[test]
fn a_disk_that_is_held_up_delays_no_telemetry_no_order_and_no_end() {
    if !has_strace("a disk that is held up") {
        return;
    }
    for row in DISKS {
        judge(row.args, [GAP, ACKNOWLEDGED, ENDED], |pace| {
            with_disk(&row, pace)
        });
    }
}

fn with_disk(row: &DiskRow, pace: &Pace) -> [Duration; 3] {
    let mut rig = Rig::new();
    let mut station = Station::new();
    let port = station.port();
    let log = "[[log]]\ndirectory = 'log'\ngroups = ['time', 'geographic']\n";
    rig.sandbox.write("status.toml", log);
    let stations = format!("port = 0\nstations = ['127.0.0.1:{port}']\nstate = 'state'\n");
    rig.sandbox.write("mavlink.toml", &stations);
    let bridge = rig.sandbox.start_ready("run bridge --port dsp-1");
    pace.of_line(&bridge);
    rig.others.push(bridge);
    if !row.args.contains("status") {
        rig.others.push(rig.sandbox.status(1));
    }
    let mut process = rig.sandbox.start(row.args);
    process.wait_for_text(row.begun);
    rig.sandbox.watch(1).until_ready();
    let mut files: Vec<_> = row
        .files
        .iter()
        .map(|file| rig.sandbox.path(file))
        .collect();
    let folder = fs::read_dir(rig.sandbox.path(row.folder))
        .into_iter()
        .flatten();
    files.extend(folder.flatten().map(|file| file.path()));
    let _strace = hold_up(&rig.sandbox, &process, row.calls, &files);
    let mut acknowledged = Duration::ZERO;
    let gap = longest_gap(&rig.sandbox.domain, || {
        if row.args.contains("mavlink") {
            // Its hold, while what it keeps of this flight is held up.
            station.connect();
            upload_until(
                &mut station,
                &mission(UPLOADED, 15.0),
                Some(UPLOADED.into()),
            );
            let asked = Instant::now();
            station.command(193, [0.0; 7]);
            acknowledged = asked.elapsed();
        }
        acknowledged = acknowledged.max(rig.orders().watch());
    });
    let ended = ends(process);
    rig.end();
    [gap, acknowledged, ended]
}
