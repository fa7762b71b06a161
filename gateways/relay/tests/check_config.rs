//! `--check-config` refuses what a start refuses, with the file, the line and what to do, and opens nothing.

use std::fs;
use std::net::TcpListener;
use std::path::Path;
use std::process::{Command, Output};

/// Exit code of a wrong configuration.
const WRONG: i32 = 78;

const CERTIFICATES: &str = "[security]\nauthority = \"ca.pem\"\ncertificate = \"robot-1.pem\"\nkey = \"robot-1-key.pem\"\n";

/// What the relay says about the relay.toml of `folder`. Its shared memory would be a folder that is not there.
fn relay(folder: &Path, args: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ril-relay"));
    command.args(args.split(' ')).current_dir(folder);
    command.env("RIL_IPC_ROOT", folder.join("ipc"));
    for variable in ["RIL_ROBOT", "RIL_CONFIG", "RIL_LOG"] {
        command.env_remove(variable);
    }
    command.output().expect("the relay's program")
}

/// The error of a relay that refuses its configuration.
#[track_caller]
fn refused(folder: &Path, args: &str) -> String {
    let output = relay(folder, args);
    let told = String::from_utf8(output.stderr).expect("text");
    assert_eq!(output.status.code(), Some(WRONG), "{args}: {told}");
    let error = told.lines().find(|line| line.starts_with("error: "));
    error.expect("an error").to_owned()
}

/// A folder with `text` as relay.toml, and certificates of two machines.
fn folder(text: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let made = relay(folder.path(), "certify . robot-1=127.0.0.1 gcs");
    assert!(made.status.success(), "{made:?}");
    fs::write(folder.path().join("relay.toml"), text).expect("a file");
    folder
}

/// Every kind of fault has a row in the table of `src/cli.rs`.
#[test]
fn a_wrong_configuration_is_refused_with_line_and_next_step_by_the_check_and_by_a_start() {
    let certificates = format!("{CERTIFICATES}stations = [\"gcs\"]\n");
    for (side, text, line, next_step) in [
        (
            "robot",
            "[robot]\nlisen = []\n".to_owned(),
            "relay.toml:2",
            "did you mean `listen`",
        ),
        (
            "station",
            "[station]\nconnect = [\"tcp/hub\"]\n".to_owned(),
            "relay.toml:2",
            "such as tcp/10.0.0.2:7447",
        ),
        (
            "robot",
            certificates.replace("ca.pem", "absent.pem"),
            "relay.toml:2",
            "let its user read it",
        ),
        (
            "router",
            "[router]\nlisten = [\"tls/0.0.0.0:1\"]\n".to_owned(),
            "relay.toml:2",
            "ril relay certify",
        ),
    ] {
        let folder = folder(&text);
        let checked = refused(folder.path(), &format!("{side} --check-config"));
        assert!(
            checked.contains(line) && checked.contains(next_step),
            "{text}{checked}"
        );
        assert_eq!(refused(folder.path(), side), checked, "a start");
    }
}

#[test]
fn what_comes_from_the_command_line_is_refused_without_a_line_of_the_file() {
    let folder = folder("[robot]\nlisten = [\"tcp/127.0.0.1:1\"]\n");
    for (args, next_step) in [
        ("robot --listen 7447", "such as tcp/10.0.0.2:7447"),
        (
            "robot --listen tcp/0.0.0.0:1 --may-command gcs",
            "insecure = true",
        ),
        ("robot --may-command a/b", "letters, digits"),
        ("station --name a/b", "letters, digits"),
        ("router --connect tls/hub:1", "ril relay certify"),
        ("station --connect tcp/10.0.0.2:1?", "take the sign out"),
    ] {
        let error = refused(folder.path(), &format!("{args} --check-config"));
        assert!(error.contains(next_step), "{error}");
        assert!(!error.contains("relay.toml:"), "{error}");
        assert_eq!(refused(folder.path(), args), error, "a start");
    }
}

#[test]
fn a_right_configuration_is_checked_without_opening_the_network_or_shared_memory() {
    let taken = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let endpoint = format!("tls/{}", taken.local_addr().expect("its address"));
    let folder = folder(&format!(
        "{CERTIFICATES}robots = {{ robot-1 = 1 }}\nstations = [\"viewer\"]\n[robot]\nlisten = [{endpoint:?}]\n\
         [router]\nlisten = [{endpoint:?}]\n[commands]\nstations = [\"gcs\"]\n"
    ));
    for args in ["robot --may-command gcs", "station", "router"] {
        let checked = relay(folder.path(), &format!("{args} --check-config"));
        assert!(checked.status.success(), "{args}: {checked:?}");
    }
    assert!(!folder.path().join("ipc").exists());
}

#[test]
fn a_right_configuration_is_printed_with_the_origin_of_each_value() {
    let folder = folder("[commands]\nstations = [\"gcs\"]\n");
    let output = relay(
        folder.path(),
        "robot --check-config --listen tcp/127.0.0.1:7001 --may-command watcher",
    );
    assert!(output.status.success(), "{output:?}");
    let text = String::from_utf8(output.stdout).expect("text");
    for (key, expected) in [
        (
            "commands.stations",
            ["[\"gcs\", \"watcher\"]", "# --may-command"],
        ),
        ("commands.deadline_ms", ["5000", "# built-in"]),
        ("robot.listen", ["[\"tcp/127.0.0.1:7001\"]", "# --listen"]),
    ] {
        let line = text.lines().find(|line| line.starts_with(key));
        let line = line.unwrap_or_else(|| panic!("{key} is missing in\n{text}"));
        assert!(expected.iter().all(|part| line.contains(part)), "{line}");
    }
}
