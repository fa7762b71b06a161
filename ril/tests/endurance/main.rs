//! The short form of the program `endurance`: loops of kills and of starts, attacks, floods and full memories.

// Each of these tests uses a part of what all measurements share.
#![allow(dead_code)]

#[path = "../../examples/endurance/clients.rs"]
mod clients;
#[path = "../../examples/endurance/crashes.rs"]
mod crashes;
#[path = "../stock_readers/environment.rs"]
mod environment;
#[path = "../stock_readers/expected.rs"]
mod expected;
#[path = "../../examples/endurance/flood.rs"]
mod flood;
#[path = "../../examples/endurance/foreign_files.rs"]
mod foreign_files;
#[path = "../../examples/endurance/full.rs"]
mod full;
#[path = "../../examples/endurance/gap.rs"]
mod gap;
#[path = "../../examples/endurance/joiners.rs"]
mod joiners;
#[path = "../../examples/endurance/kills.rs"]
mod kills;
#[path = "../../examples/endurance/listener.rs"]
mod listener;
#[path = "../../examples/endurance/memory.rs"]
mod memory;
#[path = "../../examples/endurance/namespaces.rs"]
mod namespaces;
#[path = "../../examples/endurance/outcome.rs"]
mod outcome;
#[path = "../../examples/endurance/port.rs"]
mod port;
#[path = "../stock_readers/readers.rs"]
mod readers;
#[path = "../../examples/endurance/records.rs"]
mod records;
#[path = "../../examples/endurance/site.rs"]
mod site;
#[path = "../../examples/endurance/starts.rs"]
mod starts;
#[path = "../../examples/endurance/subscribers.rs"]
mod subscribers;
#[path = "../stock_readers/sums.rs"]
mod sums;

mod attacks;
mod loops;
