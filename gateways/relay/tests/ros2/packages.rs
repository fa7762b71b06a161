//! `ril-relay ros2-packages`.

use std::fs;
use std::path::Path;

use ril_tests::{Process, StandInTopic, TestDomain};

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

fn write(domain: &TestDomain, folder: &Path) -> Vec<String> {
    let folder = folder.to_str().expect("a path");
    let program = env!("CARGO_BIN_EXE_ril-relay");
    let mut process = Process::start(domain, program, ["ros2-packages", "--robot", "1", folder]);
    let finished = process.exits(0);
    finished.stdout
}

#[test]
fn without_a_robot_the_packages_of_its_own_messages_are_written() {
    let domain = TestDomain::new();
    let folder = tempfile::tempdir().expect("a folder");
    let printed = write(&domain, &folder.path().join("src"));
    let hero = folder.path().join("src/hero_msgs");
    assert!(printed[0].starts_with(&format!("{} (", hero.display())));
    let text = fs::read_to_string(hero.join("msg/HeroTelemetry.msg")).expect("a definition");
    assert!(text.contains("uint64 published_ns"));
    assert!(hero.join("package.xml").is_file() && hero.join("CMakeLists.txt").is_file());
    assert!(
        folder
            .path()
            .join("src/module_msgs/msg/State.msg")
            .is_file()
    );
}

#[test]
fn beside_a_robot_the_messages_of_its_modules_topics_are_written_too() {
    let domain = TestDomain::new();
    let charges = StandInTopic::<Charge>::start(&domain);
    charges.publish(&Charge::default());
    let folder = tempfile::tempdir().expect("a folder");
    let printed = write(&domain, folder.path());
    let package = folder.path().join("battery_watch_msgs");
    let line = format!("{} (1 .msg)", package.display());
    assert!(printed.contains(&line), "{printed:?}");
    let text = fs::read_to_string(package.join("msg/Charge.msg")).expect("a definition");
    assert!(text.contains("float64 charge"));
}
