//! What `ril demo --robots` prints in the end: in lines for people, or as one JSON object.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::Path;
use std::time::Duration;

use runtime::exit::Failure;
use runtime::finding::Finding;
use serde::Serialize;

use super::super::screen::{CheckObject, HEADING};
use super::cost::Share;
use crate::render::finding::lines;
use crate::render::json_line;

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
        let mut out = io::stdout().lock();
        if json {
            return json_line(&mut out, &self.object(kept));
        }
        out.write_all(self.text(kept).as_bytes())
            .map_err(Failure::output)
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
            for check in failed {
                text += &lines(check, check.id, HEADING, usize::MAX);
            }
        }
        text += "\n";
        for check in &self.checks {
            text += &lines(check, check.id, HEADING, usize::MAX);
        }
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
        text += &match kept {
            Some(folder) => format!("folder    {}\n", folder.display()),
            None => "folder    removed; --folder FOLDER keeps it\n".to_owned(),
        };
        text += match self.failed() {
            0 => "all checks passed\n",
            _ => "not all checks passed\n",
        };
        text
    }
}
