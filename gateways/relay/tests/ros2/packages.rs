//! `ril-relay ros2-packages`.

use std::fs;

use ril_tests::{Sandbox, StandInTopic};

ipc_types::shared_struct! {
    /// How charged the battery is.
    pub struct Charge("battery_watch.Charge.v1") = 24 {
        /// Counts the samples of this publisher from 1.
        pub sequence: u64,
        /// When the publisher began, host monotonic ns.
        pub epoch_ns: u64,
        /// Of the whole battery, 0 to 1.
        pub charge: f64,
    }
}
ipc_types::topic!(Charge, "battery_watch/charge");

/// The relay's program in a folder of its own.
fn machine() -> Sandbox {
    Sandbox::of(env!("CARGO_BIN_EXE_ril-relay"))
}

#[test]
fn without_a_robot_the_packages_of_its_own_messages_are_written() {
    let rig = machine();
    let printed = rig.run("ros2-packages --robot 1 src", 0).stdout;
    assert!(printed[0].starts_with("src/hero_msgs ("), "{printed:?}");
    let hero = rig.path("src/hero_msgs");
    let text = fs::read_to_string(hero.join("msg/HeroTelemetry.msg")).expect("a definition");
    assert!(text.contains("uint64 published_ns"));
    assert!(hero.join("package.xml").is_file() && hero.join("CMakeLists.txt").is_file());
    assert!(rig.path("src/module_msgs/msg/State.msg").is_file());
}

#[test]
fn beside_a_robot_the_messages_of_its_modules_topics_are_written_too() {
    let rig = machine();
    let charges = StandInTopic::<Charge>::start(&rig.domain);
    charges.publish(&Charge::default());
    let printed = rig.run("ros2-packages --robot 1 src", 0).stdout;
    let line = "src/battery_watch_msgs (1 .msg)".to_owned();
    assert!(printed.contains(&line), "{printed:?}");
    let definition = rig.path("src/battery_watch_msgs/msg/Charge.msg");
    let text = fs::read_to_string(definition).expect("a definition");
    assert!(text.contains("float64 charge"));
}
