//! No upgrade and no removal while a helicopter flies: the package's script, and what dpkg makes of it.

use std::fs::{self, Permissions};
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use ril_tests::Sandbox;
use ril_tests::process::Signal;

use super::{has, repository};
use crate::common::{Flight, end, sandbox};

/// A folder with the programs that the script calls: `ril`, and a `runuser` that stays the user of the test.
fn programs(rig: &Sandbox, ril: &Path) -> PathBuf {
    let folder = rig.path("programs");
    fs::create_dir_all(&folder).unwrap();
    let runuser = folder.join("runuser");
    fs::write(&runuser, "#!/bin/sh\nshift 3\nexec \"$@\"\n").unwrap();
    fs::set_permissions(&runuser, Permissions::from_mode(0o755)).unwrap();
    let link = folder.join("ril");
    let _ = fs::remove_file(&link);
    symlink(ril, link).unwrap();
    folder
}

/// A command of the sandbox that finds these programs first.
fn with_programs(rig: &Sandbox, programs: &Path, mut command: Command) -> Command {
    let path = std::env::var("PATH").unwrap();
    command.env(
        "PATH",
        format!("{}:{path}:/usr/sbin:/sbin", programs.display()),
    );
    command.envs(rig.domain.environment());
    rig.place(command)
}

fn prerm(rig: &Sandbox, programs: &Path, args: &[&str]) -> Output {
    let mut command = Command::new("sh");
    command.arg(repository("package/debian/prerm")).args(args);
    with_programs(rig, programs, command).output().unwrap()
}

fn refuses(output: &Output) {
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    let expected = "\
ril: robot 1 is in the air: nothing is changed while a helicopter flies
ril:     land it and try again; when it is on the ground all the same: sudo systemctl stop ril@1.target
";
    assert_eq!(said, expected);
}

fn permits(output: &Output) {
    assert!(output.status.success(), "{output:?}");
    assert!(output.stderr.is_empty(), "{output:?}");
}

const UPGRADES: [&[&str]; 2] = [&["upgrade", "0.2.0"], &["failed-upgrade", "0.1.0", "0.2.0"]];

#[test]
fn nothing_is_upgraded_or_removed_while_a_helicopter_flies_and_a_broken_robot_prevents_nothing() {
    let rig = sandbox();
    let programs = programs(&rig, Path::new(env!("CARGO_BIN_EXE_ril")));
    let check = |judge: fn(&Output)| {
        UPGRADES
            .iter()
            .for_each(|args| judge(&prerm(&rig, &programs, args)))
    };
    check(permits);
    let flight = Flight::begin(&rig);
    // The DSP says that it flies also without a status.
    check(refuses);
    let status = rig.status(1);
    rig.run("echo hero --count 1", 0);
    check(refuses);
    refuses(&prerm(&rig, &programs, &["remove"]));

    // A bridge that hangs says nothing of the present.
    flight.bridge.signal(Signal::STOP);
    rig.run("echo dsp --timeout 3s", 4);
    check(permits);
    flight.bridge.signal(Signal::CONT);
    rig.run("echo hero --count 1", 0);
    rig.run("land", 0);
    check(permits);
    end(status, Signal::INT);
    flight.end();
    check(permits);

    // A program that fails is what the next version may repair.
    let broken = self::programs(&rig, Path::new("/bin/false"));
    UPGRADES
        .iter()
        .for_each(|args| permits(&prerm(&rig, &broken, args)));
}

/// A package with this script and nothing else.
fn package(rig: &Sandbox, version: &str) -> PathBuf {
    let folder = rig.path(version);
    let control = folder.join("DEBIAN");
    fs::create_dir_all(&control).unwrap();
    fs::set_permissions(&folder, Permissions::from_mode(0o755)).unwrap();
    fs::set_permissions(&control, Permissions::from_mode(0o755)).unwrap();
    fs::create_dir_all(folder.join("usr/share/ril")).unwrap();
    fs::write(folder.join("usr/share/ril/version"), version).unwrap();
    let fields = format!(
        "Package: ril\nVersion: {version}\nArchitecture: all\nMaintainer: test <hero@localhost>\nDescription: test\n"
    );
    fs::write(control.join("control"), fields).unwrap();
    let script = control.join("prerm");
    fs::copy(repository("package/debian/prerm"), &script).unwrap();
    fs::set_permissions(&script, Permissions::from_mode(0o755)).unwrap();
    let package = rig.path(&format!("ril_{version}.deb"));
    let built = Command::new("dpkg-deb")
        .args(["--root-owner-group", "-b"])
        .args([&folder, &package])
        .output()
        .unwrap();
    assert!(built.status.success(), "{built:?}");
    package
}

#[test]
fn dpkg_keeps_the_version_that_flies_and_takes_the_next_one_after_the_landing() {
    if !has("dpkg", "what dpkg makes of a refusal is not tested") {
        return;
    }
    let rig = sandbox();
    let programs = programs(&rig, Path::new(env!("CARGO_BIN_EXE_ril")));
    let root = rig.path("root");
    for folder in ["info", "updates", "triggers"] {
        fs::create_dir_all(root.join("var/lib/dpkg").join(folder)).unwrap();
    }
    for file in ["status", "available"] {
        fs::write(root.join("var/lib/dpkg").join(file), "").unwrap();
    }
    let dpkg = |words: &[&str]| {
        let mut command = Command::new("dpkg");
        command
            .arg(format!("--root={}", root.display()))
            .arg("--force-not-root,script-chrootless,bad-path")
            .args(["--log=/dev/null"])
            .args(words);
        with_programs(&rig, &programs, command).output().unwrap()
    };
    let [old, new] = ["0.1.0", "0.2.0"].map(|version| package(&rig, version));
    let install = |package: &Path| dpkg(&["-i", package.to_str().unwrap()]);
    let installed = || fs::read_to_string(root.join("usr/share/ril/version")).unwrap();
    let first = install(&old);
    assert!(first.status.success(), "{first:?}");

    let flight = Flight::begin(&rig);
    for refused in [install(&new), dpkg(&["-r", "ril"])] {
        let said = String::from_utf8_lossy(&refused.stderr);
        assert_eq!(refused.status.code(), Some(1), "{said}");
        assert!(said.contains("ril: robot 1 is in the air"), "{said}");
        assert_eq!(installed(), "0.1.0");
        let state = dpkg(&["-s", "ril"]);
        let state = String::from_utf8_lossy(&state.stdout);
        assert!(state.contains(" ok installed\n"), "{state}");
    }
    rig.run("land", 0);
    let taken = install(&new);
    assert!(taken.status.success(), "{taken:?}");
    assert_eq!(installed(), "0.2.0");
    flight.end();
}
