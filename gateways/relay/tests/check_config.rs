//! `--check-config` refuses what a start refuses, with the file, the line and what to do, and opens nothing.

use std::net::TcpListener;

use ril_tests::Sandbox;

/// Exit code of a wrong configuration.
const WRONG: i32 = 78;

const CERTIFICATES: &str = "[security]\nauthority = \"ca.pem\"\ncertificate = \"robot-1.pem\"\nkey = \"robot-1-key.pem\"\n";

/// The relay's program where `text` is its relay.toml, with certificates of two machines.
fn machine(text: &str) -> Sandbox {
    let machine = Sandbox::of(env!("CARGO_BIN_EXE_ril-relay"));
    machine.run("certify . robot-1=127.0.0.1 gcs", 0);
    machine.write("relay.toml", text);
    machine
}

/// The error of a relay that refuses its configuration.
#[track_caller]
fn refused(machine: &Sandbox, args: &str) -> String {
    let said = machine.run(args, WRONG).stderr;
    let error = said.into_iter().find(|line| line.starts_with("error: "));
    error.expect("an error")
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
        let machine = machine(&text);
        let checked = refused(&machine, &format!("{side} --check-config"));
        assert!(
            checked.contains(line) && checked.contains(next_step),
            "{text}{checked}"
        );
        assert_eq!(refused(&machine, side), checked, "a start");
    }
}

#[test]
fn what_comes_from_the_command_line_is_refused_without_a_line_of_the_file() {
    let machine = machine("[robot]\nlisten = [\"tcp/127.0.0.1:1\"]\n");
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
        let error = refused(&machine, &format!("{args} --check-config"));
        assert!(error.contains(next_step), "{error}");
        assert!(!error.contains("relay.toml:"), "{error}");
        assert_eq!(refused(&machine, args), error, "a start");
    }
}

#[test]
fn a_right_configuration_is_checked_without_opening_the_network_or_shared_memory() {
    let taken = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let endpoint = format!("tls/{}", taken.local_addr().expect("its address"));
    let machine = machine(&format!(
        "{CERTIFICATES}robots = {{ robot-1 = 1 }}\nstations = [\"viewer\"]\n[robot]\nlisten = [{endpoint:?}]\n\
         [router]\nlisten = [{endpoint:?}]\n[commands]\nstations = [\"gcs\"]\n"
    ));
    for args in ["robot --may-command gcs", "station", "router"] {
        machine.run(&format!("{args} --check-config"), 0);
    }
    machine.domain.assert_empty();
}

#[test]
fn a_right_configuration_is_printed_with_the_origin_of_each_value() {
    let machine = machine("[commands]\nstations = [\"gcs\"]\n");
    let args = "robot --check-config --listen tcp/127.0.0.1:7001 --may-command watcher";
    let said = machine.run(args, 0).stdout;
    for (key, expected) in [
        (
            "commands.stations",
            ["[\"gcs\", \"watcher\"]", "# --may-command"],
        ),
        ("commands.deadline_ms", ["5000", "# built-in"]),
        ("robot.listen", ["[\"tcp/127.0.0.1:7001\"]", "# --listen"]),
    ] {
        let line = said.iter().find(|line| line.starts_with(key));
        let line = line.unwrap_or_else(|| panic!("{key} is missing in\n{said:#?}"));
        assert!(expected.iter().all(|part| line.contains(part)), "{line}");
    }
}
