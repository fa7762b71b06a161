//! [`layout`]: panels of Foxglove and Lichtblick for the topics of a robot, live and of a recording.

use ipc_types::RobotId;

/// The layout for robot 1.
const OF_ROBOT_1: &str = include_str!("layout.json");

/// A layout that Foxglove and Lichtblick import, JSON: map, 3D, plots, diagnostics and log.
pub fn layout(robot: RobotId) -> String {
    OF_ROBOT_1.replace("robot1", &format!("robot{robot}"))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use serde_json::Value;

    use super::*;
    use crate::viewer::ViewerMessage;

    /// The panels of a part of the screen.
    fn panels<'a>(part: &'a Value, found: &mut BTreeSet<&'a str>) {
        match part {
            Value::String(panel) => assert!(found.insert(panel), "{panel} twice"),
            part => {
                for half in ["first", "second"] {
                    panels(&part[half], found);
                }
            }
        }
    }

    #[test]
    fn every_panel_is_on_the_screen_once() {
        let layout: Value = serde_json::from_str(OF_ROBOT_1).expect("JSON");
        let configured = layout["configById"].as_object().expect("an object");
        let mut shown = BTreeSet::new();
        panels(&layout["layout"], &mut shown);
        assert!(shown.iter().eq(configured.keys()), "{shown:?}");
    }

    #[test]
    fn a_layout_names_the_topics_of_its_robot_alone() {
        let robot = RobotId::new(23).expect("a number of a robot");
        let text = layout(robot);
        assert!(!text.contains("robot1/"));
        for message in [ViewerMessage::ALL[0], ViewerMessage::Pose] {
            let topic = format!("\"{}\"", message.topic(robot));
            assert!(text.contains(&topic), "{topic}");
        }
    }
}
