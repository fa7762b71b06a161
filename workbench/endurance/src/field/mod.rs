//! The relay on bad links: real processes of a robot and of a station, each with a network of its own, and the robot with a monotonic
//! clock that is seven hours ahead.
//!
//! The networks are namespaces with an interface each, between which this program carries the packets and loses some,
//! by a seed, as `tc netem` would. That needs root, `/dev/net/tun`, and the programs `ip`, `setpriv`, `unshare` and `nsenter`; a
//! measurement says which is missing; [`narrow`] and [`fleet`], which are on loopback, need none of it. Everything goes when the program ends, even if it is killed. Times are printed and not judged.

mod ages;
pub mod connect;
pub mod fleet;
pub mod mission;
pub mod narrow;
pub mod outages;
pub mod requests;
pub mod site;
mod tunnel;
