//! `ril relay ros2-packages`: the packages of ROS 2 with the messages of a robot's topics, as files.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use ipc_types::dynamic::{self, ServiceFacts};
use ipc_types::{Ipc, Schema};

use crate::config::TopicsConfig;
use crate::ros2::{ConflictingTypes, own_schemas, write_packages};

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

/// Writes the packages into `folder`: the robot's own messages, and those of the topics that are here now and that a relay would
/// carry. Says which packages there are, and how many messages each has.
///
/// # Errors
///
/// See [`WriteError`]. What was written before it stays.
pub fn write(
    folder: &Path,
    ipc: &Ipc,
    config: &TopicsConfig,
) -> Result<BTreeMap<String, usize>, WriteError> {
    let topics = dynamic::topics(ipc).into_iter();
    let relayed = topics.filter(|facts| config.plan(&facts.key).is_some());
    let files = files(own_schemas(), relayed)?;
    let mut packages = BTreeMap::new();
    for (path, text) in files {
        // Paths are `<package>/…` and `<package>/msg/…`.
        let (package, file) = path.split_once('/').unwrap_or((&path, ""));
        *packages.entry(package.to_owned()).or_default() += usize::from(file.ends_with(".msg"));
        write_file(&folder.join(&path), &text)?;
    }
    Ok(packages)
}

fn write_file(path: &Path, text: &str) -> Result<(), WriteError> {
    let folder = path.parent().unwrap_or(path);
    fs::create_dir_all(folder)
        .and_then(|()| fs::write(path, text))
        .map_err(|source| WriteError::File {
            path: path.to_owned(),
            source,
        })
}

/// The packages' files by path. A topic whose types are already there under the same names, and are others, is left out.
fn files(
    mut schemas: Vec<Schema>,
    topics: impl Iterator<Item = ServiceFacts>,
) -> Result<BTreeMap<String, String>, ConflictingTypes> {
    let mut files = BTreeMap::new();
    write_packages(&schemas, &mut files)?;
    for ServiceFacts { key, schema, .. } in topics {
        schemas.push(schema);
        // All of them each time: a package's list of messages grows with every topic.
        if let Err(error) = write_packages(&schemas, &mut files) {
            tracing::warn!(key, %error, "a topic is left out");
            schemas.pop();
        }
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let files = files(own_schemas(), topics.into_iter()).unwrap();
        let mut own = BTreeMap::new();
        write_packages(&own_schemas(), &mut own).unwrap();
        let telemetry = "hero_msgs/msg/HeroTelemetry.msg";
        assert_eq!(files[telemetry], own[telemetry]);
        assert!(files.contains_key("battery_watch_msgs/msg/Charge.msg"));
        let cmake = &files["battery_watch_msgs/CMakeLists.txt"];
        assert!(cmake.contains("Charge.msg") && cmake.contains("Level.msg"));
    }
}
