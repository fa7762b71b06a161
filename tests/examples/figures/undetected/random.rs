//! Reproducible random numbers (SplitMix64, Steele, Lea and Flood): fast, and every seed is a good one.

/// A row of random numbers.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// The row that belongs to `seed`.
    pub fn new(seed: u64) -> Self {
        Random(seed)
    }

    /// The next 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    /// A number below `bound`, which is not 0. The product's high half is nearer to uniform than a remainder.
    pub fn below(&mut self, bound: usize) -> usize {
        ((u128::from(self.bits()) * bound as u128) >> 64) as usize
    }

    /// A number of `min ..= max`.
    pub fn within(&mut self, min: i32, max: i32) -> i32 {
        let span = i64::from(max) - i64::from(min) + 1;
        (i64::from(min) + self.below(span as usize) as i64) as i32
    }

    /// True once in `count` times.
    pub fn once_in(&mut self, count: usize) -> bool {
        self.below(count) == 0
    }

    /// How many bits arrive unhurt before the next one that is flipped, when each is flipped with `probability`.
    pub fn bits_until_hit(&mut self, probability: f64) -> usize {
        // 53 random bits make a number of 0 … 1; half a step more keeps it from 0, whose logarithm has no end.
        let uniform = ((self.bits() >> 11) as f64 + 0.5) / (1_u64 << 53) as f64;
        (uniform.ln() / (-probability).ln_1p()) as usize
    }
}
