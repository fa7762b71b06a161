//! The ranges of numbers.

runtime::ranged! {
    pub fn baud_rate(u32) in 50..=4_000_000;
    pub fn milliseconds(u64) in 1..=600_000;
    pub fn pc_timeout_ms(u16) in 0..=60_000;
    pub fn speed_mps(f64) in 0.01..=100.0;
    pub fn spacing_m(f64) in 0.1..=10_000.0;
    pub fn state_period_ms(u64) in 10..=1000;
    pub fn tolerance_deg(f64) in 1e-7..=1.0;
    pub fn tolerance_m(f64) in 0.01..=1000.0;
    pub fn seconds(f64) in 0.1..=86_400.0;
    pub fn distance_m(f64) in 1.0..=1_000_000.0;
    pub fn altitude_m(f64) in -1000.0..=20_000.0;
}
