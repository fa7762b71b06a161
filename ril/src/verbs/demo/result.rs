//! What a demonstration prints in the end: in lines for people, or as one JSON object.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use operator::render::finding::lines;
use operator::render::print_as;
use runtime::exit::Failure;
use runtime::finding::Finding;
use runtime::usage::Usage;
use serde::Serialize;

use super::files::FlightFiles;

/// Width of the names of the checks, and a space.
const HEADING: usize = 34;

/// A demonstration of one robot.
pub(super) struct DemoResult {
    /// The checks.
    pub checks: Vec<Finding>,
    /// Median and 99th percentile of the age of the robot's telemetry at a consumer, ms.
    pub ages_ms: [Option<f64>; 2],
    /// From the first command to the end of the last.
    pub took: Duration,
    /// What it has left in its folder.
    pub files: FlightFiles,
}

/// The demonstration's result as JSON.
#[derive(Serialize)]
struct DemoObject<'a> {
    schema: &'static str,
    passed: bool,
    flight_s: f64,
    telemetry_age_ms_p50: Option<f64>,
    telemetry_age_ms_p99: Option<f64>,
    checks: Vec<CheckObject<'a>>,
    log: Option<&'a Path>,
    record: Option<&'a Path>,
    folder: Option<&'a Path>,
}

/// A check as JSON.
#[derive(Serialize)]
struct CheckObject<'a> {
    name: &'a str,
    passed: bool,
    detail: &'a str,
}

impl CheckObject<'_> {
    /// Of what was found.
    fn of(check: &Finding) -> CheckObject<'_> {
        CheckObject {
            name: check.id,
            passed: !check.has_failed(),
            detail: &check.text,
        }
    }
}

impl DemoResult {
    /// How many checks failed.
    pub fn failed(&self) -> usize {
        self.checks
            .iter()
            .filter(|check| check.has_failed())
            .count()
    }

    /// Prints it on standard output. `kept` is the folder that stays.
    pub fn print(&self, kept: Option<&Path>, json: bool) -> Result<(), Failure> {
        let (flight_s, [p50, p99]) = (self.took.as_secs_f64(), self.ages_ms);
        let [log, record] = [&self.files.log, &self.files.record]
            .map(|file| file.as_deref().filter(|_| kept.is_some()));
        let report = DemoObject {
            schema: "ril.Demo.v1",
            passed: self.failed() == 0,
            flight_s,
            telemetry_age_ms_p50: p50,
            telemetry_age_ms_p99: p99,
            checks: self.checks.iter().map(CheckObject::of).collect(),
            log,
            record,
            folder: kept,
        };
        let mut text = format!("\n{}\nflight    {flight_s:.1} s\n", in_lines(&self.checks));
        if let (Some(p50), Some(p99)) = (p50, p99) {
            text += &format!(
                "age       {p50:.3} ms median, {p99:.3} ms 99th percentile: serial byte to this consumer\n"
            );
        }
        text += &left("log", log);
        text += &left("record", record);
        text += verdict(self.failed());
        print_as(json, &report, text)
    }
}

/// A line for each check.
fn in_lines<'a>(checks: impl IntoIterator<Item = &'a Finding>) -> String {
    let checks = checks.into_iter();
    checks
        .map(|check| lines(check, check.id, HEADING, usize::MAX))
        .collect()
}

/// Where something is that was made, if it stays.
fn left(title: &str, path: Option<&Path>) -> String {
    match path {
        Some(path) => format!("{title:9} {}\n", path.display()),
        None => format!("{title:9} removed; --folder FOLDER keeps it\n"),
    }
}

fn verdict(failed: usize) -> &'static str {
    match failed {
        0 => "all checks passed\n",
        _ => "not all checks passed\n",
    }
}

/// What the processes of one kind cost on average.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share {
    /// Of one processor, percent.
    pub processor_percent: f64,
    /// Memory, MiB.
    pub memory_mib: f64,
}

impl Share {
    /// The sum.
    pub fn and(self, other: Share) -> Share {
        Share {
            processor_percent: self.processor_percent + other.processor_percent,
            memory_mib: self.memory_mib + other.memory_mib,
        }
    }
}

/// Processes, each with its kind and its number.
pub type Usages = BTreeMap<(&'static str, u32), Usage>;

/// The average of each kind between two looks. A process that is in one of them alone is left out.
pub fn shares(before: &Usages, after: &Usages) -> BTreeMap<&'static str, Share> {
    let mut shares: BTreeMap<&'static str, Vec<Share>> = BTreeMap::new();
    for (process, later) in after {
        if let Some(earlier) = before.get(process) {
            shares.entry(process.0).or_default().push(Share {
                processor_percent: later.since(earlier).all_percent,
                memory_mib: later.memory_mib,
            });
        }
    }
    let average = |of_kind: Vec<Share>| {
        let count = of_kind.len() as f64;
        let sum = of_kind.into_iter().reduce(Share::and)?;
        Some(Share {
            processor_percent: sum.processor_percent / count,
            memory_mib: sum.memory_mib / count,
        })
    };
    let shares = shares.into_iter();
    shares
        .filter_map(|(kind, of_kind)| Some((kind, average(of_kind)?)))
        .collect()
}

/// What became of a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fate {
    /// It flew the whole script.
    Flew,
    /// It was killed on its way, and stays away.
    Died,
    /// It was killed on its way, and another one took its place.
    Replaced,
    /// It took the place of another one, and flew the whole script.
    Replacement,
}

impl Fate {
    fn words(self) -> &'static str {
        match self {
            Fate::Flew => "flew",
            Fate::Died => "died on its way",
            Fate::Replaced => "died on its way and was replaced",
            Fate::Replacement => "took the place of the dead one",
        }
    }
}

/// What is judged of a robot.
pub struct RobotResult {
    /// Its number.
    pub number: u32,
    /// What became of it.
    pub fate: Fate,
    /// The checks.
    pub checks: Vec<Finding>,
}

/// What is judged of the fleet.
pub struct FleetResult {
    /// Of each robot.
    pub robots: Vec<RobotResult>,
    /// Of all together.
    pub checks: Vec<Finding>,
    /// What the processes of each kind cost on average.
    pub shares: BTreeMap<&'static str, Share>,
    /// What the station received of each robot on average.
    pub bytes_per_s: f64,
    /// From the start of the first process.
    pub took: Duration,
}

/// The result as JSON.
#[derive(Serialize)]
struct FleetObject<'a> {
    schema: &'static str,
    passed: bool,
    took_s: f64,
    robots: Vec<RobotObject<'a>>,
    checks: Vec<CheckObject<'a>>,
    costs: Vec<CostObject<'a>>,
    bytes_per_s: f64,
    folder: Option<&'a Path>,
}

#[derive(Serialize)]
struct RobotObject<'a> {
    robot: u32,
    fate: Fate,
    checks: Vec<CheckObject<'a>>,
}

#[derive(Serialize)]
struct CostObject<'a> {
    process: &'a str,
    processor_percent: f64,
    memory_mib: f64,
}

impl FleetResult {
    /// How many checks failed.
    pub fn failed(&self) -> usize {
        let of_robots = self.robots.iter().flat_map(|robot| &robot.checks);
        let all = of_robots.chain(&self.checks);
        all.filter(|check| check.has_failed()).count()
    }

    /// What the processes of one robot cost together, without the simulator, which no real robot has.
    fn robot_share(&self) -> Option<Share> {
        let kinds = self.shares.iter();
        let of_robot = kinds.filter(|(kind, _)| !["sim", "station"].contains(*kind));
        of_robot.map(|(_, share)| *share).reduce(Share::and)
    }

    /// Prints it on standard output. `kept` is the folder that stays.
    pub fn print(&self, kept: Option<&Path>, json: bool) -> Result<(), Failure> {
        print_as(json, &self.object(kept), self.text(kept))
    }

    fn object<'a>(&'a self, kept: Option<&'a Path>) -> FleetObject<'a> {
        let objects = |checks: &'a [Finding]| checks.iter().map(CheckObject::of).collect();
        let robots = self.robots.iter().map(|robot| RobotObject {
            robot: robot.number,
            fate: robot.fate,
            checks: objects(&robot.checks),
        });
        let costs = self.shares.iter().map(|(kind, share)| CostObject {
            process: kind,
            processor_percent: share.processor_percent,
            memory_mib: share.memory_mib,
        });
        FleetObject {
            schema: "ril.Fleet.v1",
            passed: self.failed() == 0,
            took_s: self.took.as_secs_f64(),
            robots: robots.collect(),
            checks: objects(&self.checks),
            costs: costs.collect(),
            bytes_per_s: self.bytes_per_s,
            folder: kept,
        }
    }

    fn text(&self, kept: Option<&Path>) -> String {
        let mut text = "\n".to_owned();
        for RobotResult {
            number,
            fate,
            checks,
        } in &self.robots
        {
            let failed: Vec<&Finding> = checks.iter().filter(|check| check.has_failed()).collect();
            let (mark, all) = (if failed.is_empty() { "ok" } else { "FAIL" }, checks.len());
            let passed = all - failed.len();
            let fate = fate.words();
            text +=
                &format!("{mark:<5} robot {number:<2} {fate}; {passed} of {all} checks passed\n");
            text += &in_lines(failed);
        }
        text += &format!("\n{}", in_lines(&self.checks));
        text += "\ncost on average          processor    memory\n";
        let row = |name: &str, share: &Share| {
            let (percent, mib) = (share.processor_percent, share.memory_mib);
            format!("{name:<22} {percent:>9.1} % {mib:>5.1} MiB\n")
        };
        for (kind, share) in &self.shares {
            text += &row(kind, share);
        }
        if let Some(share) = self.robot_share() {
            text += &row("a robot without sim", &share);
        }
        let kb_per_s = self.bytes_per_s / 1e3;
        text += &format!("a robot to the station {kb_per_s:>9.1} kB/s\n\n");
        text += &format!("took      {:.1} s\n", self.took.as_secs_f64());
        text += &left("folder", kept);
        text + verdict(self.failed())
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use runtime::usage::ThreadUsage;

    use super::*;

    #[test]
    fn a_kind_costs_the_average_of_those_that_lived_all_the_time() {
        let begin = Instant::now();
        let usage = |at_s, busy_s, memory_mib| {
            let thread = ThreadUsage {
                busy: Duration::from_secs(busy_s),
                wakes: 0,
            };
            Usage {
                at: begin + Duration::from_secs(at_s),
                threads: [(1, thread)].into(),
                memory_mib,
                files: 3,
            }
        };
        let before = Usages::from([
            (("bridge", 1), usage(0, 1, 1.0)),
            (("bridge", 2), usage(0, 1, 1.0)),
            (("bridge", 4), usage(0, 1, 1.0)),
        ]);
        let after = Usages::from([
            (("bridge", 1), usage(10, 2, 10.0)),
            (("bridge", 2), usage(10, 4, 20.0)),
            (("bridge", 3), usage(10, 100, 100.0)),
        ]);
        let expected = Share {
            processor_percent: 20.0,
            memory_mib: 15.0,
        };
        let shares = shares(&before, &after);
        assert_eq!(shares, BTreeMap::from([("bridge", expected)]));
        let twice = expected.and(expected);
        assert_eq!((twice.processor_percent, twice.memory_mib), (40.0, 30.0));
    }
}
