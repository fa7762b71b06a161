//! Packages of ROS 2 with our messages, such as `hero_msgs`: what a workspace of ROS 2 needs to build programs that use them.

use std::collections::BTreeMap;
use std::collections::BTreeSet;
use std::fmt::Write;

use ipc_types::Schema;
use ipc_types::module::State;
use ipc_types::payload::SharedStruct;
use ipc_types::schema::{Kind, Message};
use ipc_types::service::SERVICES;

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
pub fn write_packages<'a>(
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

/// The other packages that the messages of `package` name.
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
mod tests;
