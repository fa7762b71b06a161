//! ROS 2 without ROS: a robot's topics under the conventions of `rmw_zenoh`, so that ROS 2 nodes list and echo them.
//!
//! `rmw_zenoh` is the middleware of ROS 2 that carries topics over Zenoh. A program is part of the ROS graph when it
//! declares the right liveliness tokens and publishes under the right key expressions; it needs nothing of ROS for
//! that. This module makes the texts and bytes; it knows no Zenoh session.
//!
//! | what | where |
//! |---|---|
//! | key expressions, liveliness tokens, publisher ids, attachments | [`RosSession`], [`Node`], [`Publication`], [`attachment`] |
//! | hash of a type, which is part of the key expression | [`type_hash`] |
//! | a sample of ours as a message | [`message`], of [`ros_messages`] |
//! | `sensor_msgs` and `geometry_msgs` made of a `HeroTelemetry` | [`StandardMessage`], of [`ros_messages`] |
//! | which publications a robot has, and what goes out over them | [`Publications`] |
//! | packages of `.msg` files | [`write_packages`] |
//!
//! Requests are not offered to ROS 2: they go through [`orders`](crate::orders) alone.
//!
//! # Which distributions
//!
//! The format was compared with the sources of the released `rmw_zenoh_cpp` for **Jazzy** (0.2.10), **Kilted** (0.6.7),
//! **Lyrical** (0.10.5) and **Rolling** (0.12.0), which agree. Older releases do not: before 0.2.4 of Jazzy and 0.6.0
//! of Rolling the attachment named its fields. **Humble** has no type hashes: its nodes see these topics, but subscribe
//! under another key expression and receive nothing.
//!
//! # What Zenoh needs
//!
//! * Declare the node's token before those of its publications, and keep all of them as long as samples are published.
//! * Put each sample with its [`attachment`]: subscribers drop a sample without one. An encoding is not needed.
//! * Congestion control is *drop*; reliability is that of [`Publication::qos`].
//! * Plain publishers serve: only subscribers that ask for old samples (*transient local*) want a cache, and no
//!   publication here offers them.

mod graph;
mod packages;
mod topics;
mod type_hash;

pub use graph::{ATTACHMENT_LEN, Gid, Node, Publication, RosSession, attachment};
pub use packages::{ConflictingTypes, add_packages, own_schemas, write_packages};
pub use ros_messages::{Qos, StandardMessage, UnixOffset, message};
pub use topics::{Publications, Way};
pub use type_hash::type_hash;
