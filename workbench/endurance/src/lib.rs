//! What the processes of the RIL survive: real processes, killed, disturbed and cut off at random moments. The program `endurance`
//! measures it for as long as it is told; the tests run the short forms.
//!
//! Each measurement has a domain and a folder of its own ([`site`]), draws its moments from a seed, and leaves nothing behind. What it is
//! to do is a [`plan`], what came of it an [`outcome`]. Measurements take a `goes_on`: they end early when that says no, with what there is.

pub mod clients;
pub mod crashes;
pub mod field;
pub mod flood;
pub mod foreign_files;
pub mod full;
pub mod gap;
pub mod joiners;
pub mod kills;
mod listener;
pub mod mavlink;
pub mod memory;
pub mod namespaces;
pub mod outcome;
pub mod plan;
pub mod port;
pub mod power_cut;
pub mod records;
pub mod site;
pub mod starts;
pub mod subscribers;
pub mod usage;
pub mod views;
