//! Structs of shared memory as values of serde: their bytes, for `#[serde(with = "module_kit::journal::raw")]`.

use std::fmt;
use std::marker::PhantomData;

use ipc_types::payload::SharedStruct;
use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};
use serde::ser::{Serialize, Serializer};

/// A struct of shared memory that is a value of serde, where no attribute can stand.
#[derive(Clone, Copy, Debug)]
pub struct Raw<T>(pub T);

/// The bytes of `value`.
///
/// # Errors
/// Those of the serializer.
pub fn serialize<T: SharedStruct, S: Serializer>(value: &T, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_bytes(value.bytes())
}

/// The struct with these bytes.
///
/// # Errors
/// They are not as many as the struct has.
pub fn deserialize<'de, T: SharedStruct, D: Deserializer<'de>>(from: D) -> Result<T, D::Error> {
    from.deserialize_bytes(RawVisitor(PhantomData))
}

impl<T: SharedStruct> Serialize for Raw<T> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        serialize(&self.0, to)
    }
}

impl<'de, T: SharedStruct> Deserialize<'de> for Raw<T> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        deserialize(from).map(Raw)
    }
}

struct RawVisitor<T>(PhantomData<T>);

impl<'de, T: SharedStruct> Visitor<'de> for RawVisitor<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the {} bytes of {}", size_of::<T>(), T::NAME)
    }

    fn visit_bytes<E: Error>(self, bytes: &[u8]) -> Result<T, E> {
        T::from_bytes(bytes).ok_or_else(|| E::invalid_length(bytes.len(), &self))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<T, A::Error> {
        let mut bytes = Vec::new();
        while let Some(byte) = seq.next_element()? {
            // One more than it can have is enough to be refused.
            if bytes.len() <= size_of::<T>() {
                bytes.push(byte);
            }
        }
        self.visit_bytes(&bytes)
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::payload::RequestReport;
    use serde::de::value::{Error, SeqDeserializer};

    use super::*;

    /// Formats that have no bytes give them as numbers.
    #[test]
    fn a_struct_comes_from_as_many_numbers_as_it_has_bytes() {
        let report = RequestReport {
            request_id: 7,
            ..RequestReport::default()
        };
        let read = |bytes: &[u8]| {
            let numbers = SeqDeserializer::<_, Error>::new(bytes.iter().copied());
            Raw::<RequestReport>::deserialize(numbers)
                .ok()
                .map(|Raw(report)| report)
        };
        let bytes = report.bytes();
        assert_eq!(read(bytes), Some(report));
        assert_eq!(read(&bytes[1..]), None);
        for more in [1, 50] {
            assert_eq!(read(&[bytes, &vec![0; more]].concat()), None);
        }
    }
}
