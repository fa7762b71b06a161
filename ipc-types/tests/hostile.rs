//! What another user of the machine can do to a domain: nothing, and no process has to wait for that user.
//!
//! The program starts itself again in the roles below: as a victim, and as a stranger with another user's rights. Only
//! root can do that; for others these tests say that they were skipped.

mod support;

use std::fs::{self, OpenOptions};
use std::io::{self, BufRead, Write};
use std::os::unix::fs::{PermissionsExt, chown};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use iceoryx2::prelude as iox;
use ipc_types::payload::{DspTelemetry, ModuleControl};
use ipc_types::{Domain, DomainError, Ipc, JoinError, RobotId};
use rustix::io::Errno;
use rustix::process::{Signal, getppid, getuid, kill_process};

use support::{Role, in_domain, join};

const TESTS: &[(&str, fn())] = support::tests![
    ; as_root:
    a_stranger_gets_nowhere_and_the_others_go_on,
    names_that_a_stranger_took_first_are_refused_in_words,
];

/// Two users that have nothing to do with each other; neither needs to exist by name.
const VICTIM_UID: u32 = 65_533;
const STRANGER_UID: u32 = 65_534;

fn main() -> ExitCode {
    support::run(TESTS, play)
}

fn play(role: &str) {
    let domain = Domain::from_environment().expect("the test's domain");
    match role {
        "victim" => play_victim(&domain),
        "stranger" => play_stranger(&domain),
        other => panic!("no role {other}"),
    }
}

/// Publishes and serves. For each line that it reads it does everything once more and says that it could.
fn play_victim(domain: &Domain) {
    let ipc = join(domain, "victim");
    let mut publisher = ipc.publisher::<DspTelemetry>().expect("publisher");
    let mut subscriber = ipc.subscriber::<DspTelemetry>().expect("subscriber");
    let mut server = ipc.server::<ModuleControl>().expect("server");
    println!("ready {}", getuid().as_raw());
    for _ in io::stdin().lines() {
        publisher.service();
        publisher.publish(|_| {}).expect("publish");
        let heard = subscriber.drain(|_| {}).expect("drain");
        let asked = server.drain(|_, _| {}).expect("drain");
        // A process of the domain's own user still gets in.
        let other = Ipc::join(domain, RobotId::DEFAULT, "other").is_ok();
        println!("heard {heard}, asked {asked}, other joins {other}");
    }
}

/// Tries everything that a program can do to another user's domain, and says how each attempt ended.
fn play_stranger(domain: &Domain) {
    let say = |what: &str, outcome: &dyn std::fmt::Display| println!("{what}: {outcome}");
    say("uid", &getuid().as_raw());
    // That the attempts below fail is not for lack of ability.
    let own = Domain::isolated();
    say(
        "own domain",
        &joined(Ipc::join(&own, RobotId::DEFAULT, "stranger")),
    );

    say("folder", &opened(fs::read_dir(domain.root())));
    say("new file", &opened(fs::write(domain.root().join("x"), "x")));
    for path in segments(domain) {
        let mut outcomes = vec![opened(OpenOptions::new().read(true).open(&path))];
        outcomes.push(opened(OpenOptions::new().write(true).open(&path)));
        outcomes.push(opened(fs::remove_file(&path)));
        outcomes.push(opened(fs::set_permissions(
            &path,
            PermissionsExt::from_mode(0o666),
        )));
        outcomes.dedup();
        say("segment", &outcomes.join(", "));
    }
    say("end of segments", &"");
    say(
        "joining",
        &joined(Ipc::join(domain, RobotId::DEFAULT, "stranger")),
    );
    // The names in shared memory have no root in them, and a root of one's own can be entered.
    let path = segments(domain).pop().expect("a segment");
    let name = path.file_name().expect("its name").to_string_lossy();
    let (prefix, _) = name.split_once('_').expect("its prefix");
    for root in [domain.root(), own.root()] {
        say("node", &raw_node(&format!("{prefix}_"), root));
    }
    let parent = getppid().expect("the test");
    say(
        "signal",
        &opened(kill_process(parent, Signal::STOP).map_err(io::Error::from)),
    );
    let _ = fs::remove_dir_all(own.root());
}

fn opened<T>(result: io::Result<T>) -> String {
    match result {
        Ok(_) => "done".to_owned(),
        Err(error) => match Errno::from_io_error(&error) {
            Some(Errno::ACCESS | Errno::PERM) => "denied".to_owned(),
            _ => error.to_string(),
        },
    }
}

fn joined(result: Result<Ipc, JoinError>) -> String {
    match result {
        Ok(_) => "joined".to_owned(),
        Err(JoinError::Domain(DomainError::Unsafe { .. })) => "refused".to_owned(),
        Err(error) => error.to_string(),
    }
}

/// Tries it without our checks, as a program that uses iceoryx2 itself.
fn raw_node(prefix: &str, root: &Path) -> &'static str {
    use iceoryx2::prelude::SemanticString;
    let mut config = iox::Config::default();
    config.global.prefix = iox::FileName::new(prefix.as_bytes()).expect("a prefix");
    let root = iox::Path::new(root.as_os_str().as_encoded_bytes()).expect("a root");
    config.global.set_root_path(&root);
    let node = iox::NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(iox::SignalHandlingMode::Disabled)
        .create::<iox::ipc::Service>();
    if node.is_ok() { "made" } else { "refused" }
}

/// The domain's segments. Every user can see their names.
fn segments(domain: &Domain) -> Vec<PathBuf> {
    let tag = domain.tag();
    fs::read_dir("/dev/shm")
        .expect("shared memory")
        .flatten()
        .filter(|entry| entry.file_name().to_string_lossy().starts_with(&tag))
        .map(|entry| entry.path())
        .collect()
}

/// Whether this test can act as other users; says so when it cannot.
fn can_be_others() -> bool {
    let is_root = getuid().is_root();
    if !is_root {
        eprintln!("SKIPPED: only root can act as another user");
    }
    is_root
}

/// A copy of this program in a folder that every user can enter, unlike the one where it was built.
struct Public {
    folder: tempfile::TempDir,
}

impl Public {
    fn new() -> Public {
        let folder = tempfile::tempdir_in("/tmp").expect("a folder");
        fs::set_permissions(folder.path(), PermissionsExt::from_mode(0o755)).expect("its owner");
        let program = std::env::current_exe().expect("this program");
        fs::copy(program, folder.path().join("hostile")).expect("a copy");
        Public { folder }
    }

    fn start(&self, domain: &Domain, role: &str, uid: u32) -> Role {
        let mut command = Command::new(self.folder.path().join("hostile"));
        command.uid(uid).gid(uid).current_dir("/");
        Role::spawn(domain, role, command)
    }
}

fn a_stranger_gets_nowhere_and_the_others_go_on() {
    if !can_be_others() {
        return;
    }
    in_domain(|domain| {
        let program = Public::new();
        let mut victim = program.start(domain, "victim", VICTIM_UID);
        assert_eq!(victim.next_line(), format!("ready {VICTIM_UID}"));
        let go_on = |victim: &mut Role| {
            let mut input = victim.child.stdin.as_ref().expect("it is piped");
            writeln!(input, "once more").expect("it reads");
            victim.next_line()
        };
        let all_is_well = "heard 1, asked 0, other joins true";
        assert_eq!(go_on(&mut victim), all_is_well);
        let before = segments(domain).len();
        assert!(before > 3);

        let mut stranger = program.start(domain, "stranger", STRANGER_UID);
        let lines: Vec<String> = (&mut stranger.says).lines().map(Result::unwrap).collect();
        assert!(stranger.child.wait().unwrap().success(), "{lines:#?}");
        let mut expected = vec![
            format!("uid: {STRANGER_UID}"),
            "own domain: joined".to_owned(),
            "folder: denied".to_owned(),
            "new file: denied".to_owned(),
        ];
        expected.extend(vec!["segment: denied".to_owned(); before]);
        expected.extend(
            [
                "end of segments: ",
                "joining: refused",
                "node: refused",
                "node: refused",
                "signal: denied",
            ]
            .map(str::to_owned),
        );
        assert_eq!(lines, expected);

        assert_eq!(go_on(&mut victim), all_is_well);
        assert_eq!(segments(domain).len(), before);
        drop(victim.child.stdin.take());
        assert!(victim.child.wait().unwrap().success());
    });
}

fn names_that_a_stranger_took_first_are_refused_in_words() {
    if !can_be_others() {
        return;
    }
    let refused = |domain: &Domain, path: &Path| {
        let error = match Ipc::join(domain, RobotId::DEFAULT, "test") {
            Err(JoinError::Domain(error @ DomainError::Unsafe { .. })) => error.to_string(),
            Err(error) => panic!("{error}"),
            Ok(_) => panic!("joined"),
        };
        for part in [
            path.to_str().unwrap(),
            &format!("it belongs to user {STRANGER_UID}, this is user 0"),
            "run as that user",
            "choose another domain with RIL_IPC_ROOT",
        ] {
            assert!(error.contains(part), "{part} is not in: {error}");
        }
        assert!(!error.contains("remove"), "{error}");
    };
    // The folder, with what would hold up a process that opened it.
    let domain = Domain::isolated();
    fs::create_dir(domain.root()).unwrap();
    let lock = domain.root().join("1");
    rustix::fs::mkfifoat(rustix::fs::CWD, &lock, rustix::fs::Mode::RUSR).unwrap();
    chown(domain.root(), Some(STRANGER_UID), None).unwrap();
    refused(&domain, domain.root());
    assert!(domain.repair().unwrap().is_nothing());
    let seen = domain.inspect();
    assert!(seen.root.is_some_and(|root| !root.is_ours()) && seen.robots.is_empty());
    fs::remove_dir_all(domain.root()).unwrap();
}
