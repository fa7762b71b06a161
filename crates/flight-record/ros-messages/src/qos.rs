//! [`Qos`]: how surely the samples of a topic arrive, as ROS 2 has it.

/// How surely samples arrive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Reliability {
    /// Samples may be lost.
    BestEffort,
    /// What the network loses is sent again; a full queue still drops samples.
    Reliable,
}

/// Whether a late subscriber gets what was published before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Durability {
    /// It waits for the next sample.
    Volatile,
    /// It gets the latest samples.
    TransientLocal,
}

/// Quality of service of a topic, as ROS 2 shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Qos {
    /// How surely samples arrive.
    pub reliability: Reliability,
    /// Whether a late subscriber gets what was published before.
    pub durability: Durability,
    /// How many samples are kept for a subscriber that is slow.
    pub depth: u32,
}

impl Qos {
    /// For measurements: a lost sample is replaced by the next one. ROS 2 calls this profile *sensor data*.
    pub const SENSOR_DATA: Qos = Qos {
        reliability: Reliability::BestEffort,
        durability: Durability::Volatile,
        depth: 5,
    };

    /// For states, which change seldom, so that each change counts. ROS 2's default profile.
    pub const STATE: Qos = Qos {
        reliability: Reliability::Reliable,
        durability: Durability::Volatile,
        depth: 10,
    };

    /// For `/tf`, as the package `tf2_ros` publishes it.
    pub const TRANSFORM: Qos = Qos {
        depth: 100,
        ..Qos::STATE
    };

    /// For what holds until it is said anew, such as a path.
    pub const LATCHED: Qos = Qos {
        durability: Durability::TransientLocal,
        depth: 1,
        ..Qos::STATE
    };

    /// The profile of the topic with this key: [`STATE`](Qos::STATE) for `module_state` and for `<module>/state`, which
    /// every module has, else [`SENSOR_DATA`](Qos::SENSOR_DATA).
    pub fn of_key(key: &str) -> Qos {
        match key == "module_state" || key.ends_with("/state") {
            true => Qos::STATE,
            false => Qos::SENSOR_DATA,
        }
    }

    /// The text under [`OFFERED_QOS_PROFILES`]: a YAML list of one publisher's profile. Numbers are those of
    /// `rmw/types.h`, which every `ros2 bag` since Foxy reads; the words of Jazzy and later are not read by those
    /// before.
    pub fn offered_profiles(self) -> String {
        let reliability = match self.reliability {
            Reliability::Reliable => 1,
            Reliability::BestEffort => 2,
        };
        let durability = match self.durability {
            Durability::TransientLocal => 1,
            Durability::Volatile => 2,
        };
        // History: keep last. Liveliness: automatic.
        format!(
            "- history: 1\n  depth: {depth}\n  reliability: {reliability}\n  durability: {durability}\n  deadline:\n{INFINITE}\
             \x20 lifespan:\n{INFINITE}  liveliness: 1\n  liveliness_lease_duration:\n{INFINITE}  avoid_ros_namespace_conventions: false\n",
            depth = self.depth,
        )
    }
}

/// The key of a channel's metadata under which `ros2 bag` keeps the profiles of the topic's publishers.
pub const OFFERED_QOS_PROFILES: &str = "offered_qos_profiles";

/// A duration without end: 2⁶³ − 1 ns.
const INFINITE: &str = "    sec: 9223372036\n    nsec: 854775807\n";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_are_reliable_and_measurements_are_not() {
        for key in ["module_state", "status/state", "battery_watch/state"] {
            assert_eq!(Qos::of_key(key), Qos::STATE, "{key}");
        }
        for key in ["hero_telemetry", "battery_watch/cell_voltages"] {
            assert_eq!(Qos::of_key(key), Qos::SENSOR_DATA, "{key}");
        }
    }

    #[test]
    fn a_profile_is_written_as_ros2_bag_writes_it() {
        let expected = "\
- history: 1
  depth: 1
  reliability: 1
  durability: 1
  deadline:
    sec: 9223372036
    nsec: 854775807
  lifespan:
    sec: 9223372036
    nsec: 854775807
  liveliness: 1
  liveliness_lease_duration:
    sec: 9223372036
    nsec: 854775807
  avoid_ros_namespace_conventions: false
";
        assert_eq!(Qos::LATCHED.offered_profiles(), expected);
        let measurements = expected
            .replace("depth: 1", "depth: 5")
            .replace("reliability: 1", "reliability: 2")
            .replace("durability: 1", "durability: 2");
        assert_eq!(Qos::SENSOR_DATA.offered_profiles(), measurements);
    }
}
