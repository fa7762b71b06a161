//! Packages of ROS 2 with our messages, such as `hero_msgs`: what a workspace of ROS 2 needs to build programs that use
//! them. `ril relay ros2-packages` writes them as files.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::{fs, io};

use ipc_types::dynamic::{self, ServiceFacts};
use ipc_types::module::State;
use ipc_types::payload::SharedStruct;
use ipc_types::schema::{Kind, Message};
use ipc_types::service::SERVICES;
use ipc_types::{Ipc, Schema};

use crate::config::TopicsConfig;

/// Two schemas describe a type differently.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("two schemas describe `{type_name}` differently: ROS 2 has one type of each name")]
pub struct ConflictingTypes {
    /// Name of the type, such as `hero_msgs/msg/HeroTelemetry`.
    pub type_name: String,
}

/// The schemas of the robot's own services: topics, requests and reports, and the state that every module has.
pub fn own_schemas() -> Vec<Schema> {
    let contracts = SERVICES.iter().map(|spec| spec.contract);
    let mut layouts: Vec<_> = contracts
        .flat_map(|contract| [Some(contract.payload), contract.report])
        .flatten()
        .chain([State::LAYOUT])
        .collect();
    layouts.sort_unstable_by_key(|layout| layout.type_name);
    layouts.dedup();
    layouts.into_iter().map(Schema::from_layout).collect()
}

/// Adds to `files` the packages with the types of `schemas` and all that they contain: `hero_msgs/package.xml`,
/// `hero_msgs/CMakeLists.txt`, `hero_msgs/msg/HeroTelemetry.msg` and so on, by path.
///
/// Paths consist of identifiers alone: a schema's names are in ASCII, without dots and slashes.
///
/// # Errors
///
/// [`ConflictingTypes`]; then `files` stays as it is.
pub fn add_packages<'a>(
    schemas: impl IntoIterator<Item = &'a Schema>,
    files: &mut BTreeMap<String, String>,
) -> Result<(), ConflictingTypes> {
    let mut packages = Packages::new();
    for schema in schemas {
        collect(schema.root(), &mut packages)?;
    }
    for (package, messages) in packages {
        for message in messages.values() {
            let path = format!("{package}/msg/{}.msg", message.name);
            files.insert(path, definition(message));
        }
        let needed = needed_packages(package, &messages);
        files.insert(
            format!("{package}/package.xml"),
            package_xml(package, &needed),
        );
        files.insert(
            format!("{package}/CMakeLists.txt"),
            cmake_lists(package, &messages, &needed),
        );
    }
    Ok(())
}

/// The packages cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// Two of the robot's own structs have one name.
    #[error(transparent)]
    Conflict(#[from] ConflictingTypes),
    /// A file or a folder cannot be written.
    #[error("{path} cannot be written")]
    File {
        /// Which.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

/// Writes the packages into `folder`: the robot's own messages, and those of the topics that are here now and that a
/// relay would carry. Says which packages there are, and how many messages each has.
///
/// # Errors
///
/// A file cannot be written. What was written before it stays.
pub fn write_packages(
    folder: &Path,
    ipc: &Ipc,
    config: &TopicsConfig,
) -> Result<BTreeMap<String, usize>, WriteError> {
    let topics = dynamic::topics(ipc).into_iter();
    let relayed = topics.filter(|facts| config.plan(&facts.key).is_some());
    let files = package_files(own_schemas(), relayed)?;
    let mut packages = BTreeMap::new();
    for (name, text) in files {
        // Names are `<package>/…` and `<package>/msg/…`.
        let (package, file) = name.split_once('/').unwrap_or((&name, ""));
        *packages.entry(package.to_owned()).or_default() += usize::from(file.ends_with(".msg"));
        let path = folder.join(&name);
        fs::create_dir_all(path.parent().unwrap_or(folder))
            .and_then(|()| fs::write(&path, text))
            .map_err(|source| WriteError::File { path, source })?;
    }
    Ok(packages)
}

/// The packages' files by path. A topic whose types are already there under the same names, and are others, is left
/// out.
fn package_files(
    mut schemas: Vec<Schema>,
    topics: impl Iterator<Item = ServiceFacts>,
) -> Result<BTreeMap<String, String>, ConflictingTypes> {
    let mut files = BTreeMap::new();
    add_packages(&schemas, &mut files)?;
    for ServiceFacts { key, schema, .. } in topics {
        schemas.push(schema);
        // All of them each time: a package's list of messages grows with every topic.
        if let Err(error) = add_packages(&schemas, &mut files) {
            tracing::warn!(key, %error, "a topic is left out");
            schemas.pop();
        }
    }
    Ok(files)
}

/// Packages by name, and in each the messages by name.
type Packages<'a> = BTreeMap<&'a str, Messages<'a>>;
type Messages<'a> = BTreeMap<&'a str, &'a Message>;

/// Adds `message` and all that it contains. A schema bounds the depth.
fn collect<'a>(message: &'a Message, packages: &mut Packages<'a>) -> Result<(), ConflictingTypes> {
    let package = packages.entry(&message.package).or_default();
    match package.insert(&message.name, message) {
        Some(other) if other == message => return Ok(()),
        Some(_) => {
            return Err(ConflictingTypes {
                type_name: super::type_hash::full_name(message),
            });
        }
        None => {}
    }
    for field in &message.fields {
        if let Kind::Struct(nested) = &field.kind {
            collect(nested, packages)?;
        }
    }
    Ok(())
}

/// The packages that the messages of `package` name, other than `package`.
fn needed_packages<'a>(package: &str, messages: &Messages<'a>) -> BTreeSet<&'a str> {
    let fields = messages.values().flat_map(|message| &message.fields);
    let packages = fields.filter_map(|field| match &field.kind {
        Kind::Struct(nested) => Some(nested.package.as_str()),
        Kind::Number(_) => None,
    });
    packages.filter(|needed| *needed != package).collect()
}

/// The text of a `.msg` file.
fn definition(message: &Message) -> String {
    let mut text = String::new();
    comment(&message.comment, &mut text);
    // An empty line ends the comment of the message.
    text.push('\n');
    for field in &message.fields {
        comment(&field.comment, &mut text);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{} {}", field.type_text(), field.name);
    }
    text
}

fn comment(comment: &str, text: &mut String) {
    for line in comment.lines() {
        let _ = writeln!(text, "{}", format!("# {line}").trim_end());
    }
}

fn package_xml(package: &str, needed: &BTreeSet<&str>) -> String {
    let version = env!("CARGO_PKG_VERSION");
    let mut depends = String::new();
    for needed in needed {
        let _ = writeln!(depends, "  <depend>{needed}</depend>");
    }
    format!(
        r#"<?xml version="1.0"?>
<package format="3">
  <name>{package}</name>
  <version>{version}</version>
  <description>Messages of the HERO helicopter, generated from the schemas of its shared memory.</description>
  <maintainer email="hero@localhost">HERO</maintainer>
  <license>MIT</license>
  <license>Apache-2.0</license>

  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
{depends}  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>

  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
"#
    )
}

fn cmake_lists(package: &str, messages: &Messages<'_>, needed: &BTreeSet<&str>) -> String {
    let mut text = format!(
        "cmake_minimum_required(VERSION 3.8)\nproject({package})\n\nfind_package(ament_cmake REQUIRED)\n\
         find_package(rosidl_default_generators REQUIRED)\n"
    );
    for needed in needed {
        let _ = writeln!(text, "find_package({needed} REQUIRED)");
    }
    text.push_str("\nrosidl_generate_interfaces(${PROJECT_NAME}\n");
    for name in messages.keys() {
        let _ = writeln!(text, "  \"msg/{name}.msg\"");
    }
    if !needed.is_empty() {
        let needed: Vec<&str> = needed.iter().copied().collect();
        let _ = writeln!(text, "  DEPENDENCIES {}", needed.join(" "));
    }
    text.push_str(")\n\nament_export_dependencies(rosidl_default_runtime)\nament_package()\n");
    text
}

#[cfg(test)]
mod tests {
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
        add_packages(schemas, &mut files).unwrap();
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
        let error = add_packages([&one, &other], &mut files).unwrap_err();
        assert_eq!(error.type_name, "battery_watch_msgs/msg/Battery");
        assert!(files.is_empty());
    }

    fn topic(key: &str, text: &str) -> ServiceFacts {
        ServiceFacts {
            key: key.to_owned(),
            schema: Schema::parse(text).unwrap(),
            text: text.to_owned(),
            provider: None,
        }
    }

    #[test]
    fn a_topic_with_another_struct_of_a_known_name_is_left_out() {
        let charge = |layout: &str, last: &str| {
            format!("# Layout: {layout}\n\nuint64 sequence\nuint64 epoch_ns\n{last}\n")
        };
        let topics = [
            topic(
                "battery_watch/charge",
                &charge("battery_watch.Charge.v1", "float64 charge"),
            ),
            topic(
                "other/telemetry",
                &charge("hero.HeroTelemetry.v9", "uint64 other"),
            ),
            topic(
                "other/charge",
                &charge("battery_watch.Level.v1", "float64 level"),
            ),
        ];
        let files = package_files(own_schemas(), topics.into_iter()).unwrap();
        let mut own = BTreeMap::new();
        add_packages(&own_schemas(), &mut own).unwrap();
        let telemetry = "hero_msgs/msg/HeroTelemetry.msg";
        assert_eq!(files[telemetry], own[telemetry]);
        assert!(files.contains_key("battery_watch_msgs/msg/Charge.msg"));
        let cmake = &files["battery_watch_msgs/CMakeLists.txt"];
        assert!(cmake.contains("Charge.msg") && cmake.contains("Level.msg"));
    }
}
