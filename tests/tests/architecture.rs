//! The rules of ARCHITECTURE.md that a compiler does not know: which crate may depend on which, and what pure sources
//! never mention.
//!
//! A failure names the arrow, or the file and the line. An intended change begins in ARCHITECTURE.md, and then comes to
//! the tables here. What others build on is in `published.rs`.

mod published;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::{Value, json};

/// Each crate and the crates of this workspace that it may depend on.
const ARROWS: [(&str, &[&str]); 24] = [
    ("dsp-protocol", &[]),
    ("ipc-types", &[]),
    ("ril-runtime", &[]),
    ("ipc-fixtures", &["ipc-types"]),
    ("module-kit", &["ipc-types", "ril-runtime"]),
    (
        "bridge",
        &["dsp-protocol", "ipc-types", "module-kit", "ril-runtime"],
    ),
    (
        "status",
        &["dsp-protocol", "ipc-types", "module-kit", "ril-runtime"],
    ),
    (
        "relay",
        &["ipc-types", "module-kit", "ros-messages", "ril-runtime"],
    ),
    ("ros-messages", &["ipc-types"]),
    ("recording", &["ipc-types", "ros-messages"]),
    ("dsp-sim", &["dsp-protocol", "ril-runtime"]),
    (
        "conform",
        &["bridge", "dsp-protocol", "operator", "ril-runtime"],
    ),
    (
        "operator",
        &[
            "bridge",
            "dsp-protocol",
            "ipc-types",
            "module-kit",
            "plans",
            "recording",
            "ros-messages",
            "ril-runtime",
            "status",
        ],
    ),
    (
        "recorder",
        &[
            "bridge",
            "ipc-types",
            "module-kit",
            "operator",
            "recording",
            "ros-messages",
            "ril-runtime",
            "status",
        ],
    ),
    (
        "mavlink-gateway",
        &[
            "bridge",
            "dsp-protocol",
            "ipc-types",
            "module-kit",
            "operator",
            "plans",
            "ril-runtime",
        ],
    ),
    (
        "plans",
        &["bridge", "dsp-protocol", "ipc-types", "ril-runtime"],
    ),
    ("replay", &["bridge", "ipc-types", "module-kit", "status"]),
    (
        "ril",
        &[
            "bridge",
            "conform",
            "dsp-protocol",
            "dsp-sim",
            "ipc-types",
            "mavlink-gateway",
            "operator",
            "plans",
            "recorder",
            "recording",
            "replay",
            "ros-messages",
            "ril-runtime",
            "status",
            "view",
        ],
    ),
    (
        "view",
        &[
            "bridge",
            "dsp-protocol",
            "ipc-types",
            "module-kit",
            "operator",
            "plans",
            "recording",
            "ros-messages",
            "ril-runtime",
            "status",
        ],
    ),
    ("hero-ril", &["ipc-types", "module-kit", "ril-runtime"]),
    (
        "ril-tests",
        &[
            "bridge",
            "dsp-protocol",
            "dsp-sim",
            "ipc-fixtures",
            "ipc-types",
            "module-kit",
            "recording",
            "replay",
            "ril-runtime",
            "status",
        ],
    ),
    (
        "endurance",
        &[
            "dsp-sim",
            "ipc-types",
            "mavlink-gateway",
            "measure",
            "module-kit",
            "recording",
            "ril-tests",
            "ril-runtime",
        ],
    ),
    ("measure", &[]),
    (
        "world",
        &[
            "bridge",
            "dsp-protocol",
            "dsp-sim",
            "ipc-types",
            "mavlink-gateway",
            "operator",
            "plans",
            "recording",
            "relay",
            "ril-runtime",
            "status",
            "view",
        ],
    ),
];

/// The one crate that knows the transport (requirement A6).
const KNOWS_TRANSPORT: &str = "ipc-types";
const TRANSPORT: &str = "iceoryx2";

/// The one crate that knows the network, in one folder.
const KNOWS_NETWORK: &str = "relay";
const NETWORK: &str = "zenoh";

/// The crate that can be built for a microcontroller: it may depend on nothing but a checksum, which can be so too, and
/// on serde where a feature asks for it.
const BARE: &str = "dsp-protocol";
const BARE_MAY_HAVE: [&str; 2] = ["crc", "serde"];

/// Words that the sources under `paths` never contain, outside comments.
struct Ban {
    paths: &'static [&'static str],
    except: &'static [&'static str],
    words: &'static [&'static str],
    why: &'static str,
}

const BANS: [Ban; 6] = [
    Ban {
        paths: &[
            "bridge/src",
            "status/src",
            "crates/module-kit/src",
            "crates/dsp-protocol/src",
            "dsp-sim/src",
            "crates/conform/src",
            "crates/plans/src",
            "crates/flight-record/recording/src",
            "crates/flight-record/recorder/src",
            "crates/flight-record/replay/src",
            "gateways/relay/src",
            "gateways/mavlink/src",
            "gateways/view/src",
            "crates/operator/src",
            "crates/flight-record/ros-messages/src",
        ],
        // Between the threads of Zenoh and the relay's own.
        except: &["inbox.rs"],
        words: &["Mutex", "RwLock", "Condvar"],
        why: "every state has one owner; nothing is shared between threads",
    },
    Ban {
        paths: &[
            "bridge/src",
            "status/src",
            "crates/module-kit/src",
            "crates/dsp-protocol/src",
            "dsp-sim/src",
            "crates/conform/src",
            "crates/flight-record/recording/src",
            "crates/flight-record/recorder/src",
            "crates/flight-record/replay/src",
            "gateways/relay/src",
            "gateways/mavlink/src",
            "gateways/view/src",
            "crates/operator/src",
            "crates/flight-record/ros-messages/src",
        ],
        except: &[],
        words: &["thread::sleep", "nanosleep", "thread::park"],
        why: "a process sleeps in its one wait, until a byte, a request, a sample or a deadline",
    },
    Ban {
        paths: &["gateways/relay/src"],
        except: &["network"],
        words: &["zenoh::"],
        why: "one folder knows the network; everything else knows messages",
    },
    Ban {
        paths: &["crates/conform/src"],
        except: &["cli.rs", "shell"],
        words: &["bridge::", "operator::"],
        why: "what the kit sends and judges stands on docs/protocol.md alone; only the process around it uses the bridge's serial port",
    },
    Ban {
        paths: &["crates/dsp-protocol/src"],
        except: &[],
        words: &[
            "std::fs",
            "std::io",
            "std::net",
            "std::thread",
            "std::time",
            "std::env",
        ],
        why: "the wire format knows no file, no clock and no thread",
    },
    Ban {
        paths: &[
            "bridge/src",
            "crates/conform/src",
            "status/src",
            "crates/plans/src",
            "crates/module-kit/src/rules.rs",
            "crates/module-kit/src/manager.rs",
            "crates/module-kit/src/answers.rs",
            "crates/flight-record/recording/src",
            "crates/flight-record/recorder/src",
            "crates/flight-record/replay/src",
            "crates/flight-record/ros-messages/src",
            "gateways/relay/src/clock",
            "gateways/relay/src/orders",
            "gateways/relay/src/message.rs",
            "gateways/relay/src/telemetry.rs",
            "gateways/relay/src/station/catalog.rs",
            "gateways/relay/src/station/link.rs",
            "gateways/relay/src/robot/stations.rs",
            "gateways/relay/src/pace",
            "gateways/mavlink/src",
            "gateways/view/src",
            "crates/operator/src/render/fields.rs",
            "crates/operator/src/render/messages.rs",
            "crates/operator/src/render/words.rs",
            "crates/operator/src/robot/changes.rs",
            "crates/operator/src/robot/controller.rs",
            "crates/operator/src/robot/freshness.rs",
            "crates/operator/src/robot/history.rs",
            "crates/operator/src/robot/model.rs",
            "crates/operator/src/robot/pilot.rs",
        ],
        except: &[
            "shell",
            "shell.rs",
            "main.rs",
            "cli.rs",
            "start.rs",
            "store.rs",
            "file_name.rs",
            "tests.rs",
        ],
        words: &[
            "Instant::now",
            "SystemTime::now",
            "MonotonicNs::now",
            "std::thread",
            "std::fs",
        ],
        why: "the pure core is given the time and its inputs; only the shell, and the names and files of logs, have more",
    },
];

fn workspace() -> PathBuf {
    let member = Path::new(env!("CARGO_MANIFEST_DIR"));
    member.parent().expect("a workspace above").to_owned()
}

/// What cargo says of the packages of the workspace.
fn metadata(options: &[&str]) -> Value {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .args(["metadata", "--format-version=1", "--offline", "--locked"])
        .args(options)
        .current_dir(workspace())
        .output()
        .expect("cargo runs");
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "cargo metadata: {complaint}");
    serde_json::from_slice(&output.stdout).expect("cargo prints JSON")
}

/// What is wrong with the dependencies of the packages in `metadata`; empty if all is well.
fn offences_against_arrows(metadata: &Value) -> Vec<String> {
    let allowed: BTreeMap<_, _> = ARROWS.into_iter().collect();
    let mut offences = Vec::new();
    let packages = metadata["packages"].as_array().expect("packages");
    for package in packages {
        let from = package["name"].as_str().expect("a name");
        let Some(arrows) = allowed.get(from) else {
            offences.push(format!("`{from}` is a crate that the table does not have"));
            continue;
        };
        for dependency in package["dependencies"].as_array().expect("dependencies") {
            let to = dependency["name"].as_str().expect("a name");
            // Normal dependencies have no kind. Tests may use more than what they test.
            let is_dev = dependency["kind"] == "dev";
            if allowed.contains_key(to) && !arrows.contains(&to) && !is_dev {
                offences.push(format!("`{from}` → `{to}` is an arrow that is not drawn"));
            }
            if to.starts_with(TRANSPORT) && from != KNOWS_TRANSPORT {
                offences.push(format!(
                    "`{from}` → `{to}`: only `{KNOWS_TRANSPORT}` knows the transport"
                ));
            }
            if to.starts_with(NETWORK) && from != KNOWS_NETWORK {
                offences.push(format!(
                    "`{from}` → `{to}`: only `{KNOWS_NETWORK}` knows the network"
                ));
            }
            if from == BARE && !BARE_MAY_HAVE.contains(&to) && !is_dev {
                offences.push(format!(
                    "`{from}` → `{to}`: it has no dependencies but {BARE_MAY_HAVE:?}"
                ));
            }
        }
    }
    for name in allowed.keys() {
        if !packages.iter().any(|package| package["name"] == *name) {
            offences.push(format!(
                "`{name}` is in the table, but not in the workspace"
            ));
        }
    }
    offences
}

/// The part of a line that is not a comment. That a string may hold two slashes only makes the scan milder.
fn code_of(line: &str) -> &str {
    line.split("//").next().unwrap_or_default()
}

/// Numbers of the lines of `source` that contain one of `words`, with the word.
fn offences_in(source: &str, words: &[&'static str]) -> Vec<(usize, &'static str)> {
    let mut offences = Vec::new();
    for (index, line) in source.lines().enumerate() {
        let hits = words.iter().filter(|word| code_of(line).contains(**word));
        offences.extend(hits.map(|word| (index + 1, *word)));
    }
    offences
}

/// All Rust sources below `path`, without those whose file or folder is one of `except`.
fn sources(path: &Path, except: &[&str]) -> Vec<PathBuf> {
    let name = path.file_name().and_then(|name| name.to_str());
    if name.is_some_and(|name| except.contains(&name)) {
        return vec![];
    }
    if path.is_dir() {
        let entries = fs::read_dir(path).expect("a folder that can be read");
        return entries
            .flat_map(|entry| sources(&entry.expect("an entry").path(), except))
            .collect();
    }
    let is_source = path.extension().is_some_and(|extension| extension == "rs");
    is_source.then(|| path.to_owned()).into_iter().collect()
}

fn assert_none(offences: &[String]) {
    assert!(offences.is_empty(), "\n{}\n", offences.join("\n"));
}

#[test]
fn crates_depend_only_along_the_arrows() {
    assert_none(&offences_against_arrows(&metadata(&["--no-deps"])));
}

/// The crates of the picture, each with the number of its line, from below.
fn lines_of_the_picture() -> BTreeMap<String, usize> {
    let page = fs::read_to_string(workspace().join("ARCHITECTURE.md")).expect("the page");
    let picture = page.rsplit("```text\n").next().unwrap_or_default();
    let picture = picture.split("```").next().unwrap_or_default();
    let lines = picture.lines().rev().enumerate();
    lines
        .flat_map(|(height, line)| {
            line.split_whitespace()
                .map(move |name| (name.to_owned(), height))
        })
        .collect()
}

#[test]
fn arrows_lead_down_in_the_picture() {
    let lines = lines_of_the_picture();
    let beside = ["endurance", "measure", "ril-tests", "world"];
    for (from, arrows) in ARROWS.iter().filter(|(from, _)| !beside.contains(from)) {
        let height = lines.get(*from);
        assert!(height.is_some(), "`{from}` is not in the picture");
        for to in *arrows {
            assert!(lines.get(*to) < height, "`{from}` → `{to}` leads not down");
        }
    }
    assert_eq!(lines.len() + beside.len(), ARROWS.len());
}

#[test]
fn pure_sources_mention_no_locks_sleeps_clocks_or_files() {
    let root = workspace();
    let mut offences = Vec::new();
    for ban in &BANS {
        for path in ban.paths {
            let files = sources(&root.join(path), ban.except);
            assert!(!files.is_empty(), "no sources in {path}");
            for file in files {
                let source = fs::read_to_string(&file).expect("a source that can be read");
                let name = file.strip_prefix(&root).unwrap_or(&file).display();
                for (line, word) in offences_in(&source, ban.words) {
                    offences.push(format!("{name}:{line}: `{word}`: {}", ban.why));
                }
            }
        }
    }
    assert_none(&offences);
}

/// The folders whose files the table of rooms names, by row.
const NAMED: [(&str, &[&str]); 17] = [
    ("ipc-types", &["src"]),
    ("bridge", &["src"]),
    ("status", &["src"]),
    ("dsp-sim", &["src"]),
    ("ril", &["src"]),
    (
        "gateways",
        &["relay/src", "view/src", "view/page", "mavlink/src"],
    ),
    ("crates/operator", &["src"]),
    (
        "crates/flight-record",
        &[
            "recording/src",
            "recorder/src",
            "replay/src",
            "ros-messages/src",
        ],
    ),
    ("crates/conform", &["src"]),
    ("crates/plans", &["src"]),
    ("crates/module-kit", &["src"]),
    ("crates/ipc-fixtures", &["src"]),
    ("crates/runtime", &["src"]),
    ("crates/dsp-protocol", &["src"]),
    ("bindings", &["c/src", "python/src"]),
    ("tests", &["src", "tests"]),
    (
        "workbench",
        &["endurance/src", "measure/src", "world/src", "mutants/src"],
    ),
];

/// The names below `folder`: those of Rust without their ending, folders that have nothing else among them, and each
/// other folder with its own behind a semicolon. Tests and what a language wants, such as `mod.rs`, are left out.
fn names_below(folder: &Path, above: &str, parts: &mut Vec<String>) {
    const LEFT_OUT: &str = "mod lib main tests test vendor templates screens snapshots";
    let is_left_out = |name: &str| LEFT_OUT.split(' ').any(|one| one == name);
    let (mut names, mut folders) = (BTreeSet::new(), Vec::new());
    let entries = fs::read_dir(folder).unwrap();
    let mut entries: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for entry in entries {
        let stem = entry.file_stem().unwrap().to_string_lossy().into_owned();
        match entry.extension().and_then(std::ffi::OsStr::to_str) {
            _ if is_left_out(&stem) => {}
            None if entry.is_dir() => {
                let mut inner = Vec::new();
                names_below(&entry, &format!("{above}{stem}/"), &mut inner);
                match inner.is_empty() {
                    true => _ = names.insert(stem),
                    false => folders.extend(inner),
                }
            }
            Some("rs") => _ = names.insert(stem),
            Some("js" | "css" | "html") => {
                names.insert(entry.file_name().unwrap().to_string_lossy().into_owned());
            }
            _ => {}
        }
    }
    if !names.is_empty() {
        let names = Vec::from_iter(names).join(" ");
        let place = above.trim_end_matches('/');
        parts.push(match place {
            "" => names,
            place => format!("`{place}`: {names}"),
        });
    }
    parts.extend(folders);
}

#[test]
fn the_page_names_the_files_of_each_room() {
    let page = fs::read_to_string(workspace().join("ARCHITECTURE.md")).unwrap();
    for (room, folders) in NAMED {
        let mut all = Vec::new();
        for folder in folders {
            let above = match *folder {
                "src" => String::new(),
                folder => format!("{folder}/"),
            };
            names_below(&workspace().join(room).join(folder), &above, &mut all);
        }
        let expected = format!("| {} |", all.join("; "));
        let row = page
            .lines()
            .find(|line| line.starts_with(&format!("| `{room}`")));
        let row = row.unwrap_or_else(|| panic!("ARCHITECTURE.md has no room `{room}`"));
        assert!(
            row.ends_with(&expected),
            "the row of `{room}` should end with\n{expected}"
        );
    }
}

/// The project has no address of its own yet (SECURITY.md): one that looks like an address and is none swallows what
/// is sent to it.
#[test]
fn no_file_names_an_address_that_does_not_exist() {
    let listed = Command::new("git")
        .args(["ls-files", "-z"])
        .current_dir(workspace())
        .output();
    let Some(listed) = listed.ok().filter(|listed| listed.status.success()) else {
        return println!("SKIPPED: this is no checkout");
    };
    let names = String::from_utf8(listed.stdout).expect("names in UTF-8");
    let files: Vec<&str> = names.split_terminator('\0').collect();
    assert!(files.contains(&"SECURITY.md"), "{files:?}");
    // In two parts, so that this line is none of them.
    let domain = ["hero", "example"].join(".");
    let named = |file: &&&str| {
        let text = fs::read(workspace().join(file)).unwrap_or_default();
        text.windows(domain.len())
            .any(|word| word == domain.as_bytes())
    };
    assert_none(
        &files
            .iter()
            .filter(named)
            .map(|file| (*file).to_owned())
            .collect::<Vec<_>>(),
    );
}

#[test]
fn an_arrow_that_is_not_drawn_is_named() {
    let dependency = |name: &str, kind: Option<&str>| json!({ "name": name, "kind": kind });
    #[rustfmt::skip]
    let cases = [
        ("status", dependency("bridge", None), Some("`status` → `bridge`")),
        ("status", dependency("bridge", Some("build")), Some("`status` → `bridge`")),
        ("status", dependency("dsp-sim", Some("dev")), None),
        ("status", dependency("csv", None), None),
        ("bridge", dependency("iceoryx2-cal", Some("dev")), Some("knows the transport")),
        ("dsp-protocol", dependency("thiserror", None), Some("no dependencies")),
        ("dsp-protocol", dependency("crc", None), None),
        ("dsp-protocol", dependency("proptest", Some("dev")), None),
        ("newcomer", dependency("serde", None), Some("table does not have")),
    ];
    for (from, dependency, expected) in cases {
        let mut packages: Vec<_> = ARROWS
            .iter()
            .filter(|(name, _)| *name != from)
            .map(|(name, _)| json!({ "name": name, "dependencies": [] }))
            .collect();
        packages.push(json!({ "name": from, "dependencies": [dependency] }));
        let offences = offences_against_arrows(&json!({ "packages": packages }));
        match expected {
            None => assert_none(&offences),
            Some(text) => assert!(offences[0].contains(text), "{from}: {offences:?}"),
        }
    }
}

#[test]
fn the_scan_finds_words_in_code_and_not_in_comments() {
    let source =
        "let lock = Mutex::new(1);\n// no Mutex here\nwork(); // and no RwLock\nRwLock::new()";
    let offences = offences_in(source, &["Mutex", "RwLock"]);
    assert_eq!(offences, [(1, "Mutex"), (4, "RwLock")]);
}
