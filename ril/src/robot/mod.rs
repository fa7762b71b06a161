//! What an operator sees of a robot: where it is and was, how old its samples are, what its pilot asks first, what changes from one
//! state to the next, the fence and path around it, what its processes run with, the relay's link to it, and why nothing of it comes.

pub(crate) mod absence;
pub mod changes;
pub mod chart;
pub mod domain;
pub mod geo;
pub mod pilot;
pub(crate) mod position;
pub mod relay_link;
pub mod running;
pub mod sample_age;
