//! What a snapshot has of the link where its own structs are no values of serde.

/// Parameters as the commands that write them: in a configuration they stand by their names.
pub mod parameters {
    use serde::{Deserialize, Deserializer, Serializer};

    use crate::config::Parameters;

    /// The commands.
    pub fn serialize<S: Serializer>(parameters: &Parameters, to: S) -> Result<S::Ok, S::Error> {
        to.collect_seq(parameters.commands())
    }

    /// From the commands.
    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Parameters, D::Error> {
        Ok(Parameters::of(Vec::deserialize(from)?))
    }
}

/// The bytes that wait for the port.
pub mod outgoing {
    use serde::de::{Deserializer, Error};
    use serde::{Deserialize, Serializer};

    use crate::link::outgoing::Outgoing;

    /// The bytes.
    pub fn serialize<S: Serializer>(outgoing: &Outgoing, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_bytes(outgoing.as_bytes())
    }

    /// From the bytes.
    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Outgoing, D::Error> {
        let bytes = Vec::<u8>::deserialize(from)?;
        Outgoing::holding(&bytes).ok_or_else(|| D::Error::custom("too many bytes wait"))
    }
}
