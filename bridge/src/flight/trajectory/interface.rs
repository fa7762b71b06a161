//! [`Trajectory`]: what a generator does.

use dsp_protocol::Waypoint;
use dsp_protocol::downlink::Geographic;

/// One point for the DSP.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrajectoryPoint {
    /// Where to fly.
    pub waypoint: Waypoint,
    /// The waypoint of the path, counted from 0, that this point is; nothing for a point in between.
    pub path_index: Option<usize>,
}

/// Turns a path into the points that go to the DSP, one for each grant of flow control.
pub trait Trajectory: std::fmt::Debug {
    /// Begins a path of at most [`MAX_WAYPOINTS`](crate::flight::assembly::MAX_WAYPOINTS) waypoints that the helicopter flies from `start`. Forgets what is left
    /// of the one before.
    fn begin(&mut self, start: Geographic, path: &[Waypoint]);

    /// The point to send next; `None` if all have been given. The last point must be the path's last waypoint, and all
    /// points must lie on the legs of the path, which are what the geofence was checked for.
    fn peek(&self) -> Option<TrajectoryPoint>;

    /// The point of [`Trajectory::peek`] was sent.
    fn advance(&mut self);

    /// Forgets what is left.
    fn clear(&mut self);
}
