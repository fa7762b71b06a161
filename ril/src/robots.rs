//! The robots of a user as `ril robots` shows them: a table for people, an object for programs. Pure.

use std::fmt;

use serde::Serialize;

/// Name of the JSON object's layout.
pub const SCHEMA: &str = "ril.Robot.v1";

/// A robot.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Robot {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Its number.
    pub robot: u32,
    /// Whether a process of it lives.
    pub live: bool,
    /// The live processes that provide its services, by name, such as `bridge`.
    pub processes: Vec<String>,
    /// Whether it is on another machine.
    pub relayed: bool,
    /// State of the link to its DSP; `None` if that is not known.
    pub link: Option<String>,
    /// What its module does: status and functionality; `None` if that is not known.
    pub phase: Option<String>,
    /// Whether it flies; `None` if no telemetry of the present came.
    pub flying: Option<bool>,
    /// How old its state is, ms; `None` if none came.
    pub age_ms: Option<u64>,
}

/// Robots as a table.
pub struct Table<'a>(pub &'a [Robot]);

impl fmt::Display for Table<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:<6} {:<5} {:<10} {:<8} {:<22} PROCESSES",
            "ROBOT", "LIVE", "LINK", "FLYING", "PHASE"
        )?;
        for robot in self.0 {
            let or_dash = |text: &Option<String>| text.clone().unwrap_or_else(|| "-".to_owned());
            let live = if robot.live { "yes" } else { "no" };
            let flying = match robot.flying {
                Some(true) => "yes",
                Some(false) => "no",
                None => "-",
            };
            let mut processes = robot.processes.join(", ");
            if processes.is_empty() {
                processes = "-".to_owned();
            }
            writeln!(
                f,
                "{:<6} {live:<5} {:<10} {flying:<8} {:<22} {processes}",
                robot.robot,
                or_dash(&robot.link),
                or_dash(&robot.phase),
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_robot_is_a_line_that_fits_the_terminal() {
        let live = Robot {
            schema: SCHEMA,
            robot: 1,
            live: true,
            processes: vec!["bridge".to_owned(), "status".to_owned()],
            relayed: false,
            link: Some("up".to_owned()),
            phase: Some("running, taking-off".to_owned()),
            flying: Some(true),
            age_ms: Some(100),
        };
        let dead = Robot {
            robot: 12,
            live: false,
            processes: Vec::new(),
            link: None,
            phase: None,
            flying: None,
            age_ms: None,
            ..live.clone()
        };
        let text = Table(&[live, dead]).to_string();
        let expected = "\
ROBOT  LIVE  LINK       FLYING   PHASE                  PROCESSES
1      yes   up         yes      running, taking-off    bridge, status
12     no    -          -        -                      -
";
        assert_eq!(text, expected);
        assert!(text.lines().all(|line| line.len() <= 80));
    }
}
