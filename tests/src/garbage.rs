//! [`Garbage`]: payloads of any bit pattern, as a faulty neighbour may leave them in shared memory.

use fastrand::Rng;
use ipc_types::payload::SharedStruct;

/// Makes payloads that no sound program makes, always the same for the same seed.
///
/// Half of the words are random; the others are those at which programs break: the ends of the ranges of integers and
/// floats, and what is no number.
///
/// ```
/// use ipc_types::payload::DspTelemetry;
/// use ril_tests::Garbage;
///
/// let (mut one, mut other) = (Garbage::new(7), Garbage::new(7));
/// let bits = |sample: DspTelemetry| sample.geographic.latitude_deg.to_bits();
/// for _ in 0..100 {
///     assert_eq!(bits(one.payload()), bits(other.payload()));
/// }
/// ```
#[derive(Clone, Debug)]
pub struct Garbage(Rng);

/// Eight bytes each: integers of all widths and floats of both find their extremes in them.
const WORDS: [u64; 16] = [
    0,
    1,
    u64::MAX,
    i64::MAX as u64,
    i64::MIN as u64,
    0x0000_0001_0000_0001,
    0x7fff_ffff_7fff_ffff,
    0x8000_0000_8000_0000,
    // Not a number, infinite, the largest and the smallest number: double precision, then twice single.
    0x7ff8_0000_0000_0000,
    0xfff0_0000_0000_0000,
    0x7fef_ffff_ffff_ffff,
    0x0000_0000_0000_0001,
    0x7fc0_0000_7fc0_0000,
    0x7f80_0000_ff80_0000,
    0x7f7f_ffff_ff7f_ffff,
    0x0001_0001_0001_0001,
];

impl Garbage {
    /// Garbage by this seed; say it when a test fails.
    pub fn new(seed: u64) -> Garbage {
        Garbage(Rng::with_seed(seed))
    }

    /// A payload of any bit pattern.
    ///
    /// # Panics
    ///
    /// Never: every pattern is some payload.
    pub fn payload<T: SharedStruct>(&mut self) -> T {
        let mut bytes = vec![0; size_of::<T>()];
        for word in bytes.chunks_mut(8) {
            let value = match self.0.bool() {
                true => self.0.u64(..),
                false => WORDS[self.0.usize(..WORDS.len())],
            };
            word.copy_from_slice(&value.to_ne_bytes()[..word.len()]);
        }
        T::from_bytes(&bytes).expect("as many bytes as the payload has")
    }

    /// A number less than `bound`, which is not 0.
    pub fn below(&mut self, bound: u64) -> u64 {
        self.0.u64(..bound)
    }
}

#[cfg(test)]
mod tests {
    use ipc_types::payload::{DspTelemetry, ModuleControl, MovementData, RequestReport};

    use super::*;

    #[test]
    fn what_breaks_programs_comes_up_soon() {
        let mut garbage = Garbage::new(1);
        let (mut nan, mut infinite, mut largest) = (false, false, false);
        for _ in 0..1000 {
            let sample: DspTelemetry = garbage.payload();
            nan |= sample.geographic.latitude_deg.is_nan() && sample.attitude.yaw_deg.is_nan();
            infinite |= sample.geographic.altitude_m.is_infinite();
            largest |= sample.sequence == u64::MAX;
        }
        assert!(nan && infinite && largest);
        // Whatever their size.
        let _: (ModuleControl, MovementData, RequestReport) =
            (garbage.payload(), garbage.payload(), garbage.payload());
    }
}
