//! A recording in the page, and for Foxglove.
//!
//! * [`recording`]: the robot at any moment of the file, and what flew when and what happened in all of it;
//! * [`playback`]: one playhead for all viewers, and what Foxglove clients get.

mod playback;
mod played;
mod recording;
#[cfg(test)]
mod tests;

pub(crate) use playback::Playback;
