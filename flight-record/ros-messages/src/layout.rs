//! [`layout`]: panels of Foxglove and Lichtblick for the topics of a robot, live and of a recording.

use ipc_types::RobotId;

/// The layout for robot 1.
const OF_ROBOT_1: &str = include_str!("layout.json");

/// A layout that Foxglove and Lichtblick import, JSON: map, 3D, plots, diagnostics, log, and services behind a tab.
pub fn layout(robot: RobotId) -> String {
    OF_ROBOT_1.replace("robot1", &format!("robot{robot}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::viewer::ViewerMessage;

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
