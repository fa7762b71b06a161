//! `foxglove_msgs/msg/GeoJSON`: what lies on a map, as GeoJSON.

use crate::cdr::Writer;

/// Name of the type in ROS 2.
pub const GEO_JSON: &str = "foxglove_msgs/msg/GeoJSON";

/// The message in CDR.
pub fn geojson_message(geojson: &str) -> Vec<u8> {
    let mut writer = Writer::with_capacity(geojson.len() + 16);
    writer.string(geojson);
    writer.finish()
}
