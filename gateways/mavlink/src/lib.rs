//! The helicopter as a MAVLink vehicle, for ground stations and scripts as they are.
//!
//! The process is [`cli`], `shell` and [`config`]. Everything else has no socket, no clock, no thread and no file:
//! [`Gateway`] is given datagrams, samples, reports and times, and gives datagrams, [`Order`]s, [`Event`]s and a
//! deadline. `docs/mavlink.md` describes what stations see.
//!
//! * [`wire`]: frames and their checksums; [`message`]: the messages; `received`: what is read of one; `unoffered`:
//!   those that ask for what is not there; [`number`]: the protocol's numbers;
//! * `mission`: the mission: its items, how it comes, whether it can be flown;
//! * `signing`: whose frames they are;
//! * `vehicle`, `home`, `mode`: what is known of the helicopter; `telemetry`: the same in messages;
//! * `stations`, `streams`, `texts`: to whom what is sent, and when;
//! * `decide`: what a command asks for; `commands`: each at most once; `verdict`: how it is answered;
//! * `parameters`: the DSP's ports and some values of our own, by name;
//! * `fence`: the bridge's geofence in items, and the items of a station as areas;
//! * `gateway`: all of it as one value; [`followed`]: what became of its orders.

pub mod cli;
mod commands;
pub mod config;
mod decide;
mod event;
mod fence;
pub mod followed;
mod gateway;
mod home;
pub mod message;
mod mission;
mod mode;
pub mod number;
mod parameters;
mod received;
mod settings;
pub mod shell;
mod signing;
mod stations;
mod streams;
mod telemetry;
mod texts;
mod unoffered;
mod vehicle;
mod verdict;
pub mod wire;

pub use commands::MEMORY;
pub use event::{Datagram, Event, Order, OrderKind, Task};
pub use gateway::Gateway;
pub use home::{KeptHome, MAX_HOME_BYTES};
pub use mission::store::{Item, MAX_FILE_BYTES, Mission};
pub use mission::{KeptProgress, MAX_PROGRESS_BYTES};
pub use mode::Mode;
pub use settings::{Settings, StationLost};
pub use signing::{Signing, SigningKey, timestamp};
pub use stations::{MAX_STATIONS, SILENCE};
pub use streams::StreamId;
pub use verdict::{CommandAck, answer_of};
