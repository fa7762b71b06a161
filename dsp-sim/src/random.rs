//! Random numbers that a seed repeats exactly, on every machine and in every version of this crate.
//!
//! The generator is SplitMix64: one 64-bit counter and a mixing function. Never use it for anything secret.

/// The golden ratio as a 64-bit fraction: the step of the counter.
const STEP: u64 = 0x9E37_79B9_7F4A_7C15;

/// A stream of random numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Random {
    counter: u64,
}

impl Random {
    /// The stream number `stream` of `seed`; streams of one seed have nothing to do with each other.
    pub fn new(seed: u64, stream: u64) -> Random {
        // A mixed stream number puts the streams at places of the one long sequence that lie far apart.
        let mut place = Random { counter: stream };
        let offset = place.next_u64();
        Random {
            counter: seed ^ offset,
        }
    }

    /// 64 random bits.
    pub fn next_u64(&mut self) -> u64 {
        self.counter = self.counter.wrapping_add(STEP);
        let mut bits = self.counter;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        bits ^ (bits >> 31)
    }

    /// A number from 0 up to, but not including, 1; all are equally likely.
    pub fn uniform(&mut self) -> f64 {
        // 53 bits are what a mantissa holds.
        (self.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A number around 0 with standard deviation 1, never beyond ±6.
    ///
    /// It is the sum of twelve uniform numbers, whose variance is twelve times 1/12. Additions alone give the same bits
    /// everywhere, which logarithms and sines do not promise.
    pub fn gaussian(&mut self) -> f64 {
        let mut sum = 0.0;
        for _ in 0..3 {
            let bits = self.next_u64();
            for quarter in 0..4 {
                let sixteen = (bits >> (16 * quarter)) & 0xFFFF;
                sum += (sixteen as f64 + 0.5) / 65_536.0;
            }
        }
        sum - 6.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_is_splitmix64() {
        // The published test values for seed 1234567.
        let mut random = Random { counter: 1_234_567 };
        let drawn = [0; 3].map(|_| random.next_u64());
        assert_eq!(
            drawn,
            [
                6_457_827_717_110_365_317,
                3_203_168_211_198_807_973,
                9_817_491_932_198_370_423
            ]
        );
    }

    #[test]
    fn streams_of_one_seed_differ_and_repeat() {
        let draw = |seed, stream| {
            let mut random = Random::new(seed, stream);
            [0; 4].map(|_| random.next_u64())
        };
        assert_eq!(draw(1, 1), draw(1, 1));
        assert_ne!(draw(1, 1), draw(1, 2));
        assert_ne!(draw(1, 1), draw(2, 1));
    }

    #[test]
    fn the_distributions_have_the_mean_and_spread_they_claim() {
        const DRAWS: u32 = 100_000;
        let mut random = Random::new(42, 0);
        let (mut sum, mut squares, mut uniform) = (0.0, 0.0, 0.0);
        for _ in 0..DRAWS {
            let number = random.gaussian();
            assert!(number.abs() <= 6.0);
            sum += number;
            squares += number * number;
            let number = random.uniform();
            assert!((0.0..1.0).contains(&number));
            uniform += number;
        }
        let draws = f64::from(DRAWS);
        assert!((sum / draws).abs() < 0.02, "mean {}", sum / draws);
        assert!((squares / draws - 1.0).abs() < 0.03, "{}", squares / draws);
        assert!((uniform / draws - 0.5).abs() < 0.01, "{}", uniform / draws);
    }
}
