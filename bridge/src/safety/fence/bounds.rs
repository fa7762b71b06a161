//! What is judged, and how finely.

/// Closer than this counts as touching, metres.
///
/// A waypoint travels to the DSP in steps of 10⁻⁷ ° and 1 mm, so it can arrive 8 mm from where it was judged. The value
/// is far above rounding errors too, which are below 10⁻⁶ m.
pub const TOUCH_M: f64 = 0.01;

/// Largest extent of an area from east to west and from north to south, and longest leg that is judged, metres: beyond
/// it a flat map is no longer honest.
pub const MAX_EXTENT_M: f64 = 100_000.0;

/// No vertex, centre or leg is judged nearer to a pole than this, degrees of latitude: meridians are no longer parallel there.
pub const MAX_LATITUDE_DEG: f64 = 85.0;
