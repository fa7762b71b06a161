use super::*;

const STRANGER: &str = "\
# A battery.
# Layout: battery_watch.Battery.v1

# Counts.
uint64 sequence
# When.
#
# Since boot. [ns]
uint64 epoch_ns
analog_msgs/Channel[2] channels

================================================================================
MSG: analog_msgs/Channel
# Layout: analog.Channel.v1

uint64 level_adc
";

fn packages(schemas: &[Schema]) -> BTreeMap<String, String> {
    let mut files = BTreeMap::new();
    write_packages(schemas, &mut files).unwrap();
    files
}

#[test]
fn our_package_has_every_struct_of_ours_once() {
    let files = packages(&own_schemas());
    let paths: Vec<&str> = files.keys().map(String::as_str).collect();
    assert!(paths.contains(&"hero_msgs/msg/HeroTelemetry.msg"));
    assert!(paths.contains(&"hero_msgs/msg/HeroGeodetic.msg"));
    assert!(paths.contains(&"hero_msgs/msg/RequestReport.msg"));
    assert!(paths.contains(&"module_msgs/msg/State.msg"));
    let messages = paths
        .iter()
        .filter(|path| path.starts_with("hero_msgs/msg/"));
    let cmake = &files["hero_msgs/CMakeLists.txt"];
    for path in messages.clone() {
        let path = path.strip_prefix("hero_msgs/").expect("one package");
        assert!(cmake.contains(&format!("  \"{path}\"\n")), "{path}");
    }
    assert_eq!(cmake.matches(".msg\"").count(), messages.count());
    assert!(files["hero_msgs/package.xml"].contains("<name>hero_msgs</name>"));
}

#[test]
fn a_definition_has_comments_types_and_names() {
    let files = packages(&[Schema::parse(STRANGER).unwrap()]);
    let expected = "\
# A battery.
# Layout: battery_watch.Battery.v1

# Counts.
uint64 sequence
# When.
#
# Since boot. [ns]
uint64 epoch_ns
analog_msgs/Channel[2] channels
";
    assert_eq!(files["battery_watch_msgs/msg/Battery.msg"], expected);
}

#[test]
fn a_package_names_the_packages_whose_types_it_uses() {
    let files = packages(&[Schema::parse(STRANGER).unwrap()]);
    let xml = &files["battery_watch_msgs/package.xml"];
    assert!(xml.contains("  <depend>analog_msgs</depend>\n"));
    let cmake = &files["battery_watch_msgs/CMakeLists.txt"];
    assert!(cmake.contains("find_package(analog_msgs REQUIRED)\n"));
    assert!(cmake.contains("  DEPENDENCIES analog_msgs\n)\n"));
    assert!(files["analog_msgs/CMakeLists.txt"].contains("\"msg/Channel.msg\""));
    assert!(!files["analog_msgs/package.xml"].contains("<depend>"));
}

#[test]
fn two_versions_of_a_type_are_refused() {
    let one = Schema::parse(STRANGER).unwrap();
    let other = Schema::parse(&STRANGER.replace("level_adc", "level_mv")).unwrap();
    let mut files = BTreeMap::new();
    let error = write_packages([&one, &other], &mut files).unwrap_err();
    assert_eq!(error.type_name, "battery_watch_msgs/msg/Battery");
    assert!(files.is_empty());
}
