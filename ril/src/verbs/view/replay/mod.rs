//! A recording in the page, and for Foxglove.
//!
//! * [`recording`]: the robot at any moment of the file; `course`: what flew when, and what happened, in all of it;
//! * [`playback`]: one playhead for all viewers; `topics`: what Foxglove clients get.

mod course;
mod playback;
mod recording;
#[cfg(test)]
mod tests;
mod topics;

pub(super) use playback::Playback;
