//! What a flight is for programs, and with which command it goes on. Pure values.

use dsp_protocol::Waypoint;
use operator::render::words::shell_word;
use plans::executor::Executor;
use plans::flight::Step;
use serde::Serialize;

use super::options::PlanFlyArgs;

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

impl StepEvent {
    /// The event `event` of the step under way.
    pub fn of(executor: &Executor, event: &'static str) -> StepEvent {
        let (step, steps) = executor.step_number();
        let waypoints = executor.waypoints();
        StepEvent {
            schema: "ril.PlanProgress.v1",
            event,
            step,
            steps,
            action: executor.step().map_or("end", action),
            item: executor.next_item(),
            waypoints_reached: waypoints.map(|(reached, _)| reached as u32),
            waypoints_total: waypoints.map(|(_, total)| total as u32),
        }
    }
}

/// The command that flies the rest; `None` if there is none.
pub fn resume(executor: &Executor, args: &PlanFlyArgs, home: &Waypoint) -> Option<String> {
    let item = executor.next_item()?;
    let plan = &args.plan;
    let robot = args.ask.common.robot();
    let mut words = vec![
        "ril plan fly".to_owned(),
        shell_word(&plan.file.to_string_lossy()),
    ];
    let mut add = |option: &str, value: String| words.push(format!("{option} {value}"));
    add("--from", item.to_string());
    // In the air the point of take-off is not known, and heights are above it.
    add(
        "--home",
        format!(
            "{:.7},{:.7},{:.2}",
            home.latitude_deg, home.longitude_deg, home.altitude_m
        ),
    );
    // Whether the helicopter still has to take off, or is taking off.
    if let Some(Step::TakeOff {
        item: None,
        height_m,
    }) = executor.step()
    {
        add("--takeoff", format!("{height_m}m"));
    }
    if let Some(name) = plan.altitude_is {
        add("--altitude-is", name.name().to_owned());
    }
    if let Some(plans::model::Altitude::AboveTakeOff(metres)) = plan.altitude {
        add("--altitude", format!("{metres}m"));
    }
    if let Some(action) = args.sender.action() {
        add("--sender-lost", action.name().to_owned());
    }
    if let Some(lease_ms) = args.sender.lease {
        add("--lease", format!("{lease_ms}ms"));
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

    use ipc_types::MonotonicNs;
    use plans::flight::PathPoint;

    use super::super::options::PlanCommand;
    use super::*;
    use crate::cli::{Cli, Command};

    /// A take-off, and a path of the items 1, 3 and 5.
    fn executor() -> Executor {
        let point = |item| PathPoint {
            item,
            waypoint: Waypoint::default(),
        };
        let take_off = Step::TakeOff {
            item: None,
            height_m: 12.5,
        };
        let path = Step::Path([1, 3, 5].map(point).to_vec());
        Executor::new(vec![take_off, path], 1)
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
            "--sender-lost",
            "land",
            "--lease",
            "1.5s",
            "--robot",
            "7",
        ]);
        let home = Waypoint {
            latitude_deg: -37.411,
            longitude_deg: -6.001,
            altitude_m: 10.25,
        };
        let mut executor = executor();
        executor.begin();
        let command = resume(&executor, &args, &home).unwrap();
        assert_eq!(
            command,
            "ril plan fly 'my plan.gpx' --from 1 --home -37.4110000,-6.0010000,10.25 --takeoff 12.5m --altitude-is sea --altitude 30m \
             --sender-lost land --lease 1500ms --robot 7"
        );
        executor.poll(MonotonicNs(0));
        executor.step_done();
        executor.reached(1);
        assert_eq!(
            StepEvent::of(&executor, "reached").waypoints_reached,
            Some(1)
        );
        let command = resume(&executor, &args, &home).unwrap();
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
