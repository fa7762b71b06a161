//! What the processes of the RIL survive: real processes, killed, disturbed and cut off at random moments. The program
//! `endurance` measures it for as long as it is told; the tests run the short forms.
//!
//! Each measurement is a function of a [`site::Site`]: a domain and a folder of its own, with the [`plan::Plan`] that
//! says what to do. It starts its processes there, draws its moments from the plan's seed, and leaves nothing behind.
//! What came of it is a [`measure::Outcome`], a row of a table. A process that does not come up, telemetry that does
//! not come again and a thing that is left end it with a panic.

pub mod attacks;
pub mod crowds;
pub mod field;
mod hostile;
pub mod kills;
mod listener;
pub mod mavlink;
pub mod plan;
pub mod port;
pub mod power_cut;
pub mod records;
pub mod senders;
pub mod site;
pub mod views;
