//! Stand-ins for the publisher of a topic and the server of a request: what a program is tested against, in a process.
//!
//! Each has a thread of its own that owns the real ports of `ipc-types` and sleeps until there is something to do, so
//! that the program under test may block as it does in earnest. They do what they are told: a stand-in never changes
//! what it publishes because of a request.

mod answer;
mod flow;
mod publishing;
mod server;
mod topic;
pub mod worker;

pub use answer::Answer;
pub use publishing::Publishing;
pub use server::StandInServer;
pub use topic::StandInTopic;
