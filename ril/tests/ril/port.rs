//! What stands in the place of the serial port while the bridge runs: nothing, the wrong thing, a device that may not
//! be opened, another device. The bridge says what it is, goes on, and has telemetry again when a DSP is there.

use std::fs::{self, Permissions};
use std::os::unix::fs::{PermissionsExt, symlink};
use std::os::unix::process::CommandExt;
use std::process::Command;
use std::thread;

use crate::common::{end, sandbox};
use ipc_types::code::LinkState;
use ipc_types::{Domain, files};
use ril_tests::languages::skip;
use ril_tests::process::Signal;
use ril_tests::{Process, Sandbox};

/// The port that the bridge is given: a link, which leads to what a test wants.
const PORT: &str = "port";

/// What is no serial port, and what the bridge says of it.
const WRONG: [(&str, &str); 4] = [
    ("absent", "does not exist: is the cable plugged in"),
    ("letter", "is not a serial port"),
    (".", "is not a serial port"),
    ("/dev/null", "is not a serial port"),
];

/// The user and group `nobody`.
const NOBODY: u32 = 65_534;

/// Lets the port lead to `target`, at once: there is no moment without it.
fn lead(rig: &Sandbox, target: &str) {
    let draft = rig.folder().join("draft");
    symlink(target, &draft).unwrap();
    fs::rename(&draft, rig.folder().join(PORT)).unwrap();
}

/// Removes what another user's process left in a domain if the test fails: the domain's own guard would leave it alone.
struct Tidy<'a>(&'a Domain);

impl Drop for Tidy<'_> {
    fn drop(&mut self) {
        if !thread::panicking() {
            return;
        }
        let _ = fs::remove_dir_all(self.0.root());
        for segment in fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
            let name = segment.file_name();
            if name.to_string_lossy().starts_with(&self.0.tag()) {
                let _ = fs::remove_file(segment.path());
            }
        }
    }
}

/// A DSP behind a terminal of its own, with this name in the folder.
fn dsp(rig: &Sandbox, name: &str) -> Process {
    let mut sim = rig.start(&format!("sim --link {name} --seed 1"));
    sim.wait_for_text("ready");
    sim
}

/// A pseudo-terminal has no such driver, and nothing is said of that.
#[test]
fn the_driver_is_asked_to_hand_on_bytes_at_once_before_anything_is_said_to_the_dsp() {
    if let Err(error) = Command::new("strace").arg("--version").output() {
        return skip("strace", &error.to_string());
    }
    let rig = sandbox();
    let sim = dsp(&rig, PORT);
    for (setting, is_asked) in [("true", true), ("false", false)] {
        rig.write(
            "bridge.toml",
            &format!("[serial]\nlow_latency = {setting}\n"),
        );
        let ril = env!("CARGO_BIN_EXE_ril");
        let line = format!(
            "exec strace -D -f -y -e trace=ioctl,write -o {setting}.trace {ril} run bridge --port {PORT}"
        );
        let bridge = Process::spawn(&rig.domain, rig.shell(&line));
        rig.watch(1).until_ready();
        let said = end(bridge, Signal::TERM).stderr.join("\n");
        assert!(!said.contains("WARN") && !said.contains("ERROR"), "{said}");
        let trace = fs::read_to_string(rig.folder().join(format!("{setting}.trace"))).unwrap();
        let of_line = || {
            trace
                .lines()
                .enumerate()
                .filter(|(_, line)| line.contains("/dev/pts/"))
        };
        let asked = of_line().find(|(_, line)| line.contains("TIOCGSERIAL"));
        let first = of_line().find(|(_, line)| line.contains("write("));
        assert_eq!(asked.is_some(), is_asked, "{trace}");
        assert!(asked.is_none_or(|(at, _)| at < first.unwrap().0), "{trace}");
    }
    end(sim, Signal::TERM);
}

#[test]
fn whatever_stands_in_the_place_of_the_port_the_bridge_goes_on_until_it_is_back() {
    let rig = sandbox();
    rig.write("letter", "Dear bridge");
    let mut sim = dsp(&rig, "dsp-0");
    lead(&rig, "dsp-0");
    let mut bridge = rig.start(&format!("bridge --port {PORT}"));
    let mut watch = rig.watch(1);
    watch.until_ready();
    for (index, (wrong, words)) in WRONG.into_iter().enumerate() {
        lead(&rig, wrong);
        // Another terminal, and another number of it, because the old one is still there.
        let next = format!("dsp-{}", index + 1);
        let next_sim = dsp(&rig, &next);
        end(std::mem::replace(&mut sim, next_sim), Signal::TERM);
        bridge.wait_for_text(words);
        let gone = watch.until("the link is gone", |state| {
            state.link.state() == Some(LinkState::Gone)
        });
        let before = gone.link;
        lead(&rig, &next);
        watch.until("there is telemetry again", |state| {
            state.link.state() == Some(LinkState::Up)
                && state.link.port_openings == before.port_openings + 1
                && state.link.telemetry_published > before.telemetry_published
        });
    }
    drop(watch);
    let finished = end(bridge, Signal::TERM);
    // Each was told once, however often it was tried.
    let told = |line: &&String| line.contains("trying again");
    let told = finished.stderr.iter().filter(told).count();
    assert_eq!(told, WRONG.len(), "{finished:#?}");
    end(sim, Signal::TERM);
}

#[test]
fn a_bridge_that_is_given_no_serial_port_at_first_says_so_and_ends() {
    let rig = sandbox();
    rig.write("letter", "Dear bridge");
    for (wrong, words) in &WRONG[1..] {
        lead(&rig, wrong);
        rig.run(&format!("bridge --port {PORT}"), 78)
            .err_says(words);
    }
}

#[test]
fn a_port_that_may_not_be_opened_any_more_is_opened_when_it_may_be_again() {
    let rig = sandbox();
    fs::set_permissions(rig.folder(), Permissions::from_mode(0o755)).unwrap();
    let _tidy = Tidy(&rig.domain);
    let command = |args: &[&str]| {
        let mut command = rig.command(args);
        // Root may open every port.
        if rustix::process::geteuid().is_root() {
            command.uid(NOBODY).gid(NOBODY);
        }
        command
    };
    let version = files::while_no_port_opens(|| command(&["--version"]).output());
    if !version.is_ok_and(|output| output.status.success()) {
        return skip(
            "a port that may not be opened",
            "`ril` cannot be run as another user here",
        );
    }
    let allow = |name: &str, mode| {
        let device = fs::canonicalize(rig.folder().join(name)).unwrap();
        fs::set_permissions(device, Permissions::from_mode(mode)).unwrap();
    };
    let sim = dsp(&rig, "dsp-0");
    allow("dsp-0", 0o666);
    lead(&rig, "dsp-0");
    let mut bridge = Process::spawn(&rig.domain, command(&["bridge", "--port", PORT]));
    bridge.wait_for_text("to=\"up\"");

    // The device comes back, and the user may not open it: as if it belonged to a group that the user is not in.
    let next = dsp(&rig, "dsp-1");
    allow("dsp-1", 0o000);
    lead(&rig, "dsp-1");
    end(sim, Signal::TERM);
    let told = bridge.wait_for_text("may not be opened by this user").text;
    // A pseudo-terminal belongs to a group that gives more than this port.
    assert!(
        told.contains("udev rule") && !told.contains("usermod"),
        "{told}"
    );
    allow("dsp-1", 0o666);
    bridge.wait_for_text("port open");
    bridge.wait_for_text("port open");
    bridge.wait_for_text("to=\"up\"");
    end(bridge, Signal::TERM);
    end(next, Signal::TERM);
    rig.domain.assert_empty();
}
