//! Standard messages of ROS 2: as bytes (CDR), and as the definitions that go along with them (`ros2msg`).
//!
//! * [`message`]: a sample of ours as a message;
//! * [`StandardMessage`]: what drivers in ROS 2 publish of a robot, made of its telemetry;
//! * [`pose_stamped`]: position and attitude, for viewers that draw the robot;
//! * [`tf_message`]: the same as a transform; [`ViewerMessage`]: all that is made of telemetry for viewers;
//! * [`path_message`]: a plan, or the track that was flown; [`Qos`]: how surely a topic's samples arrive;
//! * [`diagnostic_array`]: what is wrong; [`geojson_message`]: what lies on a map;
//! * [`layout`]: the panels of Foxglove and Lichtblick that show all this;
//! * [`Log`]: a line of a process's log;
//! * [`definition`]: the definition of each of these types, with all that it contains.
//!
//! Pure values: no file, no clock, no thread.
//!
//! # Example
//!
//! ```
//! use ipc_types::payload::{HeroTelemetry, SharedStruct};
//! use ipc_types::{RobotId, TelemetryGroup};
//! use ros_messages::{StandardMessage, UnixOffset, definition};
//!
//! let fix = StandardMessage::NavSatFix;
//! let mut telemetry = HeroTelemetry::ZERO;
//! // Without a position there is no message.
//! assert_eq!(fix.write(&telemetry, RobotId::DEFAULT, UnixOffset(0)), None);
//! telemetry.valid_groups = TelemetryGroup::Geographic.bit().into();
//! assert!(fix.write(&telemetry, RobotId::DEFAULT, UnixOffset(0)).is_some());
//!
//! let text = definition(fix.type_name()).expect("a type of this crate");
//! assert!(text.contains("float64 latitude"));
//! ```

mod attitude;
pub mod cdr;
mod definitions;
mod diagnostics;
mod geojson;
mod header;
mod layout;
mod log;
mod path;
mod pose;
mod qos;
mod standard;
mod time;
mod transform;
mod viewer;

pub use cdr::message;
pub use definitions::{TYPES, definition};
pub use diagnostics::{DIAGNOSTIC_ARRAY, Diagnostic, DiagnosticLevel, diagnostic_array};
pub use geojson::{GEO_JSON, geojson_message};
pub use layout::layout;
pub use log::{Level, Log};
pub use path::{PATH, PathPoint, path_message};
pub use pose::{POSE_STAMPED, pose_stamped, position};
pub use qos::{Durability, OFFERED_QOS_PROFILES, Qos, Reliability};
pub use standard::StandardMessage;
pub use time::UnixOffset;
pub use transform::{TF_MESSAGE, tf_message};
pub use viewer::ViewerMessage;
