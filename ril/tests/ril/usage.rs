//! Usage errors, configurations that are wrong, and commands that find no process: the exit codes 2, 3 and 78.

use std::fs;

use crate::common::{sandbox, says};
use rustix::fs::{CWD, Mode, mkfifoat};

#[test]
fn usage_errors_are_refused_before_a_request_is_sent() {
    let rig = sandbox();
    for (args, expected) in [
        ("", "Usage: ril"),
        ("strat", "start"),
        ("start --robot 0", "a robot id is an integer from 1"),
        ("bridge --robot 0", "a robot id is an integer from 1"),
        ("sim --speed 0", "a speed is a factor"),
        ("status --log barometer", "'--log'"),
        ("demo --speed 0", "--speed"),
        ("delay hero --json", "<--count <N>|--duration <DURATION>>"),
        (
            "echo hero --field altitude_m",
            "did you mean `geodetic.altitude_m` or",
        ),
        (
            "echo /robot1/hero/telemetry",
            "is called `hero/telemetry`, and the robot --robot 1",
        ),
        (
            "echo state --field zzz",
            "the fields are sequence, epoch_ns",
        ),
    ] {
        let finished = rig.run(args, 2);
        finished.err_says(expected);
        let is_json = args.contains("--json");
        assert_eq!(
            finished.stdout.len(),
            usize::from(is_json),
            "{args}: {finished:#?}"
        );
        rig.domain.assert_empty();
    }
}

#[test]
fn what_is_no_file_is_no_configuration_and_is_not_waited_for() {
    let rig = sandbox();
    let pipe = rig.folder().join("pipe");
    mkfifoat(CWD, &pipe, Mode::RUSR | Mode::WUSR).unwrap();
    let endless = fs::File::create(rig.folder().join("endless")).unwrap();
    endless.set_len(1 << 40).unwrap();
    for (file, expected) in [
        ("pipe", "pipe: is a pipe, not a regular file; name a"),
        ("/dev/ptmx", "/dev/ptmx: is a device, not a regular file"),
        ("/dev/zero", "/dev/zero: is a device, not a regular file"),
        (".", ".: is a folder, not a regular file"),
        ("endless", "endless: is longer than 1048576 bytes"),
        ("absent.toml", "absent.toml: cannot be read"),
    ] {
        for command in ["bridge", "run status", "sim", "start", "status", "doctor"] {
            let finished = rig.run(&format!("{command} --config {file}"), 78);
            let told = [finished.stdout, finished.stderr].concat();
            assert!(says(&told, expected), "{command}: {told:#?}");
        }
    }
    rig.domain.assert_empty();
}

#[test]
fn the_file_in_the_working_directory_is_read_if_it_is_there() {
    let rig = sandbox();
    rig.run("start --check-config", 0);
    rig.write("ril.toml", "[request]\n\ndeadline_ms = -1\n");
    rig.run("start --check-config", 78).err_says("ril.toml:3: ");
}
