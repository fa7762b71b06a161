//! Playing a recording, in virtual time: what is due when, and what the file has.

mod flight;
mod made;
mod player;
mod stream;
