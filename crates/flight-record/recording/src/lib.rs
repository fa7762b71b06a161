//! A flight as files in the format [MCAP](https://mcap.dev), which the tools of ROS 2 and of the field read.
//!
//! * [`Recorder`]: messages in, [`FileAction`]s on files out;
//! * [`read`]: messages, checks, recovery and summaries of such files;
//! * [`play`]: a recording as live services, as if its robot were there;
//! * [`topic_of`]: how topics are called; [`RequestEvent`]: a request, or a report about one, as a message.
//!
//! docs/recording.md describes the layout of a file.
//!
//! # Example
//!
//! ```
//! use ipc_types::{MonotonicNs, RobotId};
//! use recording::{Anchor, Channel, FlightInfo, Recorder, Settings};
//!
//! let now = MonotonicNs(5_000_000_000);
//! let anchor = Anchor { monotonic: now, unix_ns: 1_700_000_000_000_000_000 };
//! let info = FlightInfo { robot: RobotId::DEFAULT, metadata: vec![], attachments: vec![] };
//! let mut recorder = Recorder::new(Settings::default(), info, anchor);
//! let height = recorder.channel(Channel {
//!     topic: "/robot1/height".to_owned(),
//!     schema_name: "example_msgs/msg/Height".to_owned(),
//!     schema_text: "uint32 height_mm\n".to_owned(),
//!     metadata: [].into(),
//! });
//! let message = [0, 1, 0, 0, 7, 0, 0, 0];
//! recorder.add(now, height.expect("room for a topic"), now, 1, &message);
//! recorder.end(now);
//!
//! // A disk that is a vector.
//! let mut file = Vec::new();
//! while let Some(action) = recorder.next() {
//!     action.apply_to(&mut file);
//!     recorder.done(now, Ok(()));
//! }
//!
//! assert!(recording::read::check(&file).is_complete);
//! let found: Vec<_> = recording::read::messages(&file).collect::<Result<_, _>>()?;
//! assert_eq!((found[0].topic(), found[0].log_time_ns), ("/robot1/height", anchor.unix_ns));
//! assert_eq!(found[0].data(), message);
//! # Ok::<(), recording::read::ReadError>(())
//! ```

mod action;
mod encoder;
mod ending;
mod event;
mod event_message;
mod files;
mod inbox;
mod notes;
pub mod play;
mod queue;
pub mod read;
mod recorder;
mod request_event;
mod settings;
mod sink;
mod topic_name;

pub use action::{DiskError, DiskErrorKind, FileAction, Part};
pub use event::{Event, EventKind};
pub use files::{RETRY_PERIOD, Totals};
pub use inbox::MAX_CHANNELS;
pub use notes::FILE_METADATA;
pub use recorder::Recorder;
pub use request_event::{REQUEST_EVENT, REQUEST_EVENT_TEXT, RequestEvent};
pub use settings::{Anchor, Attachment, Channel, ChannelId, FlightInfo, Settings};
pub use topic_name::{FLIGHT, name_of, topic, topic_of};
