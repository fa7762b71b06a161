//! Threads that open ports disturb neither each other nor threads that create files. The umask belongs to the whole
//! process, so this is a program with one test.

mod support;

use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread;

use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleControl, MovementData};
use ipc_types::{Domain, Ipc, RobotId, files};
use rustix::fs::Mode;
use rustix::process::umask;

use support::{in_domain, join};

/// Others can be told from what iceoryx2 sets meanwhile, which is 177, and from what is usual.
const UMASK: u32 = 0o027;

/// Threads that open ports, and how often each does. A listener, of which each round makes four, is what sets the
/// umask.
const OPENERS: u32 = 4;
const ROUNDS: u32 = 15;

/// A child process takes a millisecond.
const FILES_PER_CHILD: u32 = 20;

fn mode(path: &Path) -> u32 {
    fs::symlink_metadata(path).unwrap().permissions().mode() & 0o777
}

/// Opens ports in a domain of its own, and looks at what the crate has created for them.
fn open_ports(domain: &Domain) {
    for _ in 0..ROUNDS {
        let ipc = join(domain, "test");
        let _publishers = (
            ipc.publisher::<DspTelemetry>().unwrap(),
            ipc.publisher::<HeroTelemetry>().unwrap(),
        );
        let _servers = (
            ipc.server::<ModuleControl>().unwrap(),
            ipc.server::<MovementData>().unwrap(),
        );
        let service = domain.root().join("1/movement");
        let current = fs::read_to_string(service.join("current")).unwrap();
        let (generation, _) = current.split_once(' ').unwrap();
        for (path, expected) in [
            ("../..", 0o700),
            ("..", 0o700),
            ("../doorbell", 0o600),
            (".", 0o700),
            ("lock", 0o600),
            (generation, 0o700),
            (&format!("{generation}/lock"), 0o600),
            (&format!("{generation}/nodes"), 0o750),
            (&format!("{generation}/services"), 0o750),
        ] {
            let path = service.join(path);
            assert_eq!(mode(&path), expected, "{}", path.display());
        }
    }
}

/// Creates files and folders in both ways.
fn create_files(folder: &Path, count: u32) {
    let at = |name: &str| folder.join(format!("{count}.{name}"));
    let expect = |path: &Path, expected: u32| assert_eq!(mode(path), expected, "{path:?}");
    files::while_no_port_opens(|| {
        fs::create_dir(at("folder")).unwrap();
        fs::write(at("folder").join("file"), "x").unwrap();
    });
    expect(&at("folder"), 0o750);
    expect(&at("folder").join("file"), 0o640);

    files::create_dir_all(&at("logs").join("deep")).unwrap();
    files::create_new(&at("logs").join("deep/file")).unwrap();
    expect(&at("logs"), 0o750);
    expect(&at("logs/deep"), 0o750);
    expect(&at("logs/deep/file"), 0o640);
}

/// A child process has the umask that its parent had when it was started.
fn start_child() {
    let mut command = Command::new("sh");
    command.args(["-c", "umask"]);
    command.stdout(std::process::Stdio::piped());
    let child = files::while_no_port_opens(|| command.spawn()).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.stdout, b"0027\n");
}

#[test]
fn ports_that_are_opened_side_by_side_disturb_no_files() {
    umask(Mode::from_raw_mode(UMASK));
    let folder = tempfile::tempdir().unwrap();
    fs::set_permissions(folder.path(), Permissions::from_mode(0o700)).unwrap();
    let open = AtomicU32::new(OPENERS);
    thread::scope(|scope| {
        for _ in 0..OPENERS {
            scope.spawn(|| {
                let _leaving = Leaving(&open);
                in_domain(open_ports);
            });
        }
        let mut count = 0;
        while open.load(Ordering::SeqCst) > 0 {
            create_files(folder.path(), count);
            if count % FILES_PER_CHILD == 0 {
                start_child();
            }
            count += 1;
        }
    });
    assert_eq!(umask(Mode::empty()).as_raw_mode(), UMASK);

    // One that takes the user's own rights leaves no folder that nobody can use.
    let domain = Domain::isolated();
    for (taken, mode) in [(0o777, "000"), (0o300, "400"), (0o477, "300")] {
        umask(Mode::from_raw_mode(taken));
        let error = match Ipc::join(&domain, RobotId::DEFAULT, "test") {
            Err(error) => error.to_string(),
            Ok(_) => panic!("joined with the umask {taken:03o}"),
        };
        for part in [&format!("(mode {mode})"), "start with a umask"] {
            assert!(error.contains(part), "{error}");
        }
        assert!(!domain.root().exists());
    }
}

/// Counts a thread out, also one that fails.
struct Leaving<'a>(&'a AtomicU32);

impl Drop for Leaving<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}
