//! The hostile or unlucky neighbour: clients that send without a pause, a `/dev/shm` that is full or has very many
//! files of another user, and containers.
//!
//! What fills `/dev/shm` has one of its own: [`run_again`] starts the program itself in a mount namespace where that is
//! a fresh file system, so that it hurts nobody.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::os::unix::fs::chown;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use ipc_types::code::{Reason, Stage};
use ipc_types::payload::{HeroTelemetry, MovementData};
use ipc_types::{Domain, Ipc, RobotId};
use ril_tests::Process;
use ril_tests::process::{Finished, Signal, Stream};

use crate::listener::Listener;
use crate::plan::Kind;
use crate::site::{Site, kill, require_done};
use measure::{Outcome, Times};

/// How many clients flood the bridge; half of the places that a service has.
const FLOODERS: u64 = 8;

/// How long a flooder waits for answers before it tries to send again: there are none while others have filled the
/// queue.
const FULL_LIMIT: Duration = Duration::from_millis(10);

/// What the operator asks for, and whether it is done as soon as it is answered.
const ORDERS: [(&str, bool); 8] = [
    ("start", true),
    ("takeoff --altitude 5", false),
    ("goto 37.4112,-6.0010,25 --no-wait", true),
    ("hold", false),
    ("status", false),
    ("land", false),
    ("echo hero --count 50", false),
    ("stop", true),
];

/// Clients that send one request after the other without a pause, while the helicopter flies: an operator must get
/// through.
pub fn flood(site: &Site) {
    let chain = site.start_chain(4);
    let over = Arc::new(AtomicBool::new(false));
    let answered = Arc::new(AtomicU64::new(0));
    let flooders: Vec<_> = (1..=FLOODERS)
        .map(|number| flooder(&site.domain, number, &over, &answered))
        .collect();
    let mut outcome = Outcome::default();
    let (mut done, mut answers) = (0, Times::default());
    for _ in 0..site.plan.count(20) {
        for (order, is_at_once) in ORDERS {
            if !site.goes_on() {
                break;
            }
            let started = Instant::now();
            let is_done = require_done(&mut outcome, order, &site.finish(order));
            if is_done && is_at_once {
                answers.push(started.elapsed());
            }
            done += u32::from(is_done);
        }
    }
    over.store(true, Ordering::Relaxed);
    for flooder in flooders {
        flooder.join().expect("it ends in order");
    }
    outcome.cell("requests of the flood", answered.load(Ordering::Relaxed));
    outcome.cell("orders done", done);
    outcome.cell("answered", answers);
    site.end(chain, true);
    site.show(outcome);
}

/// Sends a request that is always refused, as soon as the one before it was. As many as that are of one process: they
/// have nothing in common but the processor.
fn flooder(
    domain: &Domain,
    number: u64,
    over: &Arc<AtomicBool>,
    answered: &Arc<AtomicU64>,
) -> JoinHandle<()> {
    let (domain, over, answered) = (domain.clone(), Arc::clone(over), Arc::clone(answered));
    thread::spawn(move || {
        let ipc = Ipc::join(&domain, RobotId::DEFAULT, "flooder").expect("a part");
        let mut client = ipc.client::<MovementData>().expect("a client");
        // Ids that no other client has.
        let first = number << 48;
        let (mut id, mut own) = (first, 0);
        while !over.load(Ordering::Relaxed) {
            // As many as there is room for. What does not fit now does after the answers.
            while client.send(&MovementData::take_off(id, f64::NAN)).is_ok() {
                id += 1;
            }
            client.wait(FULL_LIMIT).expect("a wait");
            client.drain(|report| {
                let refusals = [Some(Reason::NotFinite), Some(Reason::TooManyRequests)];
                let is_refused = report.stage() == Some(Stage::Refused);
                assert!(
                    is_refused && refusals.contains(&report.reason()),
                    "{report:?}"
                );
                answered.fetch_add(1, Ordering::Relaxed);
                own += 1;
            });
        }
        assert_eq!(
            own + client.outstanding() as u64,
            id - first,
            "none is missing"
        );
    })
}

/// Tells a program that `/dev/shm` is its own already.
const INSIDE: &str = "RIL_OWN_MEMORY";

/// Mounts a file system over a folder, and becomes the program. `$1` are the options of the mount, `$2` is the folder.
const MOUNT: &str = "mount -t tmpfs -o \"$1\" tmpfs \"$2\" && shift 2 && exec \"$@\"\n";

/// Options of a `/dev/shm` that is to be filled.
pub const SMALL: &str = "size=64m,nr_inodes=4000";

/// Options of a `/dev/shm` for very many files.
pub const LARGE: &str = "size=512m,nr_inodes=1m";

/// Whether `/dev/shm` is this program's own.
pub fn is_own_memory() -> bool {
    std::env::var_os(INSIDE).is_some()
}

/// Runs this program again, with `args`, with a `/dev/shm` that is mounted with `options`. `None` when the kernel
/// forbids that; the reason is printed.
///
/// # Errors
///
/// When it cannot be started.
pub fn run_again(options: &str, args: &[String]) -> io::Result<Option<ExitStatus>> {
    let Some(starter) = starter("-m") else {
        return Ok(None);
    };
    let mut words = starter.split_whitespace();
    let mut command = Command::new(words.next().unwrap_or_default());
    command
        .args(words)
        .args(["sh", "-c", MOUNT, "sh", options, "/dev/shm"]);
    command.arg(std::env::current_exe()?).args(args);
    command.env(INSIDE, "1").status().map(Some)
}

/// The beginning of a command line that makes a namespace, `None` when the kernel forbids it; the reason is printed.
fn starter(flags: &str) -> Option<String> {
    // A user who is not root becomes root of a user namespace first.
    let user = match rustix::process::geteuid().is_root() {
        true => "",
        false => "-r ",
    };
    let starter = format!("unshare {user}{flags} --fork --kill-child");
    let mut words = starter.split_whitespace();
    let program = words.next()?;
    let attempt = Command::new(program).args(words).arg("true").output();
    if attempt.as_ref().is_ok_and(|output| output.status.success()) {
        return Some(starter);
    }
    eprintln!("SKIPPED: no namespace of its own: {attempt:?}");
    None
}

/// Samples that each healthy consumer must get while nothing can be had: more than the buffers of the others hold, so
/// that their publishers use all of their memory.
const SAMPLES: usize = 300;

/// What healthy consumers do, which wait so long for a publisher that is gone.
const IMPATIENT: &str = "--json --field sequence --timeout 10s";

/// A `/dev/shm` without a free byte: what flies must fly on, and must be landed.
pub fn no_bytes(site: &Site) {
    fill(site, "Bytes", &|path| {
        let mut file = File::create_new(path)?;
        loop {
            file.write_all(&[1; 4096])?;
        }
    });
}

/// Fills the file system's inodes, so that no file can be made.
pub fn no_files(site: &Site) {
    fill(site, "Inodes", &|path| File::create_new(path).map(drop));
}

fn fill(site: &Site, lack: &str, make: &dyn Fn(&Path) -> io::Result<()>) {
    assert!(is_own_memory(), "it would fill the memory of everybody");
    let [sim, bridge, status] = site.start_flight();
    let echo = |topic: &str| {
        let mut echo = site.start(&format!("echo {topic} {IMPATIENT}"));
        echo.wait_for_line(|line| line.stream == Stream::Stdout);
        echo
    };
    let (mut raw, mut hero, stuck) = (echo("dsp"), echo("hero"), echo("dsp"));
    stuck.signal(Signal::STOP);
    let files = (0..).map(|number| PathBuf::from(format!("/dev/shm/filler-{number}")));
    let mut made = Vec::new();
    for path in files {
        let result = make(&path);
        made.push(path);
        if let Err(full) = result {
            assert_eq!(full.kind(), ErrorKind::StorageFull, "{full}");
            break;
        }
    }
    let mut outcome = Outcome::default();
    outcome.cell("nothing left", lack);
    let mut samples = |heading, consumer: &mut Process| {
        // At its end it prints a summary on standard error.
        let mut lines = (0..SAMPLES).map(|_| consumer.wait_for_line(|_| true).stream);
        let count = lines
            .position(|stream| stream != Stream::Stdout)
            .unwrap_or(SAMPLES);
        outcome.cell(heading, count);
        outcome.require(count == SAMPLES, format!("{heading}: {count} of {SAMPLES}"));
    };
    samples("samples of the bridge", &mut raw);
    // Without the bridge, status is silent and its consumer waits.
    if bridge.is_running() {
        samples("of status", &mut hero);
        for request in ["land", "stop"] {
            let is_done = require_done(&mut outcome, request, &site.finish(request));
            outcome.cell(request, if is_done { "done" } else { "NOT done" });
        }
    }
    for (name, process) in [("bridge", &bridge), ("status", &status)] {
        outcome.require(process.is_running(), format!("{name} DIED"));
    }
    for file in made {
        let _ = fs::remove_file(file);
    }
    // They are killed; what they leave goes with the file system.
    drop((raw, hero, stuck, status, bridge, sim));
    site.end([], true);
    site.show(outcome);
}

/// Another user: `nobody`.
const NOBODY: u32 = 65534;

/// Samples that are received before the foreign files are made, and after: 4 s, in which the processes clean up several
/// times. One comes every 5 ms, because the simulated clock is four times as fast.
const SAMPLES_BETWEEN: usize = 800;

/// Very many files of another user in `/dev/shm`, made in flight: what lists that folder takes longer with each of
/// them.
pub fn foreign_files(site: &Site) {
    assert!(is_own_memory(), "everybody would have to live with them");
    let count = site.plan.count(200_000);
    let files = (0..count).map(|number| format!("/dev/shm/foreign-{number}"));
    let files: Arc<[String]> = files.collect();
    let [sim, mut bridge, status] = site.start_flight();
    let listener = Listener::start(&site.domain, RobotId::DEFAULT, |_: &HeroTelemetry| ());
    let mut outcome = Outcome::default();
    outcome.cell("files", count);
    outcome.cell("between samples, before", listener.gaps(SAMPLES_BETWEEN));
    let making = thread::spawn({
        let files = Arc::clone(&files);
        move || files.iter().for_each(|path| make_foreign(path))
    });
    let mut among = Times::default();
    while !making.is_finished() {
        among.extend(listener.gaps(1).0);
    }
    making.join().expect("the files can be made");
    among.extend(listener.gaps(SAMPLES_BETWEEN).0);
    outcome.cell("among them", among);

    let started = Instant::now();
    site.ask("status");
    outcome.cell("state, ms", started.elapsed().as_millis());
    site.ask("land");
    site.ask("stop");
    kill(&mut bridge);
    let (bridge, restart) = site.start_working(Kind::Bridge);
    outcome.cell("restart, ms", restart.as_millis());
    listener.gaps(SAMPLES_BETWEEN);
    listener.end();
    for path in &*files {
        fs::remove_file(path).expect("it is still there");
    }
    site.end([sim, bridge, status], false);
    site.show(outcome);
}

fn make_foreign(path: &str) {
    File::create_new(path).expect("a file");
    if rustix::process::geteuid().is_root() {
        // Root of a user namespace has nobody to give them to.
        let _ = chown(path, Some(NOBODY), None);
    }
}

/// Starts at the same moment, half of them in each kind of namespace.
const TOGETHER: usize = 6;

/// How far the monotonic clock of another container is ahead, s.
const AHEAD_S: i64 = 100_000;

/// A user that need not exist by name.
const OTHER_USER: u32 = 65_533;

/// What a consumer does that must get samples.
const CONSUMER: &str = "echo hero --count 3 --timeout 20s";

/// Counts what was tried, and notes what went wrong.
#[derive(Default)]
struct Tried {
    count: u32,
    outcome: Outcome,
}

impl Tried {
    /// A command must have this exit code, and say all of `texts`.
    fn expect(&mut self, args: &str, finished: &Finished, code: i32, texts: &[&str]) {
        let words = [&finished.stdout[..], &finished.stderr].concat().join(" ");
        let found = finished.code();
        let is_right = found == Some(code) && texts.iter().all(|text| words.contains(text));
        self.count += 1;
        self.outcome
            .require(is_right, format!("{args}: {found:?}: {words}"));
    }

    fn show(mut self, site: &Site, what: &'static str) {
        self.outcome.cell(what, self.count);
        site.show(self.outcome);
    }
}

/// Consumers in namespaces of their own that all are the same process number, as containers with one `/dev/shm` do.
pub fn same_numbers(site: &Site) {
    let Some(starter) = starter("-p --mount-proc") else {
        return;
    };
    let chain = site.start_chain(4);
    let mut tried = Tried::default();
    while tried.count < site.plan.count(600) && site.goes_on() {
        let consumers = [(); TOGETHER].map(|()| site.start_by(&starter, CONSUMER));
        for mut consumer in consumers {
            tried.expect(CONSUMER, &consumer.wait_exit(), 0, &[]);
        }
    }
    site.end(chain, true);
    tried.show(site, "consumers of the same process number");
}

/// Consumers whose clocks are ahead of the bridge's, and behind.
pub fn other_clocks(site: &Site) {
    let uptime = rustix::time::clock_gettime(rustix::time::ClockId::Boottime);
    let offsets_s = [AHEAD_S, -uptime.tv_sec / 2];
    let starters = offsets_s.map(|offset_s| starter(&format!("-T --monotonic={offset_s}")));
    let [Some(ahead), Some(behind)] = starters else {
        return;
    };
    let chain = site.start_chain(4);
    let mut tried = Tried::default();
    for starter in [ahead, behind] {
        let finished = site.start_by(&starter, CONSUMER).wait_exit();
        tried.expect(&starter, &finished, 0, &[]);
    }
    site.end(chain, true);
    tried.show(site, "consumers with another clock");
}

/// A consumer with mounts of its own and the common `/dev/shm`, and commands with a `/dev/shm` of their own, which must
/// find no robot and disturb none.
pub fn other_mounts(site: &Site) {
    let Some(starter) = starter("-m") else { return };
    site.write("mount.sh", MOUNT);
    let chain = site.start_chain(4);
    let mut tried = Tried::default();
    let own = format!("{starter} sh mount.sh {LARGE} /dev/shm");
    let none = format!("no robot is alive in {}", site.domain.root().display());
    let none = none.as_str();
    for (starter, args, code, text) in [
        (&starter, CONSUMER, 0, ""),
        (&own, "status --timeout 1s", 3, none),
        (&own, "takeoff --altitude 5 --timeout 1s", 3, none),
        (&own, "echo hero --duration 1s --timeout 1s", 3, none),
    ] {
        let finished = site.start_by(starter, args).wait_exit();
        tried.expect(args, &finished, code, &[text]);
    }
    tried.expect(CONSUMER, &site.finish(CONSUMER), 0, &[]);
    site.end(chain, false);
    tried.show(site, "commands with mounts of their own");
}

/// Commands where only another user has a domain: they must name it.
pub fn other_users(site: &Site) {
    assert!(
        is_own_memory(),
        "it would be in the place of a real user's domain"
    );
    let path = Path::new("/dev/shm").join(format!("hero{OTHER_USER}"));
    fs::create_dir(&path).expect("a folder");
    if let Err(error) = chown(&path, Some(OTHER_USER), None) {
        return site.skip(&format!("a domain of another user cannot be made: {error}"));
    }
    let mut tried = Tried::default();
    let looked_at = site.domain.root().display().to_string();
    let other = path.display().to_string();
    let way = format!("sudo -u '#{OTHER_USER}' ril");
    for (args, code) in [("status --timeout 1s", 3), ("land", 3), ("doctor", 0)] {
        let expected = [&looked_at, &other, &way].map(String::as_str);
        tried.expect(args, &site.finish(args), code, &expected);
    }
    fs::remove_dir(path).expect("it is empty");
    tried.show(site, "commands of another user");
}
