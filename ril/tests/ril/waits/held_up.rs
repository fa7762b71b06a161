//! What a process calls beside its loop is held up: each call of a kind by three seconds, or a file that never comes.
//! The tables' rows are the kinds.

use std::fs;
use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, Instant};

use ipc_types::code::{ControlCommand, Reason, Stage};
use ipc_types::payload::ModuleControl;
use ril_tests::languages::skip;
use ril_tests::pace::{self, ACKNOWLEDGED, ENDED, GAP, OrderWatch, Pace, gaps, judge};
use ril_tests::process::Signal;
use ril_tests::{Process, Sandbox};

use super::has_strace;
use crate::common::sandbox;

/// strace, which holds up calls of a process.
pub struct HeldUp {
    strace: Process,
    file: PathBuf,
}

impl HeldUp {
    /// Holds up by three seconds from now on: each of these calls of a process, or those that are about one of the
    /// files. Nothing if this user may not do that to a process that runs: then the row says only what it does without.
    pub fn start(
        rig: &Sandbox,
        process: &Process,
        calls: &str,
        files: &[PathBuf],
    ) -> Option<HeldUp> {
        let file = rig.path("held-up");
        let mut command = Command::new("strace");
        command.arg("-fo").arg(&file);
        command.args(["-p", &process.id().to_string()]);
        // As the process names it, too, whose folder is the same.
        for file in files {
            let named = file.strip_prefix(rig.folder()).ok();
            for name in [Some(file.as_path()), named].into_iter().flatten() {
                command.arg("-P").arg(name);
            }
        }
        let delay = format!("inject={calls}:delay_enter={}", pace::HELD_UP.as_micros());
        command.args(["-e", &format!("trace={calls}"), "-e", &delay]);
        let mut strace = rig.spawn(command);
        let told = strace.wait_for_line(|line| line.text.contains("attach"));
        let is_attached = told.text.contains(" attached");
        if !is_attached {
            skip("calls that are held up", &told.text);
        }
        is_attached.then_some(HeldUp { strace, file })
    }

    /// When its process has ended: something was held up, if this user may do that.
    #[track_caller]
    pub fn end(held_up: Option<HeldUp>) {
        let Some(HeldUp { mut strace, file }) = held_up else {
            return;
        };
        strace.wait_exit();
        let calls = fs::read_to_string(file).expect("a file of strace");
        // To its end, or until the process ended.
        let is_held_up = calls.contains("(DELAYED)") || calls.contains("= ?");
        assert!(is_held_up, "nothing was held up: {calls}");
    }
}

/// How long a process takes to end, until one of its last words: strace lets no thread go before its three seconds are
/// over.
pub fn ends(mut process: Process, last_words: &[&str]) -> Duration {
    let asked = Instant::now();
    process.signal(Signal::TERM);
    let is_last = |text: &str| last_words.iter().any(|words| text.contains(words));
    process.wait_for_line(|line| is_last(&line.text));
    let ended = asked.elapsed();
    process.wait_exit();
    ended
}

/// What a process says at its end.
const ENDED_IN_ORDER: &[&str] = &[" ended"];

/// A robot with a process that is held up; the others are in order.
pub struct Rig {
    pub sandbox: Sandbox,
    sim: Process,
    pub others: Vec<Process>,
}

impl Rig {
    pub fn new() -> Rig {
        let sandbox = sandbox();
        sandbox.write("bridge.toml", "");
        let sim = sandbox.sim(1, "");
        Rig {
            sandbox,
            sim,
            others: Vec::new(),
        }
    }

    /// Starts a bridge with these arguments, and status. It is ready.
    fn start_bridge(&mut self, args: &str, pace: &Pace) -> Process {
        let bridge = self.sandbox.start_ready(args);
        pace.of_line(&bridge);
        self.others.push(self.sandbox.status(1));
        self.sandbox.watch(1).until_ready();
        bridge
    }

    pub fn orders(&self) -> OrderWatch<'_> {
        OrderWatch::new(&self.sandbox.domain)
    }

    pub fn end(self) {
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
            let bridge = rig.start_bridge(&bridge, pace);
            let calls = "openat,statx,read";
            let held_up = HeldUp::start(&rig.sandbox, &bridge, calls, &[config]);
            let operator = rig.sandbox.domain.join("operator");
            let mut reloads = operator.client::<ModuleControl>().expect("a client");
            let reload = ModuleControl::new(1 << 40, ControlCommand::ReloadFence);
            let mut reload = reloads.request(&reload).expect("a bridge");
            let mut acknowledged = Duration::ZERO;
            let robot = pace::telemetry(&rig.sandbox.domain);
            let [gap] = gaps([robot], || acknowledged = rig.orders().hold_and_land());
            let answer = reload.result().expect("a report");
            let expected = match held_up {
                Some(_) => (Some(Stage::Refused), Some(Reason::FenceUnread)),
                None => (Some(Stage::Done), Some(Reason::None)),
            };
            assert_eq!((answer.stage(), answer.reason()), expected);
            drop(reload);
            drop((reloads, operator));
            let ended = ends(bridge, ENDED_IN_ORDER);
            HeldUp::end(held_up);
            rig.end();
            [gap, acknowledged, ended]
        },
    );
}

/// What of the port is held up.
struct PortRow {
    what: &'static str,
    calls: &'static str,
    files: fn(&Sandbox) -> Vec<PathBuf>,
    /// Whether the DSP gets another terminal, which the bridge opens when it has closed the old one.
    moves: bool,
}

/// Where the simulator's link leads.
fn terminal(rig: &Sandbox, link: &str) -> PathBuf {
    fs::canonicalize(rig.path(link)).expect("a terminal")
}

/// The calls that give a terminal back.
const CLOSES: &str = "close,flock,ioctl";

const PORTS: [PortRow; 4] = [
    PortRow {
        what: "the look through /proc",
        calls: "openat,getdents64",
        files: |_| vec!["/proc".into()],
        moves: true,
    },
    PortRow {
        what: "the opening",
        calls: "openat,statx,flock,ioctl",
        files: |rig| vec![rig.path("dsp-1"), terminal(rig, "next")],
        moves: true,
    },
    PortRow {
        what: "the closing of one that is gone",
        calls: CLOSES,
        files: |rig| vec![terminal(rig, "dsp-1")],
        moves: true,
    },
    PortRow {
        what: "the closing at the end",
        calls: CLOSES,
        files: |rig| vec![terminal(rig, "dsp-1")],
        moves: false,
    },
];

#[test]
fn opening_and_closing_the_port_holds_the_bridge_up_for_nothing() {
    if !has_strace("a port that is held up") {
        return;
    }
    for row in PORTS {
        let what = format!("bridge, {}", row.what);
        judge(&what, [GAP, ACKNOWLEDGED, ENDED], |pace| {
            with_port(&row, pace)
        });
    }
}

fn with_port(row: &PortRow, pace: &Pace) -> [Duration; 3] {
    let mut rig = Rig::new();
    let bridge = rig.start_bridge("run bridge --port dsp-1", pace);
    let next = rig.sandbox.start_ready("run sim --link next --seed 1");
    let held_up = HeldUp::start(&rig.sandbox, &bridge, row.calls, &(row.files)(&rig.sandbox));
    let mut acknowledged = Duration::ZERO;
    let mut gap = Duration::ZERO;
    if row.moves {
        fs::rename(rig.sandbox.path("next"), rig.sandbox.path("dsp-1")).expect("a link");
        std::mem::replace(&mut rig.sim, next).end();
        acknowledged = rig.orders().hold_and_land();
    } else {
        let robot = pace::telemetry(&rig.sandbox.domain);
        [gap] = gaps([robot], || acknowledged = rig.orders().hold_and_land());
        rig.others.push(next);
    }
    let last_words = match (row.moves, &held_up) {
        (false, Some(_)) => &["the port does not answer"],
        _ => ENDED_IN_ORDER,
    };
    let ended = ends(bridge, last_words);
    HeldUp::end(held_up);
    rig.end();
    [gap, acknowledged, ended]
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
            let bridge = rig.start_bridge("run bridge --port dsp-1", pace);
            // The sender is this process.
            let files = format!("/proc/{}/fd", std::process::id());
            let calls = "openat,getdents64,readlink,readlinkat,statx";
            let held_up = HeldUp::start(&rig.sandbox, &bridge, calls, &[files.into()]);
            let (mut acknowledged, mut started) = (Duration::ZERO, Duration::ZERO);
            let robot = pace::telemetry(&rig.sandbox.domain);
            let [gap] = gaps([robot], || {
                let mut orders = rig.orders();
                // It waits for the look, and goes on without it.
                let start = |id| ModuleControl::new(id, ControlCommand::Start);
                started = orders.give(start).0;
                acknowledged = orders.hold_and_land();
            });
            let ended = ends(bridge, ENDED_IN_ORDER);
            HeldUp::end(held_up);
            rig.end();
            [gap, started, acknowledged, ended]
        },
    );
}
