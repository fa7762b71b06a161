//! What a person sees of a robot, and how an order is followed: the ground that the operator's tool `ril`, the live
//! view, the MAVLink gateway and the recorder stand on.
//!
//! * [`robot`]: where it is and was, what is wrong, who commands it;
//! * [`request`]: follows a request to its final report;
//! * [`render`]: JSON, fields, findings, words, reports as messages, the terminal;
//! * [`session`]: configuration, which robot, its shared memory and the one wait of a command;
//! * [`config`]: the file `ril.toml`; [`options`]: what several commands take;
//! * [`fence_file`]: a fence in the bridge's configuration file; [`user_files`]: where this user's programs keep
//!   what outlives them; [`topic_name`]: the short names of topics.
//!
//! Nothing here decides what the helicopter does: that is the bridge's.
//!
//! # Example
//!
//! ```
//! use ipc_types::code::{Reason, Stage};
//! use ipc_types::payload::RequestReport;
//! use operator::render::messages::{self, FinalReport, Verb};
//!
//! let report = RequestReport::new(Stage::Refused, Reason::LinkDown);
//! assert_eq!(messages::line(Verb::Start, 0, 1, &report).as_deref(), Some("start: refused (link-down)"));
//! let end = FinalReport::of(&report).expect("a refusal is final");
//! assert_eq!(end.exit_code().code(), 6);
//! ```

pub mod config;
pub mod fence_file;
pub mod options;
pub mod render;
pub mod request;
pub mod robot;
pub mod session;
pub mod topic_name;
pub mod user_files;
