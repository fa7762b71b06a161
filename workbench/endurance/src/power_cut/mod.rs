//! The power of the field computer is cut at any moment: what is on the disk then, and what do readers make of it?
//!
//! Real processes fly, record, keep and replace their files, and a `trace` has all that they do with them. A `disk`
//! that is a value performs it step by step, and after each step gives the states in which a power cut leaves it. Of
//! each state is judged:
//!
//! | file | what must hold |
//! |---|---|
//! | a record | it has every message that was forced onto the disk; a whole file can be made of it |
//! | a log of status | it has every row that was |
//! | one that is replaced as a whole: fence, timestamp of signatures, key of tokens, layout for viewers | it is the version that was forced onto the disk, or a later one |

pub mod disk;
pub mod trace;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

use recording::read::{check, messages, recover};
use ril_tests::Process;
use ril_tests::preload;

use self::disk::{Disk, State};
use self::trace::Step;
use crate::site::Site;
use measure::Outcome;

/// What the view and the gateway are told.
const VIEW: &str = "token_key = \"kept/view.key\"\n[tokens]\nphone = \"watch\"\n";
const MAVLINK: &str = "port = 0\nstations = []\nkey = \"mavlink.key\"\nstate = \"kept\"\n";

/// A log of all groups.
const STATUS: &str = "[[log]]\ndirectory = \"kept/log\"\nfile_name = \"sortable\"\nmin_free_mib = 0\n\
                      groups = [\"geographic\", \"gps_velocity\", \"attitude\"]\n";

/// A plan with a fence, flown on the spot.
const FENCED_PLAN: &str = r#"{"fileType":"Plan","version":1,"mission":{"version":2,"plannedHomePosition":[37.411,-6.001,10],"items":[
{"type":"SimpleItem","command":22,"frame":3,"autoContinue":true,"params":[0,0,0,null,0,0,5]},
{"type":"SimpleItem","command":21,"frame":3,"autoContinue":true,"params":[0,0,0,null,0,0,0]}]},
"geoFence":{"version":2,"circles":[],"polygons":[
{"inclusion":true,"version":1,"polygon":[[37.41,-6.003],[37.41,-5.999],[37.412,-5.999],[37.412,-6.003]]}]}}"#;

/// Of so many states of each kind, the operator's programs read one, too.
const BY_PROGRAMS: u32 = 50;

/// Tries as many states as planned, drawn by the seed, or all of them.
pub fn run(site: &Site) {
    let before = prepare(site);
    let steps = match fly(site) {
        Ok(steps) => steps,
        Err(why) => return site.skip(&why),
    };
    let kept = site.path("kept");
    let mut judge = Judge::new(site);
    // As many states are drawn of each group that there is; of a small one all are tried.
    let mut sizes = BTreeMap::new();
    walk(&before, &steps, |disk, index| {
        if let Some(group) = group(disk, index, &kept) {
            *sizes.entry(group).or_default() += disk.states(index).len();
        }
    });
    let count = site.plan.count.map(f64::from);
    let each = count.map(|count| count / sizes.len() as f64);
    let share = |size: usize| each.map_or(1.0, |each| each / size as f64);
    let of_kind = |kind| {
        let groups = sizes.iter().filter(|((other, _), _)| *other == kind);
        groups.map(|(_, size)| size).sum::<usize>()
    };
    let mut chance = site.chance(0);
    walk(&before, &steps, |disk, index| {
        let Some(group) = group(disk, index, &kept) else {
            return;
        };
        for state in disk.states(index) {
            if chance.f64() < share(sizes[&group]) && site.goes_on() {
                judge.look(disk, index, group.0, state);
            }
        }
    });
    site.show(judge.outcome(&of_kind, steps.len()));
}

/// What a file is, and whether it was forced onto the disk before; `None` if it is not judged.
fn group(disk: &Disk, index: usize, kept: &Path) -> Option<(Kind, bool)> {
    let path = disk.name(index).filter(|path| path.starts_with(kept))?;
    let extension = path.extension().and_then(|extension| extension.to_str());
    let kind = match (disk.is_replaced(&path), extension) {
        (true, _) => Kind::Replaced,
        (false, Some("mcap")) => Kind::Record,
        (false, Some("tsv")) => Kind::Log,
        // What a file is before it gets its name.
        _ => return None,
    };
    Some((kind, disk.file(index).syncs > 0))
}

/// Performs the steps, and looks at the file that each was about.
fn walk(before: &[(PathBuf, u64, Vec<u8>)], steps: &[Step], mut look: impl FnMut(&Disk, usize)) {
    let mut disk = Disk::with(before.iter().cloned());
    for step in steps {
        if let Some(index) = disk.perform(step) {
            look(&disk, index);
        }
    }
}

/// Makes the folder of all that is kept, and gives what is in it.
fn prepare(site: &Site) -> Vec<(PathBuf, u64, Vec<u8>)> {
    fs::create_dir_all(site.path("kept/log")).expect("a folder of this program");
    site.write("kept/bridge.toml", ril_tests::sandbox::FOR_SLOW_MACHINES);
    site.write("status.toml", STATUS);
    site.write("view.toml", VIEW);
    site.write("mavlink.toml", MAVLINK);
    site.write("fenced.plan", FENCED_PLAN);
    let key = site.write("mavlink.key", "correct horse battery staple\n");
    fs::set_permissions(key, fs::Permissions::from_mode(0o600)).expect("a file of this program");
    let path = site.path("kept/bridge.toml");
    let inode = fs::metadata(&path).expect("it was written").ino();
    let bytes = fs::read(&path).expect("it was written");
    vec![(path, inode, bytes)]
}

/// Flies, records and keeps, and gives what was done with files.
fn fly(site: &Site) -> Result<Vec<Step>, String> {
    let library = preload::build(site.folder(), preload::TRACE)?;
    let trace = site.write("trace", "");
    let traced = |args: &str| -> Process {
        let mut command = site.command(args.split_whitespace());
        command.env("LD_PRELOAD", &library);
        command
            .env("TRACE_FILE", &trace)
            .env("TRACE_FOLDER", site.path("kept"));
        site.spawn(command)
    };
    let ready = |args: &str| {
        let mut process = traced(args);
        process.wait_for_text("ready");
        process
    };
    let sim = site.sim(1, "--speed 5");
    let mut bridge = site.start_ready("run bridge --port dsp-1 --config kept/bridge.toml");
    bridge.wait_for_text("to=\"up\"");
    let status = ready("run status --config status.toml");
    site.run("echo hero --count 1", 0);
    // Long enough for two times at which the disk is forced, and a second file.
    let mut recorder = traced("record --min-free 0 --output kept --duration 10s --split 6s");
    for _ in 0..3 {
        ready("run mavlink --config mavlink.toml").end();
    }
    traced("view --config view.toml --invite phone").wait_exit();
    site.run("start", 0);
    traced("plan fly fenced.plan --fence --bridge kept/bridge.toml").exits(0);
    recorder.exits(0);
    for process in [status, bridge, sim] {
        process.end();
    }
    let bytes = fs::read(&trace).map_err(|error| error.to_string())?;
    match trace::read(&bytes)? {
        steps if steps.is_empty() => {
            Err("the programs of this machine cannot be traced".to_owned())
        }
        steps => Ok(steps),
    }
}

/// What a kind of file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
enum Kind {
    Record,
    Log,
    Replaced,
}

/// Judges states, and counts.
struct Judge<'a> {
    site: &'a Site,
    states: BTreeMap<Kind, u32>,
    replaced: BTreeSet<PathBuf>,
    by_programs: u32,
    forced_messages: usize,
    forced_rows: usize,
    /// What was forced of a record, by file and how often that was done.
    forced: BTreeMap<(usize, u64), Vec<u64>>,
    failures: Vec<String>,
}

impl<'a> Judge<'a> {
    fn new(site: &'a Site) -> Judge<'a> {
        Judge {
            site,
            states: BTreeMap::new(),
            replaced: BTreeSet::new(),
            by_programs: 0,
            forced_messages: 0,
            forced_rows: 0,
            forced: BTreeMap::new(),
            failures: Vec::new(),
        }
    }

    fn look(&mut self, disk: &Disk, index: usize, kind: Kind, state: State) {
        let Some(path) = disk.name(index) else {
            return;
        };
        let content = disk.content(&path, index, state);
        let file = disk.file(index);
        let result = match kind {
            Kind::Replaced => {
                self.replaced.insert(path.clone());
                disk.judge_replaced(&path, content.as_deref())
            }
            Kind::Record => {
                let forced = self.forced.entry((index, file.syncs));
                let forced = forced.or_insert_with(|| keys(&file.durable)).clone();
                self.forced_messages = self.forced_messages.max(forced.len());
                self.record(&forced, content)
            }
            Kind::Log => self.log(&file.durable, content),
        };
        *self.states.entry(kind).or_default() += 1;
        if let Err(why) = result {
            let path = path.display();
            self.failures.push(format!("{path} {state:?}: {why}"));
        }
    }

    fn is_for_programs(&mut self, kind: Kind) -> bool {
        let count = self.states.get(&kind).copied().unwrap_or(0);
        let is_due = count.is_multiple_of(BY_PROGRAMS);
        self.by_programs += u32::from(is_due);
        is_due
    }

    fn record(&mut self, forced: &[u64], content: Option<Vec<u8>>) -> Result<(), String> {
        let Some(bytes) = content else {
            return missing(forced.len(), "messages");
        };
        let found = keys(&bytes);
        if !found.starts_with(forced) {
            let (found, forced) = (found.len(), forced.len());
            return Err(format!(
                "{found} messages, and not the {forced} that were forced"
            ));
        }
        if found.is_empty() {
            return Ok(());
        }
        let mut whole = Vec::new();
        let recovered = recover(&bytes, &mut whole).map_err(|error| error.to_string())?;
        let checked = check(&whole);
        if recovered.messages as usize != found.len() || !checked.is_complete {
            let (recovered, found) = (recovered.messages, found.len());
            return Err(format!(
                "{recovered} of {found} recovered; {:?}",
                checked.errors
            ));
        }
        if self.is_for_programs(Kind::Record) {
            let name = self.site.path("cut.mcap");
            let whole = self.site.path("cut.recovered.mcap");
            fs::write(&name, &bytes).map_err(|error| error.to_string())?;
            let _ = fs::remove_file(&whole);
            self.program("log recover cut.mcap --json")?;
            // What was behind the cut may be missing without an event.
            let said = self.program("log check cut.recovered.mcap --json")?;
            if said["complete"] != true {
                return Err(format!("`ril log` has not recovered all: {said}"));
            }
        }
        Ok(())
    }

    fn log(&mut self, durable: &[u8], content: Option<Vec<u8>>) -> Result<(), String> {
        let is_end = |byte: &u8| *byte == b'\n';
        let ends = durable.iter().copied().filter(is_end).count();
        let rows = ends.saturating_sub(1);
        self.forced_rows = self.forced_rows.max(rows);
        let whole = durable.iter().rposition(is_end).map_or(0, |at| at + 1);
        let Some(bytes) = content else {
            return missing(rows, "rows");
        };
        if !bytes.starts_with(&durable[..whole]) {
            return Err(format!("not the {rows} rows that were forced"));
        }
        if rows > 0 && self.is_for_programs(Kind::Log) {
            let name = self.site.path("hero1_2026-01-01T00-00-00Z.tsv");
            fs::write(name, &bytes).map_err(|error| error.to_string())?;
            // Of a page that is not there, half a row is left in front of it or behind it: a damaged line.
            let said = self.program("log summary hero1_2026-01-01T00-00-00Z.tsv --json")?;
            let read = said["rows"].as_u64().unwrap_or(0) as usize;
            if read < rows {
                return Err(format!("`ril log` reads {read} of {rows} rows"));
            }
        }
        Ok(())
    }

    /// What the operator's program says about a file: that it is in order, or what is damaged in it.
    fn program(&self, args: &str) -> Result<serde_json::Value, String> {
        let finished = self.site.finish(args);
        let failed = || format!("`ril {args}`: {finished:?}");
        let (Some(0 | 8), Some(line)) = (finished.code(), finished.stdout.first()) else {
            return Err(failed());
        };
        serde_json::from_str(line).map_err(|_| failed())
    }

    fn outcome(self, there_are: &dyn Fn(Kind) -> usize, steps: usize) -> Outcome {
        let mut outcome = Outcome::default();
        outcome.cell("steps", steps);
        for (kind, tried, all) in [
            (Kind::Record, "of records", "there are of them"),
            (Kind::Log, "of logs", "there are of them"),
            (Kind::Replaced, "of replaced files", "there are of them"),
        ] {
            outcome.cell(tried, self.states.get(&kind).copied().unwrap_or(0));
            outcome.cell(all, there_are(kind));
        }
        outcome.cell("read by `ril log`", self.by_programs);
        outcome.cell("messages forced", self.forced_messages);
        outcome.cell("rows forced", self.forced_rows);
        outcome.cell("wrong", self.failures.len());
        let names = self.replaced.iter().filter_map(|path| path.file_name());
        let names: Vec<_> = names.map(|name| name.to_string_lossy()).collect();
        outcome.note(format!("replaced as a whole: {}", names.join(", ")));
        for failure in self.failures.iter().take(20) {
            outcome.require(false, failure);
        }
        outcome
    }
}

fn missing(forced: usize, what: &str) -> Result<(), String> {
    match forced {
        0 => Ok(()),
        _ => Err(format!(
            "no file, and {forced} {what} were forced onto the disk"
        )),
    }
}

/// A number for each message of a record.
fn keys(bytes: &[u8]) -> Vec<u64> {
    let keys = messages(bytes).flatten().map(|message| {
        let mut hash = DefaultHasher::new();
        (
            message.topic(),
            message.sequence,
            message.log_time_ns,
            message.data(),
        )
            .hash(&mut hash);
        hash.finish()
    });
    keys.collect()
}
