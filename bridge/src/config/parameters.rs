//! [`ParametersConfig`]: the values that the bridge writes to the DSP's ports.

use std::fmt;

use dsp_protocol::Command;
use dsp_protocol::port::{self, Access, Port, Port16};
use runtime::config::in_range;
use serde::de::{Error as _, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::safety::fence::Speeds;

/// `[parameters]`: values for the ports of `docs/protocol.md` section 6, by name; written
/// in the order of the port numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ParametersConfig(Vec<Command>);

impl ParametersConfig {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The command that writes the parameter of this index, which must be below [`ParametersConfig::len`].
    pub fn write(&self, index: usize) -> Command {
        self.0[index]
    }

    /// The commands that write the parameters.
    pub fn writes(&self) -> impl Iterator<Item = Command> + '_ {
        self.0.iter().copied()
    }

    /// The value of a 16-bit port: the one that was written, or that of the DSP's boot.
    pub fn value_16(&self, number: u16) -> u16 {
        let written = self.0.iter().find_map(|write| match write {
            Command::Write16 { port, value } if *port == number => Some(*value),
            _ => None,
        });
        let at_boot = port::port16(number).map(|port| port.boot as u16);
        written.or(at_boot).unwrap_or_default()
    }

    /// The radius in which the DSP takes a waypoint for reached.
    pub fn acceptance_radius_m(&self) -> f64 {
        self.value_32(port::ACCEPTANCE_RADIUS_M)
    }

    /// How fast the DSP flies a path.
    pub fn speeds(&self) -> Speeds {
        Speeds {
            cruise_mps: self.value_32(port::CRUISE_SPEED_MPS),
            climb_mps: self.value_32(port::CLIMB_SPEED_MPS),
            begin_mps: f64::INFINITY,
        }
    }

    /// The value of a 32-bit port: the one that was written, or that of the DSP's boot.
    fn value_32(&self, number: u16) -> f64 {
        let written = self.0.iter().find_map(|write| match write {
            Command::Write32 { port, value } if *port == number => Some(*value),
            _ => None,
        });
        let at_boot = port::port32(number).map(|port| port.boot);
        f64::from(written.or(at_boot).unwrap_or_default())
    }

    /// Writes `write` as well from now on; one to the same port is replaced. There is one for each port at most.
    pub fn set(&mut self, write: Command) {
        match self
            .0
            .iter_mut()
            .find(|other| port_of(other) == port_of(&write))
        {
            Some(other) => *other = write,
            None => self.0.push(write),
        }
    }
}

/// The port that a command writes or reads.
fn port_of(command: &Command) -> Option<u16> {
    match command {
        Command::Read16 { port }
        | Command::Write16 { port, .. }
        | Command::Read32 { port }
        | Command::Write32 { port, .. } => Some(*port),
        _ => None,
    }
}

impl<'de> Deserialize<'de> for ParametersConfig {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(ParametersVisitor)
    }
}

/// By the names of the ports, as they are read.
impl Serialize for ParametersConfig {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut map = to.serialize_map(Some(self.0.len()))?;
        for write in &self.0 {
            match *write {
                Command::Write16 { port, value } => {
                    if let Some(port) = port::port16(port) {
                        map.serialize_entry(port.name, &port.value_of(value))?;
                    }
                }
                Command::Write32 { port, value } => {
                    if let Some(port) = port::port32(port) {
                        map.serialize_entry(port.name, &value)?;
                    }
                }
                _ => {}
            }
        }
        map.end()
    }
}

struct ParametersVisitor;

impl<'de> Visitor<'de> for ParametersVisitor {
    type Value = ParametersConfig;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a table of controller parameters")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<ParametersConfig, A::Error> {
        let mut writes = Vec::new();
        while let Some(name) = map.next_key::<String>()? {
            writes.push(map.next_value_seed(ParameterValue { name: &name })?);
        }
        // A table of TOML has no order.
        writes.sort_by_key(|(port, _)| *port);
        Ok(ParametersConfig(
            writes.into_iter().map(|(_, write)| write).collect(),
        ))
    }
}

/// Reads the value of one parameter, so that an error points at its line.
struct ParameterValue<'a> {
    name: &'a str,
}

impl<'de> serde::de::DeserializeSeed<'de> for ParameterValue<'_> {
    type Value = (u16, Command);

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        match port::by_name(self.name) {
            Some(Port::Bits32(port)) => {
                let value = in_range(deserializer, port.min..=port.max)?;
                let port = port.number;
                Ok((port, Command::Write32 { port, value }))
            }
            Some(Port::Bits16(port)) if is_parameter(port) => {
                let value: i32 = in_range(deserializer, port.min..=port.max)?;
                let port = port.number;
                // Within the port's range, so these are the 16 bits that section 6 asks for, signed or not.
                let value = value as u16;
                Ok((port, Command::Write16 { port, value }))
            }
            _ => Err(D::Error::custom(format_args!(
                "unknown parameter `{}`; the parameters are {}",
                self.name,
                parameter_names().join(", ")
            ))),
        }
    }
}

/// The mask belongs to `[status]`, the PC time-out to `[link]`, and no configuration file takes off or lands.
fn is_parameter(port: &Port16) -> bool {
    port.access != Access::Bridge
}

fn parameter_names() -> Vec<&'static str> {
    let bits16 = port::PORTS_16.iter().filter(|port| is_parameter(port));
    bits16
        .map(|port| port.name)
        .chain(port::PORTS_32.iter().map(|port| port.name))
        .collect()
}

/// Parameters as the commands that write them, which is what a snapshot has: in a configuration they stand by their
/// names.
pub(crate) mod as_commands {
    use dsp_protocol::Command;
    use serde::{Deserialize, Deserializer, Serializer};

    use crate::config::parameters::ParametersConfig;

    pub fn serialize<S: Serializer>(
        parameters: &ParametersConfig,
        to: S,
    ) -> Result<S::Ok, S::Error> {
        to.collect_seq(&parameters.0)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<ParametersConfig, D::Error> {
        let mut writes = Vec::<Command>::deserialize(from)?;
        writes.retain(|write| matches!(write, Command::Write16 { .. } | Command::Write32 { .. }));
        Ok(ParametersConfig(writes))
    }
}
