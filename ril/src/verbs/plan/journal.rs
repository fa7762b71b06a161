//! What of a plan has been flown, and with which command it goes on. Pure values.

use dsp_protocol::Waypoint;
use plans::flight::Step;
use serde::Serialize;

use super::options::PlanFlyArgs;
use crate::render::words::shell_word;

/// What happens in a flight, for programs.
#[derive(Debug, PartialEq, Serialize)]
pub struct StepEvent {
    schema: &'static str,
    event: &'static str,
    step: usize,
    steps: usize,
    action: &'static str,
    item: Option<u32>,
    waypoints_reached: Option<u32>,
    waypoints_total: Option<u32>,
}

/// How far the flight is.
pub struct FlownSteps {
    steps: Vec<Step>,
    /// The step under way, from 0; as many as there are steps at the end.
    step: usize,
    /// Waypoints of the path under way that were reached.
    reached: usize,
    /// The item that the operator asked to begin with.
    from: u32,
}

impl FlownSteps {
    /// Nothing has been flown.
    pub fn new(steps: Vec<Step>, from: u32) -> FlownSteps {
        FlownSteps {
            steps,
            step: 0,
            reached: 0,
            from,
        }
    }

    /// The step under way; `None` at the end.
    pub fn step(&self) -> Option<&Step> {
        self.steps.get(self.step)
    }

    /// The step under way has been done.
    pub fn step_done(&mut self) {
        self.step += 1;
        self.reached = 0;
    }

    /// So many waypoints of the path under way were reached. Gives the items that are new.
    pub fn reached(&mut self, count: usize) -> Vec<u32> {
        let Some(Step::Path(points)) = self.steps.get(self.step) else {
            return Vec::new();
        };
        let before = self.reached;
        self.reached = count.clamp(before, points.len().max(before));
        let new = points.get(before..self.reached).unwrap_or_default();
        new.iter().map(|point| point.item).collect()
    }

    /// The first item that has not been done; `None` if all have.
    pub fn next_item(&self) -> Option<u32> {
        let points_left = match self.step()? {
            Step::Path(points) => points.get(self.reached).map(|point| point.item),
            step => item_of(step),
        };
        let later = || self.steps[self.step + 1..].iter().find_map(item_of);
        points_left.or_else(later).map(|item| item.max(self.from))
    }

    /// Whether the helicopter still has to take off, or is taking off, for the step under way.
    fn take_off_m(&self) -> Option<f64> {
        match self.step()? {
            Step::TakeOff {
                item: None,
                height_m,
            } => Some(*height_m),
            _ => None,
        }
    }

    /// The command that flies the rest; `None` if there is none.
    pub fn resume(&self, args: &PlanFlyArgs, home: &Waypoint) -> Option<String> {
        let item = self.next_item()?;
        let plan = &args.plan;
        let robot = args.ask.common.robot();
        let mut words = vec![
            "ril plan fly".to_owned(),
            shell_word(&plan.file.to_string_lossy()),
        ];
        let mut add = |option: &str, value: String| words.push(format!("{option} {value}"));
        add("--from", item.to_string());
        // In the air the point of take-off is no longer known, and heights are above it.
        add(
            "--home",
            format!(
                "{:.7},{:.7},{:.2}",
                home.latitude_deg, home.longitude_deg, home.altitude_m
            ),
        );
        if let Some(height_m) = self.take_off_m() {
            add("--takeoff", format!("{height_m}m"));
        }
        if let Some(name) = plan.altitude_is {
            add("--altitude-is", name.name().to_owned());
        }
        if let Some(plans::model::Altitude::AboveTakeOff(metres)) = plan.altitude {
            add("--altitude", format!("{metres}m"));
        }
        if let Some(bridge) = &plan.bridge {
            add("--bridge", shell_word(&bridge.to_string_lossy()));
        }
        if let Some(config) = &args.ask.common.settings.config {
            add("--config", shell_word(&config.to_string_lossy()));
        }
        if robot.get() != 1 {
            add("--robot", robot.to_string());
        }
        Some(words.join(" "))
    }

    /// The event `event` of the step under way, for programs.
    pub fn event(&self, event: &'static str) -> StepEvent {
        let step = self.step();
        let total = match step {
            Some(Step::Path(points)) => Some(points.len() as u32),
            _ => None,
        };
        StepEvent {
            schema: "ril.PlanProgress.v1",
            event,
            step: (self.step + 1).min(self.steps.len()),
            steps: self.steps.len(),
            action: step.map_or("end", action),
            item: self.next_item(),
            waypoints_reached: total.map(|_| self.reached as u32),
            waypoints_total: total,
        }
    }
}

/// The first item of a step.
fn item_of(step: &Step) -> Option<u32> {
    match step {
        Step::TakeOff { item, .. } => *item,
        Step::Path(points) => points.first().map(|point| point.item),
        Step::Wait { item, .. } | Step::Speed { item, .. } | Step::Land { item } => Some(*item),
    }
}

fn action(step: &Step) -> &'static str {
    match step {
        Step::TakeOff { .. } => "take-off",
        Step::Path(_) => "path",
        Step::Wait { .. } => "hover",
        Step::Speed { .. } => "speed",
        Step::Land { .. } => "land",
    }
}

#[cfg(test)]
mod tests {
    use std::ffi::OsString;

    use plans::flight::PathPoint;

    use super::super::options::PlanCommand;
    use super::*;
    use crate::cli::{Cli, Command};

    fn point(item: u32) -> PathPoint {
        PathPoint {
            item,
            waypoint: Waypoint::default(),
        }
    }

    fn steps() -> Vec<Step> {
        vec![
            Step::TakeOff {
                item: None,
                height_m: 12.5,
            },
            Step::Speed {
                item: 1,
                speed_mps: 3.0,
            },
            Step::Path(vec![point(2), point(3), point(5)]),
            Step::Wait {
                item: 5,
                duration_s: 9.0,
            },
            Step::Land { item: 6 },
        ]
    }

    #[test]
    fn the_next_item_is_the_first_that_was_not_done() {
        let mut journal = FlownSteps::new(steps(), 1);
        assert_eq!(journal.next_item(), Some(1));
        journal.step_done();
        journal.step_done();
        assert_eq!(journal.next_item(), Some(2));
        assert_eq!(journal.reached(2), [2, 3]);
        assert_eq!(journal.next_item(), Some(5));
        assert_eq!(journal.reached(1), [0; 0], "never fewer");
        assert_eq!(journal.reached(99), [5]);
        assert_eq!(journal.next_item(), Some(5), "its hover was not done");
        journal.step_done();
        journal.step_done();
        assert_eq!(journal.next_item(), Some(6));
        journal.step_done();
        assert_eq!(journal.next_item(), None);
        assert_eq!(journal.event("done").action, "end");
    }

    fn arguments(line: &[&str]) -> PlanFlyArgs {
        let words = ["ril", "plan", "fly"]
            .iter()
            .chain(line)
            .map(OsString::from);
        match Cli::read(words).unwrap().command {
            Command::Plan(args) => match args.command {
                PlanCommand::Fly(args) => args,
                other => panic!("{other:?}"),
            },
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn the_command_that_goes_on_is_understood_and_says_the_same() {
        let args = arguments(&[
            "my plan.gpx",
            "--altitude-is",
            "sea",
            "--altitude",
            "30m",
            "--robot",
            "7",
        ]);
        let home = Waypoint {
            latitude_deg: -37.411,
            longitude_deg: -6.001,
            altitude_m: 10.25,
        };
        let mut journal = FlownSteps::new(steps(), 1);
        let command = journal.resume(&args, &home).unwrap();
        assert_eq!(
            command,
            "ril plan fly 'my plan.gpx' --from 1 --home -37.4110000,-6.0010000,10.25 --takeoff 12.5m --altitude-is sea --altitude 30m \
             --robot 7"
        );
        journal.step_done();
        journal.step_done();
        journal.reached(1);
        let command = journal.resume(&args, &home).unwrap();
        let words: Vec<&str> = command.split(' ').skip(5).collect();
        let again = arguments(&[&["my plan.gpx"], &words[..]].concat());
        assert_eq!(again.plan.from, 3);
        assert_eq!(again.plan.home.unwrap().altitude_m, Some(10.25));
        assert_eq!(
            (again.plan.altitude, again.plan.takeoff),
            (args.plan.altitude, None)
        );
    }
}
