//! What `ril record` makes of what it reads: pure values that are given samples and the time. Files, ports and threads are those of
//! [`commands::record`](crate::commands::record).
//!
//! * [`names`]: how topics are called in a file;
//! * [`continuity`]: losses and restarts of a topic as events, in their places;
//! * [`flights`]: where a flight ends;
//! * [`flight_info`]: what each file says of itself;
//! * [`outlet`]: a topic that the recorder makes itself;
//! * [`journal`]: requests and the bytes of the serial line, made of the bridge's journal;
//! * [`log`]: lines of a log: those of the processes, and those that are made of the bridge's states;
//! * [`messages`]: types of messages that the recorder makes;
//! * [`viewers`]: position and attitude as messages that viewers draw.

pub mod continuity;
pub mod flight_info;
pub mod flights;
pub mod journal;
pub mod log;
pub mod messages;
pub mod names;
pub mod outlet;
pub mod viewers;
