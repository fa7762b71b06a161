//! Every verb alike: help, exit codes, JSON, plain pipes; and that documents name commands and JSON objects that exist.
//!
//! The verbs are enumerated from the parser, so that a new verb is held to the rules without being named here.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use clap::error::ErrorKind;
use clap::{Arg, Command, CommandFactory};
use ipc_types::Topic;
use ipc_types::code::Reason;
use ipc_types::payload::{
    BridgeOutline, ConfigurationPiece, DspTelemetry, HeroTelemetry, MavlinkStations, ModuleState,
    RelayLink, RelayStations, RequestReport, SharedStruct,
};
use ril::cli::Cli;
use ril_tests::Sandbox;
use ril_tests::process::{Finished, Process};
use runtime::exit::ExitCode;

use crate::common::{json, sandbox};

/// Columns of the terminal for which every help is written.
const COLUMNS: usize = 80;

/// Verbs that run until they are ended, so that they are not run here.
const RUNS_ON: [&str; 10] = [
    "run bridge",
    "run status",
    "run sim",
    "run view",
    "run mavlink",
    "bridge",
    "sim",
    "demo",
    "record",
    "view",
];

/// Verbs whose output is for a shell, a table program or a person at a terminal, and never JSON.
const WITHOUT_JSON: [&str; 3] = ["completions", "log csv", "watch"];

/// A list of waypoints: home, and a take-off.
const PLAN: &str =
    "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t37\t-6\t0\t1\n1\t0\t3\t22\t0\t0\t0\t0\t37\t-6\t9\t1\n";

/// A verb that can be run: its names, and what the parser knows of it.
struct Verb {
    path: String,
    command: Command,
}

/// All verbs that have no verbs below them, but for the parser's own `help`.
fn verbs() -> Vec<Verb> {
    fn collect(command: &Command, path: &str, all: &mut Vec<Verb>) {
        for inner in command.get_subcommands() {
            if inner.get_name() == "help" || inner.is_hide_set() {
                continue;
            }
            let path = format!("{path} {}", inner.get_name()).trim().to_owned();
            match inner.has_subcommands() {
                true => collect(inner, &path, all),
                false => all.push(Verb {
                    path,
                    command: inner.clone(),
                }),
            }
        }
    }
    let mut command = Cli::command();
    command.build();
    let mut all = Vec::new();
    collect(&command, "", &mut all);
    assert!(all.len() > 25, "only {} verbs", all.len());
    all
}

impl Verb {
    fn has(&self, option: &str) -> bool {
        let mut options = self.command.get_arguments();
        options.any(|argument| argument.get_long() == Some(option))
    }

    fn is_run_here(&self) -> bool {
        !RUNS_ON.contains(&self.path.as_str()) && !WITHOUT_JSON.contains(&self.path.as_str())
    }

    /// Arguments with which it does something without any process around: what it needs, a short time-out, and an end.
    fn arguments(&self) -> String {
        let mut words = vec![self.path.clone()];
        let required = self
            .command
            .get_arguments()
            .filter(|one| one.is_required_set());
        for argument in required.chain(self.positionals()) {
            if let Some(long) = argument.get_long() {
                words.push(format!("--{long}"));
            }
            words.push(sample(argument));
        }
        for (option, value) in [("timeout", "50ms"), ("count", "2")] {
            if self.has(option) {
                words.push(format!("--{option} {value}"));
            }
        }
        words.join(" ")
    }

    /// Positional arguments that are required unless another option is given.
    fn positionals(&self) -> impl Iterator<Item = &Arg> {
        let names = ["waypoints", "to", "words"];
        self.command
            .get_positionals()
            .filter(move |one| !one.is_required_set() && names.contains(&one.get_id().as_str()))
    }
}

/// A value that an argument takes.
fn sample(argument: &Arg) -> String {
    if let Some(value) = argument.get_possible_values().first() {
        return value.get_name().to_owned();
    }
    match argument.get_id().as_str() {
        "waypoints" | "words" => "37,-6,20",
        "altitude" | "to" | "value" => "5",
        "conditions" => "up",
        "topic" => "hero_telemetry",
        "port" => "yaw_gain",
        _ => "absent",
    }
    .to_owned()
}

/// Runs `ril` to its end, as wide as every help must be.
fn run(rig: &Sandbox, args: &str) -> Finished {
    let mut command = rig.command(args.split_whitespace());
    command.env("COLUMNS", COLUMNS.to_string());
    let finished = Process::spawn(&rig.domain, command).wait_exit();
    assert!(finished.code().is_some(), "{args}: {finished:#?}");
    for line in finished.stdout.iter().chain(&finished.stderr) {
        assert!(!line.contains('\x1b'), "{args}: escape codes in {line:?}");
    }
    finished
}

/// Checks that every line is an object with a documented schema, and that the last one is the failure if there is one.
#[track_caller]
fn check_json(args: &str, finished: &Finished, documented: &BTreeSet<String>) {
    let code = finished.code().unwrap();
    let objects: Vec<_> = finished.stdout.iter().map(|line| json(line)).collect();
    for object in &objects {
        let schema = object["schema"].as_str().unwrap_or_default();
        assert!(documented.contains(schema), "{args}: {object}");
    }
    let Some(failure) = objects.last().filter(|_| code != 0) else {
        assert_eq!(code, 0, "{args}: no object tells of {finished:#?}");
        return;
    };
    assert_eq!(failure["schema"], "ril.Error.v1", "{args}: {finished:#?}");
    assert_eq!(failure["exit_code"], code, "{args}: {failure}");
    let known = ExitCode::ALL
        .into_iter()
        .find(|one| i32::from(one.code()) == code);
    assert_eq!(failure["code"], known.unwrap().name(), "{args}: {failure}");
    for text in ["message", "next_step"] {
        let text = failure[text].as_str().unwrap_or_default();
        assert!(!text.is_empty(), "{args}: {failure}");
    }
    let errors = finished
        .stdout
        .iter()
        .filter(|line| line.contains("ril.Error.v1"));
    assert_eq!(errors.count(), 1, "{args}: {finished:#?}");
}

#[test]
fn every_help_fits_the_terminal_and_lists_the_exit_codes() {
    let rig = sandbox();
    let mut paths: Vec<String> = verbs().into_iter().map(|verb| verb.path).collect();
    paths.push(String::new());
    for path in paths {
        for help in ["--help", "-h"] {
            let args = format!("{path} {help}");
            let finished = run(&rig, &args);
            assert_eq!(finished.code(), Some(0), "{args}: {finished:#?}");
            for line in &finished.stdout {
                let length = line.chars().count();
                assert!(length <= COLUMNS, "{args}: {length} characters in {line:?}");
            }
            for code in ExitCode::ALL {
                let start = format!("{:>4}  ", code.code());
                let is_there = finished.stdout.iter().any(|line| line.starts_with(&start));
                assert!(is_there, "{args}: no exit code {code:?} in {finished:#?}");
            }
        }
    }
}

#[test]
fn every_verb_takes_json_and_a_usage_error_is_an_object_too() {
    let documented = documented();
    let rig = sandbox();
    for verb in verbs() {
        if WITHOUT_JSON.contains(&verb.path.as_str()) {
            continue;
        }
        assert!(verb.has("json"), "ril {} has no --json", verb.path);
        for args in [
            format!("{} --no-such-option --json", verb.path),
            format!("--json {} --no-such-option", verb.path),
        ] {
            let finished = run(&rig, &args);
            assert_eq!(finished.code(), Some(2), "{args}: {finished:#?}");
            check_json(&args, &finished, &documented);
        }
    }
    for args in ["--json", "--json strat", "strat --json"] {
        let finished = run(&rig, args);
        assert_eq!(finished.code(), Some(2), "{args}: {finished:#?}");
        check_json(args, &finished, &documented);
    }
}

#[test]
fn without_a_bridge_every_verb_says_so_in_words_and_in_json() {
    let documented = documented();
    let rig = sandbox();
    // What every file is called here.
    rig.write("absent", PLAN);
    for verb in verbs().iter().filter(|verb| verb.is_run_here()) {
        let args = verb.arguments();
        let plain = run(&rig, &args);
        let told = run(&rig, &format!("{args} --json"));
        assert_eq!(plain.code(), told.code(), "{args}: {plain:#?} {told:#?}");
        check_json(&args, &told, &documented);
        let asks_the_bridge = verb.has("timeout") && !verb.path.starts_with("relay");
        if asks_the_bridge && verb.has("deadline") {
            assert_eq!(told.code(), Some(3), "{args}: {told:#?}");
        }
        // What went wrong is said once.
        let errors = plain
            .stderr
            .iter()
            .filter(|line| line.starts_with("error: "));
        let expected = usize::from(plain.code() != Some(0));
        assert_eq!(errors.count(), expected, "{args}: {plain:#?}");
    }
    rig.domain.assert_empty();
}

#[test]
fn every_verb_with_a_configuration_refuses_one_that_is_wrong_and_prints_one_that_is_right() {
    let documented = documented();
    let rig = sandbox();
    rig.write("wrong.toml", "[no_such_table]\n");
    for verb in verbs() {
        let is_other = verb.path == "doctor" || WITHOUT_JSON.contains(&verb.path.as_str());
        if !verb.has("check-config") || is_other {
            continue;
        }
        let args = verb.arguments();
        let checked = format!("{args} --check-config --config wrong.toml --json");
        let finished = run(&rig, &checked);
        assert_eq!(finished.code(), Some(78), "{checked}: {finished:#?}");
        check_json(&checked, &finished, &documented);
        let checked = format!("{args} --check-config");
        let plain = run(&rig, &checked);
        assert_eq!(plain.code(), Some(0), "{checked}: {plain:#?}");
        plain.out_says("# built-in");
        let told = run(&rig, &format!("{checked} --json"));
        check_json(&checked, &told, &documented);
        let object = json(&told.stdout[0]);
        assert_eq!(object["schema"], "ril.Configuration.v1", "{checked}");
        assert!(
            object["values"]
                .as_array()
                .is_some_and(|values| !values.is_empty())
        );
    }
    rig.domain.assert_empty();
}

#[test]
fn a_checked_configuration_names_the_origin_of_each_value() {
    let rig = sandbox();
    rig.write("bridge.toml", "# mine\n[serial]\nbaud_rate = 230400\n");
    let mut command = rig.command(["run", "bridge", "--check-config"]);
    command.env("RIL_PORT", "/dev/ttyUSB9");
    let finished = Process::spawn(&rig.domain, command).wait_exit();
    for (key, expected) in [
        ("serial.baud_rate", ["230400", "# bridge.toml:3"]),
        ("serial.port", ["\"/dev/ttyUSB9\"", "# RIL_PORT"]),
        ("link.ack_timeout_ms", ["200", "# built-in"]),
    ] {
        let line = finished.stdout.iter().find(|line| line.starts_with(key));
        let line = line.unwrap_or_else(|| panic!("{key}: {finished:#?}"));
        assert!(expected.iter().all(|part| line.contains(part)), "{line}");
    }
    rig.write("bridge.toml", "# mine\n[serial]\nbaud_rate = 1200\n");
    for args in ["run bridge --check-config", "run bridge"] {
        let finished = rig.run(args, 78);
        let expected = "bridge.toml:3: 1200 baud carry 120 bytes a second";
        finished.err_says(expected);
    }
    let finished = rig.run("start --check-config --timeout 1m --deadline 50ms", 0);
    for expected in [
        "request.timeout_s = 60.0",
        "request.deadline_ms = 50",
        "# --deadline",
    ] {
        finished.out_says(expected);
    }
}

/// The folder of the whole workspace.
fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The workspace's files with one of these endings, but for what is built.
fn files(endings: &[&str]) -> Vec<(PathBuf, String)> {
    let mut folders = vec![workspace()];
    let mut found = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() {
                let is_source =
                    !name.starts_with('.') && name != "target" && name != "node_modules";
                folders.extend(is_source.then_some(path));
            } else if endings.iter().any(|ending| name.ends_with(ending))
                && let Ok(text) = fs::read_to_string(&path)
            {
                found.push((path, text));
            }
        }
    }
    assert!(!found.is_empty());
    found
}

/// The names of JSON layouts in a text, such as `ril.Error.v1`.
fn schemas(text: &str) -> BTreeSet<String> {
    let is_part = |c: char| !(c.is_ascii_alphanumeric() || c == '.');
    let names = text.split(is_part).map(|word| word.trim_matches('.'));
    names
        .filter(|name| {
            let parts: Vec<&str> = name.split('.').collect();
            let [owner, object, version] = parts[..] else {
                return false;
            };
            let number = version.strip_prefix('v').unwrap_or_default();
            ["ril", "hero"].contains(&owner)
                && object.starts_with(|c: char| c.is_ascii_uppercase())
                && number.parse::<u32>().is_ok()
        })
        .map(str::to_owned)
        .collect()
}

/// The schemas that `docs/json.md` describes.
fn documented() -> BTreeSet<String> {
    schemas(&fs::read_to_string(workspace().join("docs/json.md")).unwrap())
}

#[test]
fn the_schemas_that_are_printed_are_those_that_are_documented() {
    let samples = [
        DspTelemetry::TYPE_NAME,
        HeroTelemetry::TYPE_NAME,
        ModuleState::TYPE_NAME,
        BridgeOutline::TYPE_NAME,
        ConfigurationPiece::TYPE_NAME,
        MavlinkStations::TYPE_NAME,
        RelayLink::TYPE_NAME,
        RelayStations::TYPE_NAME,
        RequestReport::TYPE_NAME,
    ];
    // Topics by which a name is known too.
    assert_eq!(DspTelemetry::KEY, "dsp_telemetry");
    let mut printed: BTreeSet<String> = samples.map(str::to_owned).into();
    for (path, text) in files(&[".rs"]) {
        let is_source = [
            "/ril/src/",
            "/crates/",
            "/gateways/view/",
            "/gateways/mavlink/",
        ];
        if is_source
            .iter()
            .any(|part| path.to_string_lossy().contains(part))
        {
            let own = schemas(&text).into_iter();
            printed.extend(own.filter(|name| name.starts_with("ril.")));
        }
    }
    let documented = documented();
    let missing: Vec<_> = printed.difference(&documented).collect();
    assert!(
        missing.is_empty(),
        "docs/json.md does not describe {missing:?}"
    );
    let gone: Vec<_> = documented.difference(&printed).collect();
    assert!(
        gone.is_empty(),
        "docs/json.md describes {gone:?}, which no verb prints"
    );
}

/// Command lines of `ril` in a document: in code spans, and in blocks of a document in Markdown.
fn command_lines(path: &Path, text: &str) -> Vec<String> {
    let mut found = Vec::new();
    let is_markdown = path.extension().is_some_and(|extension| extension == "md");
    let mut in_block = false;
    for line in text.lines() {
        if is_markdown && line.trim_start().starts_with("```") {
            in_block = !in_block;
        } else if in_block {
            let line = line.trim_start_matches("$ ").replace("$(", " ; ");
            let commands = line.split([';', '&', '|', '`']).map(str::trim);
            found.extend(
                commands
                    .filter(|one| one.starts_with("ril "))
                    .map(str::to_owned),
            );
        } else {
            let spans = line.split('`').skip(1).step_by(2);
            let first = spans.map(|span| span.split('|').next().unwrap_or_default().trim());
            found.extend(
                first
                    .filter(|one| one.starts_with("ril "))
                    .map(str::to_owned),
            );
        }
    }
    found
}

/// The words of a command line, with values in the place of what a reader is to replace.
fn words(line: &str) -> Vec<OsString> {
    let command = line.split(" #").next().unwrap_or_default();
    let command = command.split(['>', '<']).next().unwrap_or_default();
    let words = command.split_whitespace().map(|word| {
        let word = word.trim_matches(|c| "[](),\"'".contains(c));
        match word {
            "N" | "VALUE" | "M" => "1",
            "DURATION" => "5s",
            "LAT,LON,ALT" => "37,-6,20",
            word if word.starts_with('{') => "1",
            word => word,
        }
    });
    words
        .filter(|word| !["…", "...", "\\", ""].contains(word))
        .map(OsString::from)
        .collect()
}

/// Names of processes that are crates of their own and are started by `ril` alone.
const NOT_INSTALLED: [&str; 3] = ["bridge", "status", "dsp-sim"];

#[test]
fn no_text_tells_an_operator_to_start_a_program_that_is_not_installed() {
    for (path, text) in files(&[".md", ".toml"]) {
        let spans = text.split('`').skip(1).step_by(2);
        for span in spans.filter(|span| !span.contains('\n')) {
            let mut words = span.split_whitespace();
            let is_one = words
                .next()
                .is_some_and(|word| NOT_INSTALLED.contains(&word));
            let is_run = is_one && words.next().is_some_and(|word| word.starts_with("--"));
            assert!(!is_run, "{}: `{span}`", path.display());
        }
    }
}

/// The first columns of the tables below a heading of a document, without the headings of the tables.
fn first_column(document: &str, heading: &str) -> Vec<String> {
    let section = document.split_once(heading).expect("the heading").1;
    let section = section.split("\n## ").next().unwrap_or_default();
    let rows = section.lines().filter(|line| line.starts_with("| "));
    let cells = rows.filter_map(|row| row.split('|').nth(1));
    cells.map(|cell| cell.trim().to_owned()).collect()
}

/// The code spans of a text.
fn spans(text: &str) -> Vec<&str> {
    text.split('`').skip(1).step_by(2).collect()
}

#[test]
fn every_note_that_is_documented_is_one_that_is_shown() {
    let operations = fs::read_to_string(workspace().join("docs/reference.md")).unwrap();
    let reasons = first_column(&operations, "\n## Reasons and what to do\n");
    let documented: BTreeSet<&str> = reasons.iter().flat_map(|cell| spans(cell)).collect();
    let known: BTreeSet<&str> = Reason::ALL
        .iter()
        .filter(|reason| **reason != Reason::None)
        .map(|reason| reason.name())
        .collect();
    assert_eq!(documented, known);

    let codes = first_column(&operations, "\n## Exit codes\n");
    let codes: Vec<u8> = codes.iter().filter_map(|cell| cell.parse().ok()).collect();
    assert_eq!(codes, ExitCode::ALL.map(ExitCode::code));

    // The messages of the logs, word by word.
    let logs = operations
        .split_once("\n| message | what to do |")
        .unwrap()
        .1;
    let rows = logs
        .lines()
        .skip(2)
        .take_while(|line| line.starts_with("| "));
    let sources: String = files(&[".rs"])
        .into_iter()
        .filter(|(path, _)| path.to_string_lossy().contains("/status/src/"))
        .map(|(_, text)| text)
        .collect();
    let mut count = 0;
    for row in rows {
        for message in spans(row.split('|').nth(1).unwrap_or_default()) {
            assert!(sources.contains(message), "no source has `{message}`");
            count += 1;
        }
    }
    assert!(count >= 5, "only {count} messages");
}

#[test]
fn every_command_that_is_written_somewhere_exists() {
    let mut wrong = Vec::new();
    let mut count = 0;
    for (path, text) in files(&[".md", ".toml", ".rs"]) {
        for line in command_lines(&path, &text) {
            let words = words(&line);
            let verb = words
                .get(1)
                .and_then(|word| word.to_str())
                .unwrap_or_default();
            // A name that the program puts there, and a span that says how any verb is called.
            let is_open = line
                .split(' ')
                .skip(1)
                .take(2)
                .any(|word| word.contains(['{', '"', '…']) || word == "VERB");
            if verb.is_empty() || is_open {
                continue;
            }
            count += 1;
            let Err(error) = Cli::read(words) else {
                continue;
            };
            let unknown = [ErrorKind::UnknownArgument, ErrorKind::InvalidSubcommand];
            if unknown.contains(&error.kind()) {
                let text = error.to_string();
                let reason = text.lines().next().unwrap_or_default();
                wrong.push(format!("{}: `{line}`: {reason}", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(count > 100, "only {count} commands were found");
}
