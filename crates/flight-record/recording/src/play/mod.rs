//! Playing a recording: its samples onto live services, as if the robot were there.
//!
//! * [`PlayableFlight`]: what a file has to play;
//! * [`Player`]: which message is due when, with speed, section, loop, pause and steps; a pure value that is given the
//!   time;
//! * [`Timeline`]: moments of the flight as moments of now;
//! * [`PlayedServices`]: the services of the robot in shared memory. Requests to it are refused;
//! * [`FlightStream`] and [`Playhead`]: the same for viewers that go to and fro, without services and with one chunk in
//!   memory.
//!
//! The caller of a [`Player`] owns the clock and the wait:
//!
//! 1. it sleeps until [`Player::deadline`], on the [`sources`](PlayedServices::sources) too;
//! 2. it gives what [`Player::next`] returns to [`PlayedServices::publish`], until it returns `None`;
//! 3. it calls [`PlayedServices::service`].

mod flight;
mod player;
mod playhead;
mod services;
mod stream;
mod timeline;

pub use flight::{
    FlightError, LeftOut, PlayableFlight, PlayedContent, PlayedTopic, REQUEST_EVENT, anchor_of,
    key_of,
};
pub use player::{Due, EmptySection, Player, Section};
pub use playhead::{Playhead, SPEEDS};
pub use services::{PROCESS, PlayedServices, ServicesError};
pub use stream::{FlightMark, FlightStream};
pub use timeline::{FlightNs, Timeline};
