//! How strong the tests are: changes a room's code, one small place at a time, runs the room's tests, and prints which
//! changes (*mutants*) no test noticed.
//!
//! All mutants of a package are in one build, `if mutant(7) { a <= b } else { a < b }`, and a variable of the
//! environment chooses one: a mutant costs a run of the tests that come by it, not a build. What is built is a copy of
//! the repository beside the temporary files. What does not compile is left out, and so is what cannot be switched at
//! run time: constants, `const fn`, macros, patterns. `argued.txt` has the survivors that no test can catch, each with
//! the reason.

mod rules;

use std::collections::{BTreeMap, BTreeSet};
use std::env::{args, temp_dir, var_os};
use std::fs::{self, File, read_to_string};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use rules::Mutant;

/// The variable of the environment that chooses the mutant.
const VARIABLE: &str = "RIL_MUTANT";

/// The variable that names a file: there a test writes the mutants that it comes by.
const REACHED: &str = "RIL_REACHED";

/// What the library gets.
const SWITCH: &str = r#"
#[doc(hidden)]
pub fn ril_mutant(number: u32) -> bool {
    extern crate std;
    use std::{cell::RefCell, collections::BTreeSet, env::var, fs::File, io::Write, sync::OnceLock};
    static CHOSEN: OnceLock<(u32, Option<std::string::String>)> = OnceLock::new();
    std::thread_local!(static SEEN: RefCell<BTreeSet<u32>> = const { RefCell::new(BTreeSet::new()) });
    let (chosen, reached) = CHOSEN.get_or_init(|| {
        (var("RIL_MUTANT").ok().and_then(|it| it.parse().ok()).unwrap_or(0), var("RIL_REACHED").ok())
    });
    if let Some(path) = reached
        && SEEN.try_with(|seen| seen.borrow_mut().insert(number)).unwrap_or(false)
    {
        let line = std::format!("{number}\n");
        let file = File::options().append(true).create(true).open(path);
        file.and_then(|mut file| file.write_all(line.as_bytes())).expect("a file for what is reached");
    }
    *chosen == number
}
"#;

/// A program of tests, by mutant those of its tests that come by it, and those that take long: they come last.
struct Tests {
    program: PathBuf,
    reach: BTreeMap<usize, BTreeSet<String>>,
    slow: BTreeSet<String>,
}

/// A name; its package and the folder of that; files and folders below its `src`; the package's tests that judge it;
/// and those among these that take long and judge something else.
type Room = (
    &'static str,
    &'static str,
    &'static str,
    &'static [&'static str],
    &'static [&'static str],
    &'static [&'static str],
);

/// What only does I/O is in no room: tests with real processes judge it.
#[rustfmt::skip]
const ROOMS: &[Room] = &[
    ("flight", "bridge", "bridge", &["flight", "core.rs"], &["lib", "core"], &[]),
    ("link", "bridge", "bridge", &["link"], &["lib", "core"], &[]),
    ("safety", "bridge", "bridge", &["safety"], &["lib", "core"], &[]),
    ("dsp-protocol", "dsp-protocol", "crates/dsp-protocol", &["."], &["lib", "main"], &["firmware", "undetected"]),
    ("relay-orders", "relay", "gateways/relay", &["orders"], &["lib"], &[]),
    ("mavlink", "mavlink-gateway", "gateways/mavlink", &["decide", "mission"], &["lib", "main"], &[]),
    ("status", "status", "status", &["core.rs", "translate.rs"], &["lib"], &[]),
    ("module-kit", "module-kit", "crates/module-kit", &["."], &["lib"], &[]),
    ("ipc-types", "ipc-types", "ipc-types", &["sequence.rs", "doorbell.rs", "wake.rs", "robot_folder.rs", "generation.rs",
        "publisher.rs", "disk.rs"], &["lib", "ports"], &[]),
];

fn main() -> ExitCode {
    let (mut names, mut sample, mut seed, mut filter) = (vec![], usize::MAX, 1, String::new());
    let mut only = None;
    let mut words = args().skip(1);
    while let Some(word) = words.next() {
        let value = words.next().expect("each option has a value");
        match word.as_str() {
            "--room" => names.push(value),
            "--sample" => sample = value.parse().expect("so many mutants of each room"),
            "--seed" => seed = value.parse().expect("a number"),
            "--filter" => filter = value,
            "--only" => only = Some(read_to_string(value).expect("a file with a mutant on each line")),
            _ => panic!("--room NAME, --sample N, --seed N, --filter TEXT-IN-A-MUTANT, --only FILE"),
        }
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).expect("the repository");
    // A line that begins with a space is the reason of those above it.
    let argued = read_to_string(root.join("workbench/mutants/argued.txt")).expect("a file beside this program");
    let argued: BTreeSet<&str> = argued.lines().filter(|line| !line.starts_with([' ', '#'])).collect();
    let is_chosen = |room: &&Room| names.is_empty() || names.iter().any(|name| name == room.0);
    println!("| room | mutants | drawn | built | caught | argued | survived |\n|---|---|---|---|---|---|---|");
    let mut is_left = false;
    let packages: BTreeSet<_> = ROOMS.iter().filter(is_chosen).map(|room| room.1).collect();
    for package in packages {
        let rooms: Vec<&Room> = ROOMS.iter().filter(is_chosen).filter(|room| room.1 == package).collect();
        let copy = copy_of(root, rooms[0].2);
        let (mut mutants, mut totals) = (Vec::new(), Vec::new());
        for (index, room) in rooms.iter().enumerate() {
            let mut found = rules::mutants(&copy, &sources(&copy, room), index);
            found.retain(|mutant| mutant.key.contains(&filter));
            if let Some(only) = &only {
                found.retain(|mutant| only.lines().any(|line| line == mutant.key));
            }
            totals.push(found.len());
            eprintln!("{}: {} mutants", room.0, found.len());
            rules::shuffle(&mut found, seed);
            found.truncate(sample);
            mutants.append(&mut found);
        }
        let mut tests = build(root, &copy, rooms[0], &mut mutants);
        for test in &mut tests {
            test.look(&copy, rooms[0]);
        }
        let whole = run(&tests, &copy, rooms[0], 0, Duration::from_secs(600)).expect("the tests pass without a mutant");
        let mut tallies = BTreeMap::<usize, [usize; 5]>::new();
        for (index, mutant) in mutants.iter().enumerate() {
            let result = match mutant.is_built {
                false => 0,
                true if run(&tests, &copy, rooms[0], index + 1, 2 * whole + Duration::from_secs(10)).is_none() => 2,
                true if argued.contains(mutant.key.as_str()) => 3,
                true => {
                    let is_reached = tests.iter().any(|test| test.reach.contains_key(&(index + 1)));
                    let how = if is_reached { "survived" } else { "reached by no test" };
                    eprintln!("{how}, line {}: {}", mutant.line, mutant.key);
                    4
                }
            };
            eprint!("{}", ["-", "", ".", "a", ""][result]);
            let tally = tallies.entry(mutant.room).or_default();
            tally[0] += 1;
            tally[1] += usize::from(mutant.is_built);
            tally[result] += usize::from(mutant.is_built);
        }
        for (index, [drawn, built, caught, argued, survived]) in tallies {
            println!(
                "| {} | {} | {drawn} | {built} | {caught} | {argued} | {survived} |",
                rooms[index].0, totals[index]
            );
            is_left |= survived > 0;
        }
    }
    ExitCode::from(u8::from(is_left))
}

/// A copy of the working tree. Its files keep their times, so cargo takes what it has built of the other packages; that
/// with the mutants has another version, and so artifacts of its own.
fn copy_of(root: &Path, package: &str) -> PathBuf {
    let name = root.file_name().expect("the repository has a name").to_string_lossy();
    let copy = temp_dir().join(format!("mutants-of-{name}"));
    let mut git = Command::new("git");
    let list = git.args(["ls-files", "-co", "--exclude-standard"]).current_dir(root).output().expect("git");
    for file in String::from_utf8(list.stdout).expect("names are UTF-8").lines() {
        let (from, to) = (root.join(file), copy.join(file));
        let Ok(mut bytes) = fs::read(&from) else { continue };
        if Path::new(file) == Path::new(package).join("Cargo.toml") {
            let text = String::from_utf8(bytes).expect("TOML is UTF-8");
            bytes = text.replacen("version.workspace = true", "version = \"0.1.0+mutants\"", 1).into_bytes();
        }
        fs::create_dir_all(to.parent().expect("a folder")).expect("the copy's folder");
        fs::write(&to, bytes).expect("a file of the copy");
        let time = fs::metadata(&from).and_then(|file| file.modified()).expect("a time");
        File::options().write(true).open(&to).and_then(|file| file.set_modified(time)).expect("a time");
    }
    copy
}

fn sources(copy: &Path, room: &Room) -> Vec<PathBuf> {
    let mut waiting: Vec<_> = room.3.iter().map(|name| copy.join(room.2).join("src").join(name)).collect();
    let mut found = Vec::new();
    while let Some(path) = waiting.pop() {
        match fs::read_dir(&path) {
            Ok(entries) => waiting.extend(entries.map(|entry| entry.expect("an entry").path())),
            Err(_) if path.extension().is_some_and(|extension| extension == "rs") => found.push(path),
            Err(_) => {}
        }
    }
    found.sort();
    found
}

/// Builds the tests with all mutants, and leaves out what does not compile until the rest does.
fn build(root: &Path, copy: &Path, room: &Room, mutants: &mut [Mutant]) -> Vec<Tests> {
    let library = copy.join(room.2).join("src/lib.rs");
    loop {
        let files: BTreeSet<PathBuf> =
            mutants.iter().map(|mutant| mutant.file.clone()).chain([library.clone()]).collect();
        for file in files {
            let original = root.join(file.strip_prefix(copy).expect("a file of the copy"));
            let mut text = rules::planted(&read_to_string(original).expect("a source"), &file, mutants);
            if file == library {
                text += SWITCH;
            }
            fs::write(&file, text).expect("a file of the copy");
        }
        let mut cargo = Command::new("cargo");
        cargo.args(["test", "--no-run", "--message-format=json", "--quiet", "-p", room.1]);
        for test in room.4 {
            if *test == "lib" {
                cargo.arg("--lib")
            } else {
                cargo.args(["--test", test])
            };
        }
        let target = var_os("CARGO_TARGET_DIR").map_or(root.join("target"), PathBuf::from);
        let output = cargo.current_dir(copy).env("CARGO_TARGET_DIR", target).output().expect("cargo");
        let output_text = String::from_utf8_lossy(&output.stdout);
        let messages: Vec<serde_json::Value> =
            output_text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
        if output.status.success() {
            let tests = messages.iter().filter(|message| message["profile"]["test"] == true);
            let programs = tests.filter_map(|test| Some(test["executable"].as_str()?.into()));
            return programs.map(|program| Tests { program, reach: BTreeMap::new(), slow: BTreeSet::new() }).collect();
        }
        let mut removed = 0;
        for error in messages.iter().map(|it| &it["message"]).filter(|it| it["level"] == "error") {
            for span in error["spans"].as_array().into_iter().flatten() {
                let (file, at) = (span["file_name"].as_str(), span["byte_start"].as_u64());
                removed += rules::remove(&copy.join(file.unwrap_or("")), at.unwrap_or(0) as usize, mutants);
            }
        }
        let errors = messages.iter().map(|it| &it["message"]).filter(|it| it["level"] == "error");
        let errors: String = errors.filter_map(|error| error["rendered"].as_str()).collect();
        assert!(removed > 0, "no mutant explains this: {errors}{}", String::from_utf8_lossy(&output.stderr));
    }
}

fn command(program: &Path, copy: &Path, room: &Room) -> Command {
    let mut command = Command::new(program);
    // As cargo does.
    command.current_dir(copy.join(room.2)).env("CARGO_MANIFEST_DIR", copy.join(room.2)).env("RUST_BACKTRACE", "0");
    command.env("PROPTEST_CASES", "64").env("PROPTEST_MAX_SHRINK_ITERS", "0");
    command.env("PROPTEST_DISABLE_FAILURE_PERSISTENCE", "1");
    command.arg("-Zunstable-options").env("RUSTC_BOOTSTRAP", "1");
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).process_group(0);
    command
}

impl Tests {
    /// Which tests come by which mutants, and which take more than a second: each runs by itself, because the threads
    /// and processes that a test starts do not have its name.
    fn look(&mut self, copy: &Path, room: &Room) {
        let file = copy.join("reached");
        let mut list = command(&self.program, copy, room);
        let list = list.args(["--list", "--format", "terse"]).stdout(Stdio::piped()).output().expect("a test");
        let list = String::from_utf8(list.stdout).expect("names are UTF-8");
        let names = list.lines().filter_map(|line| line.strip_suffix(": test"));
        for name in names.filter(|name| !room.5.iter().any(|skipped| name.contains(skipped))) {
            fs::write(&file, "").expect("a file of the copy");
            let start = Instant::now();
            let mut command = command(&self.program, copy, room);
            let status = command.args(["--exact", name]).env(REACHED, &file).status().expect("a test");
            assert!(status.success(), "{name} passes without a mutant");
            if start.elapsed() > Duration::from_secs(1) {
                self.slow.insert(name.to_owned());
            }
            for number in read_to_string(&file).expect("what is reached").lines() {
                self.reach.entry(number.parse().expect("a mutant")).or_default().insert(name.to_owned());
            }
        }
    }

    /// What a run for a mutant, or for none, is told: quick tests, or the slow ones. `None`: nothing to run.
    fn arguments(&self, mutant: usize, is_slow: bool, room: &Room) -> Option<Vec<String>> {
        if mutant == 0 {
            let skipped = room.5.iter().flat_map(|name| ["--skip".to_owned(), (*name).to_owned()]);
            return (!is_slow).then(|| skipped.collect());
        }
        let chosen = |name: &&String| self.slow.contains(*name) == is_slow;
        let names: Vec<String> = self.reach.get(&mutant)?.iter().filter(chosen).cloned().collect();
        let options = ["--fail-fast", "--exact"].map(str::to_owned);
        (!names.is_empty()).then(|| options.into_iter().chain(names).collect())
    }
}

/// Runs the tests that come by a mutant, or all for 0; how long they took, when all passed in time.
fn run(tests: &[Tests], copy: &Path, room: &Room, mutant: usize, limit: Duration) -> Option<Duration> {
    let start = Instant::now();
    for (is_slow, test) in [false, true].iter().flat_map(|slow| tests.iter().map(move |test| (*slow, test))) {
        let Some(arguments) = test.arguments(mutant, is_slow, room) else { continue };
        let mut command = command(&test.program, copy, room);
        let mut child = command.args(arguments).env(VARIABLE, mutant.to_string()).spawn().expect("a test");
        let is_ok = loop {
            match child.try_wait().expect("a child") {
                Some(status) => break status.success(),
                None if start.elapsed() > limit => break false,
                None => sleep(Duration::from_millis(10)),
            }
        };
        if !is_ok {
            // What the test started may live on when it failed or stands still.
            let _ = Command::new("kill").args(["-KILL", "--", &format!("-{}", child.id())]).output();
            let _ = child.wait();
            return None;
        }
    }
    Some(start.elapsed())
}
