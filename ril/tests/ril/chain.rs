//! The fixtures' robot of real processes, with the binary of this crate.

use crate::common::sandbox;

#[test]
fn the_chain_starts_bears_a_kill_of_each_and_ends_in_order() {
    let rig = sandbox();
    let mut robot = rig.start_robot(1, 1);
    robot.restart_bridge(&rig);
    robot.restart_status(&rig);
    rig.run("hz hero --count 3", 0);
    rig.run("hz gps", 3);
    robot.end();
}
