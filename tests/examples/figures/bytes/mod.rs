//! Bytes from a hostile or broken line into the decoders and the bridge's core.
//!
//! * [`stream`]: noise and damaged frames; [`decoders`], [`core`]: what the bytes go into;
//! * [`obliging`]: a DSP that does whatever it is told, so that noise meets the bridge in every phase of a flight;
//! * [`heap`]: what it costs the allocator; [`measure`]: all of it, counted; [`script`]: the input of a fuzz target;
//! * [`undetected`]: damaged frames that are taken for good ones, with the messages of all.

pub mod core;
pub mod decoders;
pub mod heap;
pub mod measure;
pub mod obliging;
pub mod script;
pub mod stream;

#[path = "../undetected/mod.rs"]
pub mod undetected;

pub use undetected::traffic;
