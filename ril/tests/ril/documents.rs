//! The examples of the documents. Every fenced block of every page has a rule by its language; what a reader can run is
//! run, in the order of the page, beside a simulated robot.
//!
//! | first line of the block | rule |
//! |---|---|
//! | `sh` | each line is run and must succeed. `&`: it runs on, until its section ends. `# Ctrl+C ends it` and `# q ends it`: it is ended so |
//! | `sh terminals` | each line runs on, in a terminal of its own, until the page ends |
//! | `sh no-run: WHY` | cannot be run here |
//! | `console` | behind `$ ` a command; below it what it prints, but for numbers. `…` stands for any lines, or for the rest of one |
//! | `toml FILE` | the program whose file that is takes it |
//! | `ini` | settings of systemd; what is executed is a command line of `ril` |
//! | `LANGUAGE of FILE` | a part of that file, which other tests build and run |
//! | `text` | a picture, or output that cannot be made here |
//! | any other language | another test takes the blocks from the page: [`ELSEWHERE`] |

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::process::Command;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use ipc_types::Domain;
use ril::cli::Cli;
use ril_tests::languages::{documents, root, skip};
use ril_tests::process::{Finished, Process, Signal};
use ril_tests::relayed::free_endpoint;
use ril_tests::{Sandbox, StandInTopic, TestDomain};

use crate::common::{has_relay, sandbox};
use crate::watch::screen::Screen;

/// Pages with something to run, each of which has a test below.
const PAGES: [&str; 12] = [
    "README.md",
    "docs/firmware.md",
    "docs/install.md",
    "docs/json.md",
    "docs/mavlink.md",
    "docs/modules.md",
    "docs/network.md",
    "docs/operations.md",
    "docs/plans.md",
    "docs/reference.md",
    "docs/safety.md",
    "docs/view.md",
];

/// Blocks that another test takes from the page: page, language, file and words in it.
const ELSEWHERE: [(&str, &str, &str, &str); 11] = [
    (
        "README.md",
        "rust,no_run",
        "tests/src/lib.rs",
        "include_str!(\"../../README.md\")",
    ),
    (
        "docs/consumers.md",
        "rust,no_run",
        "tests/src/lib.rs",
        "include_str!(\"../../docs/consumers.md\")",
    ),
    (
        "docs/consumers.md",
        "c",
        "tests/tests/examples.rs",
        "fn the_first_minute_shows_how_high_the_helicopter_is_in_every_language",
    ),
    (
        "docs/consumers.md",
        "cpp",
        "tests/tests/examples.rs",
        "fn the_first_minute_shows_how_high_the_helicopter_is_in_every_language",
    ),
    (
        "bindings/c/README.md",
        "c",
        "tests/tests/examples.rs",
        "fn the_fragments_of_the_page_about_c_and_cpp_compile",
    ),
    (
        "bindings/c/README.md",
        "cpp",
        "tests/tests/examples.rs",
        "fn the_fragments_of_the_page_about_c_and_cpp_compile",
    ),
    (
        "bindings/c/README.md",
        "cmake",
        "tests/tests/examples.rs",
        "fn the_installed_library_has_a_versioned_name_and_is_found_by_pkg_config_and_cmake",
    ),
    (
        "bindings/python/README.md",
        "python",
        "tests/tests/examples.rs",
        "fn the_fragments_of_the_page_about_python_run",
    ),
    (
        "docs/consumers.md",
        "python",
        "tests/tests/consumers.rs",
        "fn the_programs_of_the_page_do_what_it_says",
    ),
    (
        "docs/recording.md",
        "python",
        "ril/tests/ril/stock_readers/documents.rs",
        "strip_prefix(language)",
    ),
    (
        "docs/recording.md",
        "js",
        "ril/tests/ril/stock_readers/documents.rs",
        "strip_prefix(language)",
    ),
];

/// A fenced block.
#[derive(Debug)]
struct Block {
    /// Of its first line in the page, from 1.
    line: usize,
    section: String,
    language: String,
    /// What follows the language.
    rule: String,
    text: Vec<String>,
}

/// The blocks of a page, in its order.
fn blocks(page: &str) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    let (mut section, mut is_open, mut indent) = (String::new(), false, 0);
    for (number, line) in (1..).zip(page.lines()) {
        let fence = line.trim_start().strip_prefix("```");
        match (is_open, fence) {
            (false, Some(info)) => {
                let (language, rule) = info.split_once(' ').unwrap_or((info, ""));
                indent = line.len() - line.trim_start().len();
                blocks.push(Block {
                    line: number + 1,
                    section: section.clone(),
                    language: language.to_owned(),
                    rule: rule.to_owned(),
                    text: Vec::new(),
                });
                is_open = true;
            }
            (true, Some(_)) => is_open = false,
            (true, None) => {
                let text = line.get(indent..).unwrap_or_default().to_owned();
                blocks.last_mut().expect("it is open").text.push(text);
            }
            (false, None) => {
                if let Some(heading) = line.strip_prefix("## ") {
                    section = heading.to_owned();
                }
            }
        }
    }
    assert!(!is_open, "a block without end");
    blocks
}

/// A document's name from the root of the workspace, and its blocks.
fn pages() -> BTreeMap<String, Vec<Block>> {
    let root = root();
    let pages = documents(&root).into_iter().map(|path| {
        let name = path.strip_prefix(&root).expect("below the root");
        let text = fs::read_to_string(&path).expect("a page");
        (name.to_string_lossy().into_owned(), blocks(&text))
    });
    pages.collect()
}

/// Whether the lines of `block` stand one after the other in `file`, however far they are indented, or in an example in
/// its front page.
fn is_part_of(block: &Block, file: &str) -> bool {
    let trimmed = |line: &str| {
        line.trim_start()
            .trim_start_matches("//!")
            .trim()
            .to_owned()
    };
    let part: Vec<String> = block.text.iter().map(|line| trimmed(line)).collect();
    let file = fs::read_to_string(root().join(file)).unwrap_or_default();
    let lines: Vec<String> = file.lines().map(trimmed).collect();
    !part.is_empty() && lines.windows(part.len()).any(|window| window == part)
}

/// Robots of that user may fly: `as_root.rs` shows what the programs say.
#[test]
fn no_document_says_that_the_folder_of_another_user_is_to_be_removed() {
    for page in documents(&root()) {
        let text = fs::read_to_string(&page).expect("a page");
        let words: Vec<&str> = text.split_whitespace().collect();
        let words = words.join(" ").to_lowercase();
        assert!(!words.contains("remove it as root"), "{}", page.display());
    }
}

#[test]
fn every_block_of_every_document_has_a_rule() {
    let (mut wrong, mut without_run) = (Vec::new(), 0);
    let mut run = Vec::new();
    for (page, blocks) in pages() {
        for block in &blocks {
            let language = block.language.as_str();
            let elsewhere = ELSEWHERE
                .iter()
                .find(|one| (one.0, one.1) == (&*page, language));
            let no_run = block.rule.strip_prefix("no-run: ");
            let fits = match (language, block.rule.as_str()) {
                ("sh" | "console", _) if no_run.is_some() => {
                    without_run += 1;
                    no_run.is_some_and(|why| why.len() > 8)
                }
                ("sh", "" | "terminals") | ("console" | "ini", "") | ("toml", _) => {
                    run.push(page.clone());
                    true
                }
                ("text", "") => true,
                (_, rule) => match (rule.strip_prefix("of "), elsewhere) {
                    (Some(file), _) => is_part_of(block, file),
                    (None, Some((.., file, words))) => {
                        fs::read_to_string(root().join(file)).is_ok_and(|text| text.contains(words))
                    }
                    (None, None) => false,
                },
            };
            if !fits {
                wrong.push(format!(
                    "{page}:{}: `{language} {}`",
                    block.line - 1,
                    block.rule
                ));
            }
        }
    }
    assert!(wrong.is_empty(), "no rule holds for {wrong:#?}");
    run.dedup();
    assert_eq!(run, PAGES, "each has a test here");
    // Installing, building, and what needs the robot. More of them is a decision.
    assert_eq!(without_run, WITHOUT_RUN);
}

/// Blocks that cannot be run in a test.
const WITHOUT_RUN: usize = 49;

/// The robot's configuration: a machine that stalls ends no flight, and nothing is missing that a preflight asks for.
const BRIDGE: &str = "\
[serial]
baud_rate = 115200
[link]
pc_timeout_ms = 60000
ack_timeout_ms = 5000
silent_after_ms = 20000
[movement]
begin_within_ms = 60000
[safety]
battery_v = { refuse = 22.0 }
fuel_percent = { refuse = 5 }
[[fence.area]]
name = \"field\"
kind = \"inclusion\"
polygon = [[37.40, -6.01], [37.42, -6.01], [37.42, -5.99], [37.40, -5.99]]
";

/// The logs of the robot.
const STATUS: &str = "[[log]]\ngroups = [\"time\", \"geographic\", \"supply\", \"gps_velocity\"]\n";

/// A take-off, two waypoints and a landing.
const PLAN: &str = "\
QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t37.411\t-6.001\t10\t1
1\t0\t3\t22\t0\t0\t0\t0\t37.411\t-6.001\t10\t1
2\t0\t3\t16\t0\t0\t0\t0\t37.4112\t-6.001\t15\t1
3\t0\t3\t16\t0\t0\t0\t0\t37.4112\t-6.0008\t15\t1
4\t0\t3\t21\t0\t0\t0\t0\t37.4112\t-6.0008\t0\t1
";

/// A geofence with something in the way of the plan's second leg.
const MAST: &str = "\
[[fence.area]]
name = \"mast\"
kind = \"exclusion\"
centre = [37.4112, -6.0009]
radius_m = 5.0
";

const ROUTE: &str = "<gpx version=\"1.1\"><rte><rtept lat=\"37.4112\" lon=\"-6.001\"/></rte></gpx>";

/// `ril` as a reader has it, but that the simulated clock is ten times as fast.
const WRAPPER: &str = "\
#!/bin/sh
case \"$1 $2\" in
\"run sim\") exec RIL \"$@\" --speed 10 --seed 1 ;;
*) exec RIL \"$@\" ;;
esac
";

/// The topic that docs/reference.md looks at.
#[allow(unsafe_code)]
mod module {
    ipc_types::shared_struct! {
        /// Voltages of the flight battery.
        pub struct Voltages("battery_watch.Voltages.v1") = 64 {
            /// Counts the samples of this publisher from 1.
            pub sequence: u64,
            /// When the publisher began, host monotonic ns.
            pub epoch_ns: u64,
            /// Of the cells, from the negative pole, under load [V].
            pub cells: [f32; 12],
        }
    }
    ipc_types::topic!(Voltages, "battery_watch/cell_voltages");
}

/// Publishes it 50 times a second, until what it returns is dropped.
fn publish_voltages(domain: &Domain) -> (mpsc::Sender<()>, JoinHandle<()>) {
    let topic = StandInTopic::<module::Voltages>::start(domain);
    let (end, is_over) = mpsc::channel();
    let thread = thread::spawn(move || {
        while is_over.recv_timeout(Duration::from_millis(20)) == Err(RecvTimeoutError::Timeout) {
            topic.publish(&module::Voltages::default());
        }
    });
    (end, thread)
}

/// Someone who does what a page says, line by line.
struct Reader {
    page: &'static str,
    /// What runs on: the section that started it, unless it is to the page's end, and the process.
    terminals: Vec<(Option<String>, Process)>,
    rig: Sandbox,
    /// The domain of a second machine: the ground station, or where a recording is played.
    elsewhere: TestDomain,
}

impl Reader {
    fn new(page: &'static str) -> Reader {
        let rig = sandbox();
        for (name, text) in [
            ("bridge.toml", BRIDGE),
            ("status.toml", STATUS),
            ("survey.waypoints", PLAN),
            ("route.gpx", ROUTE),
            ("rules.toml", MAST),
            (
                "wrong.toml",
                "[serial]\nbaud_rate = 115200\nbaud_rat = 9600\n",
            ),
        ] {
            rig.write(name, text);
        }
        let endpoint = free_endpoint();
        let relay =
            format!("[robot]\nlisten = [{endpoint:?}]\n[station]\nconnect = [{endpoint:?}]\n");
        rig.write("relay.toml", &relay);
        fs::copy(root().join("examples/msg/Pack.msg"), rig.path("Pack.msg")).expect("a file");
        let bin = rig.path("bin");
        fs::create_dir(&bin).expect("a folder");
        let ril = bin.join("ril");
        fs::write(&ril, WRAPPER.replace("RIL", env!("CARGO_BIN_EXE_ril"))).expect("a file");
        fs::set_permissions(&ril, fs::Permissions::from_mode(0o755)).expect("a program");
        let reader = Reader {
            page,
            terminals: Vec::new(),
            rig,
            elsewhere: TestDomain::new(),
        };
        reader.succeeds(0, "ril plan show survey.waypoints --to survey.plan");
        symlink("survey.plan", reader.rig.path("field.plan")).expect("a link");
        reader
    }

    /// A line with the names of this test's own folder and domains in it.
    fn here(&self, line: &str) -> String {
        let elsewhere = self.elsewhere.root().display().to_string();
        let folder = self.rig.folder().display().to_string();
        let oldest = || {
            let files = fs::read_dir(self.rig.path("log")).expect("records");
            let paths = files.map(|file| file.expect("a file").path().display().to_string());
            let records = paths.filter(|path| path.ends_with("Z.mcap"));
            format!("'{}'", records.min().expect("a record"))
        };
        let mut line = line
            .replace("/tmp/", &format!("{folder}/"))
            .replace("/dev/hero-dsp-2", &format!("{folder}/dsp-2"))
            .replace("/dev/shm/ground", &elsewhere)
            .replace("/dev/shm/hr1000", &elsewhere)
            .replace("battery<22.5V", "battery<26V");
        if line.contains(" FILE") {
            line = line.replace(" FILE", &format!(" {}", oldest()));
        }
        if line.starts_with("ril replay ") && !line.contains(" --verify") {
            line = format!("RIL_IPC_ROOT={elsewhere} {line}");
        }
        line
    }

    /// A shell that runs `text` where and with what variables the last one ended.
    fn shell(&self, text: &str) -> Process {
        let path = std::env::var_os("PATH").unwrap_or_default();
        let folders = [self.rig.path("bin")]
            .into_iter()
            .chain(std::env::split_paths(&path));
        let mut command = Command::new("bash");
        let text = format!("[ ! -e ~/.now ] || . ~/.now\n{text}");
        command
            .args(["-c", &text])
            .env("PATH", std::env::join_paths(folders).expect("folders"))
            .env("HOME", self.rig.folder());
        self.rig.spawn(command)
    }

    /// Runs a line to its end, and keeps folder and variables for the next one.
    fn run(&self, text: &str) -> Finished {
        let keep = "{ export -p; echo \"cd '$PWD'\"; } > ~/.now";
        self.shell(&format!("{text}\ncode=$?; {keep}; exit $code"))
            .wait_exit()
    }

    fn succeeds(&self, line: usize, text: &str) {
        let finished = self.run(text);
        assert_eq!(
            finished.code(),
            Some(0),
            "{}:{line}: `{text}`: {finished:#?}",
            self.page
        );
    }

    /// Starts a command that runs on, and returns when it is at work.
    fn start(&mut self, line: usize, text: &str, section: Option<String>) {
        let mut process = self.shell(&format!("exec env {text}"));
        process.wait_for_line(|line| {
            let marks = ["ready", "recording", "is played"];
            marks.iter().any(|mark| line.text.contains(mark))
        });
        self.terminals.push((section, process));
        if text.contains("run status") && !text.contains("--robot")
            || text.contains("relay station")
        {
            self.succeeds(line, "ril wait --for up");
        }
    }

    /// Ends what a section has started, or all.
    fn end(&mut self, present: Option<&str>) {
        let is_over = |section: &Option<String>| match present {
            Some(present) => section.as_deref().is_some_and(|section| section != present),
            None => true,
        };
        let (over, kept) = std::mem::take(&mut self.terminals)
            .into_iter()
            .partition(|(section, _)| is_over(section));
        self.terminals = kept;
        let over: Vec<(Option<String>, Process)> = over;
        for (_, mut process) in over.into_iter().rev() {
            process.signal(Signal::INT);
            process.exits(0);
        }
    }

    /// Runs a line on a terminal, looks at what it shows, and types `q`.
    fn quits(&self, text: &str) {
        let words: Vec<&str> = text.split_whitespace().collect();
        let count = words.iter().take_while(|word| word.contains('=')).count();
        let variables = words[..count]
            .iter()
            .filter_map(|word| word.split_once('='));
        let variables: Vec<_> = variables.chain([("TERM", "xterm-256color")]).collect();
        assert_eq!(words[count], "ril", "{text}");
        let args = words[count + 1..].join(" ");
        let mut screen = Screen::start_with(&self.rig, &args, 80, 24, &variables);
        screen.until("a screen", |screen| !screen.trim().is_empty());
        screen.quits();
    }

    fn line(&mut self, number: usize, section: &str, text: &str) {
        let (command, comment) = text.split_once(" #").unwrap_or((text, ""));
        let command = self.here(command.trim());
        let needs_jq = command.contains("| jq ");
        if needs_jq && self.run("jq --version").code() != Some(0) {
            skip(&format!("{}:{number}", self.page), "there is no jq");
        } else if let Some(all) = command.strip_suffix('&') {
            for one in all.split(" & ") {
                self.start(number, one.trim(), Some(section.to_owned()));
            }
        } else if comment.contains("q ends it") {
            self.quits(&command);
        } else if comment.contains("Ctrl+C ends it") {
            let mut process = self.shell(&format!("exec env {command}"));
            process.wait_for_line(|_| true);
            process.signal(Signal::INT);
            process.exits(0);
        } else if !command.is_empty() {
            self.succeeds(number, &command);
        }
    }

    /// What has happened when a reader comes to a section: in the field, on another machine, to the page's folder.
    fn arrives(&mut self, section: &str) {
        match (self.page, section) {
            ("docs/operations.md", "Is the robot ready?") => {
                let limit = "[preflight]\nbattery_v = { warn = 30.0, fail = 29.0 }\n";
                self.rig.write("ril.toml", limit);
            }
            ("docs/operations.md", "Watch a robot") => {
                fs::remove_file(self.rig.path("ril.toml")).expect("it is there");
            }
            ("docs/operations.md", "After the flight") => {
                // Its last file is complete.
                let (_, mut recorder) = self.terminals.remove(0);
                recorder.signal(Signal::INT);
                recorder.exits(0);
            }
            ("docs/operations.md", "Two robots") => {
                let sim = format!(
                    "ril run sim --robot 2 --link {}",
                    self.rig.path("dsp-2").display()
                );
                self.start(0, &sim, Some(section.to_owned()));
            }
            _ => {}
        }
    }

    /// Does all that the page says.
    fn reads(mut self) {
        let pages = pages();
        let blocks = &pages[self.page];
        let starts_a_robot = |block: &Block| block.text.iter().any(|line| line.contains("run sim"));
        let needs_a_robot = |block: &&Block| ["sh", "console"].contains(&&*block.language);
        let first = blocks
            .iter()
            .filter(|block| !block.rule.starts_with("no-run"));
        if first.clone().any(|block| needs_a_robot(&block)) && !blocks.iter().any(starts_a_robot) {
            for line in [
                "run sim --link /tmp/dsp",
                "run bridge --port /tmp/dsp",
                "run status",
            ] {
                let line = self.here(&format!("ril {line}"));
                self.start(0, &line, None);
            }
        }
        let module = (self.page == "docs/reference.md").then(|| publish_voltages(&self.rig.domain));
        let mut section = "";
        for block in first {
            if block.section != section {
                section = &block.section;
                self.end(Some(section));
                self.arrives(section);
            }
            match (&*block.language, &*block.rule) {
                ("sh", "terminals") => {
                    for (number, line) in (block.line..).zip(&block.text) {
                        let command = line.split(" #").next().unwrap_or_default();
                        let command = self.here(command.trim());
                        self.start(number, &command, None);
                    }
                }
                ("sh", _) => {
                    for (number, line) in (block.line..).zip(&block.text) {
                        self.line(number, section, line);
                    }
                }
                ("console", _) => self.compare(block),
                ("toml", file) => self.takes(block, file),
                ("ini", _) => executes(block),
                _ => {}
            }
        }
        if let Some((end, thread)) = module {
            drop(end);
            thread.join().expect("it publishes");
        }
        self.end(None);
    }

    /// Runs each command of a block, and compares what it prints with what the page shows.
    fn compare(&self, block: &Block) {
        let text = block.text.join("\n");
        for part in text.split("$ ").skip(1) {
            let (command, shown) = part.split_once('\n').unwrap_or((part, ""));
            let finished = self.run(&self.here(command));
            let lines = match finished.stdout.is_empty() {
                true => &finished.stderr,
                false => &finished.stdout,
            };
            let printed: Vec<String> = lines.iter().map(|line| shape(line)).collect();
            let mut printed = printed.iter();
            let mut is_gap = false;
            for expected in shown.lines() {
                let expected = shape(expected);
                if expected == "…" {
                    is_gap = true;
                    continue;
                }
                let fits = |line: &&String| match expected.strip_suffix('…') {
                    Some(start) => line.starts_with(start),
                    None => **line == expected,
                };
                let found = match is_gap {
                    true => printed.find(fits),
                    false => printed.next().filter(fits),
                };
                assert!(
                    found.is_some(),
                    "{}:{}: `{expected}` of `{command}`: {finished:#?}",
                    self.page,
                    block.line
                );
                is_gap = false;
            }
            assert!(
                is_gap || printed.next().is_none(),
                "{}:{}: `{command}` prints more: {finished:#?}",
                self.page,
                block.line
            );
        }
    }

    /// The program whose configuration `file` is takes the block.
    fn takes(&self, block: &Block, file: &str) {
        let mut text = block.text.join("\n");
        let command = match file {
            "bridge.toml" => "run bridge",
            "mavlink.toml" => "run mavlink",
            "ril.toml" => "start",
            // Its table [tls] wants a build with TLS.
            "view.toml" if text.contains("[tls]") && !cfg!(feature = "tls") => return,
            "view.toml" => "run view",
            "relay.toml" if text.contains("[station]") => "relay station",
            "relay.toml" => "relay robot",
            "Cargo.toml" => {
                let table: toml::Table = text.parse().expect("TOML");
                let workspace =
                    fs::read_to_string(root().join("Cargo.toml")).expect("the workspace");
                let workspace: toml::Table = workspace.parse().expect("TOML");
                let own = &workspace["workspace"]["dependencies"];
                for list in ["dependencies", "dev-dependencies"] {
                    for (name, source) in table[list].as_table().expect("dependencies") {
                        assert!(
                            source.get("git").is_none() || own.get(name).is_some(),
                            "{name}"
                        );
                    }
                }
                return;
            }
            _ => panic!("{}:{}: nothing reads `{file}`", self.page, block.line),
        };
        if file == "relay.toml" {
            // The certificates that the page has made before, beside the file.
            if !self.rig.path("ca.pem").exists() {
                self.succeeds(block.line, "ril relay certify . robot-1=10.0.0.2 gcs");
            }
            if text.contains("[security]") && !text.contains("authority") {
                let own = "[security]\nauthority = \"ca.pem\"\ncertificate = \"robot-1.pem\"\nkey = \"robot-1-key.pem\"";
                text = text.replace("[security]", own);
            }
        }
        self.rig.write("shown.toml", &text);
        self.succeeds(
            block.line,
            &format!("ril {command} --check-config --config shown.toml"),
        );
    }
}

/// A line without what differs from run to run: numbers, and how many spaces there are.
fn shape(line: &str) -> String {
    let mut shape = String::new();
    let mut characters = line.trim().chars().peekable();
    while let Some(character) = characters.next() {
        let is_number = |c: &char| c.is_ascii_digit() || *c == '.';
        if character.is_ascii_digit() {
            while characters.next_if(is_number).is_some() {}
            shape.push('#');
        } else if !character.is_whitespace() {
            shape.push(character);
        } else if !shape.ends_with(' ') {
            shape.push(' ');
        }
    }
    shape
}

/// Every line is a section or a setting, and what is executed is a command line of `ril`.
fn executes(block: &Block) {
    for line in &block.text {
        let is_section = line.starts_with('[') && line.ends_with(']');
        assert!(is_section || line.contains('='), "{line}");
        let Some((_, words)) = line
            .split_once("/ril ")
            .filter(|_| line.starts_with("ExecStart="))
        else {
            continue;
        };
        let words = ["ril"].into_iter().chain(words.split_whitespace());
        if let Err(error) = Cli::read(words.map(OsString::from)) {
            panic!("{line}: {error}");
        }
    }
}

// A test for each page, so that they run beside each other.

#[test]
fn the_examples_of_the_readme_run() {
    Reader::new("README.md").reads();
}

#[test]
fn the_examples_of_the_page_about_installing_are_right() {
    Reader::new("docs/install.md").reads();
}

#[test]
fn the_examples_of_the_page_about_json_run() {
    Reader::new("docs/json.md").reads();
}

#[test]
fn the_examples_of_the_page_about_mavlink_are_right() {
    Reader::new("docs/mavlink.md").reads();
}

#[test]
fn the_examples_of_the_page_about_modules_run() {
    Reader::new("docs/modules.md").reads();
}

#[test]
fn the_examples_of_the_page_about_networks_run() {
    if has_relay("docs/network.md") {
        Reader::new("docs/network.md").reads();
    }
}

#[test]
fn the_examples_of_the_page_about_operations_run() {
    Reader::new("docs/operations.md").reads();
}

#[test]
fn the_examples_of_the_page_about_plans_run() {
    Reader::new("docs/plans.md").reads();
}

#[test]
fn the_examples_of_the_reference_run() {
    Reader::new("docs/reference.md").reads();
}

#[test]
fn the_examples_of_the_page_about_firmware_are_right() {
    Reader::new("docs/firmware.md").reads();
}

#[test]
fn the_examples_of_the_page_about_safety_are_right() {
    Reader::new("docs/safety.md").reads();
}

#[test]
fn the_examples_of_the_page_about_views_run() {
    Reader::new("docs/view.md").reads();
}
