//! `ril view FILE`: a recording in the page, and for Foxglove.
//!
//! * [`recording`]: the robot at any moment of the file; `course`: what flew when, and what happened, in all of it;
//! * [`playback`]: one playhead for all viewers; `topics`: what Foxglove clients get;
//! * [`start`]: the command.

mod course;
mod playback;
mod recording;
mod start;
#[cfg(test)]
mod tests;
mod topics;

pub(super) use playback::Playback;
pub(super) use start::view;
