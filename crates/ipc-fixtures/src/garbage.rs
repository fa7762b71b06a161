//! [`Garbage`]: payloads of any bit pattern, as a faulty neighbour may leave them in shared memory.

use ipc_types::payload::SharedStruct;

/// Makes payloads that no sound program makes, always the same for the same seed.
///
/// Half of the words are random; the others are those at which programs break: the ends of the ranges of integers and
/// floats, and what is no number.
///
/// ```
/// use ipc_fixtures::Garbage;
/// use ipc_types::payload::RequestReport;
///
/// let (mut one, mut other) = (Garbage::new(7), Garbage::new(7));
/// for _ in 0..100 {
///     let (one, other): (RequestReport, RequestReport) = (one.payload(), other.payload());
///     assert_eq!((one.stage, one.value.to_bits()), (other.stage, other.value.to_bits()));
/// }
/// ```
#[derive(Clone, Debug)]
pub struct Garbage(u64);

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
        Garbage(seed)
    }

    /// A payload of any bit pattern.
    ///
    /// # Panics
    ///
    /// Never: every pattern is some payload.
    pub fn payload<T: SharedStruct>(&mut self) -> T {
        let mut bytes = vec![0; size_of::<T>()];
        for word in bytes.chunks_mut(8) {
            let value = match self.below(2) {
                0 => self.next(),
                _ => WORDS[self.below(WORDS.len() as u64) as usize],
            };
            word.copy_from_slice(&value.to_ne_bytes()[..word.len()]);
        }
        T::from_bytes(&bytes).expect("as many bytes as the payload has")
    }

    /// A number less than `bound`, which is not 0.
    pub fn below(&mut self, bound: u64) -> u64 {
        self.next() % bound
    }

    /// SplitMix64.
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
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
