//! What an operator sees of a robot: where it is and was, how old its samples are, what its pilot asks first, what
//! changes from one state to the next, the fence and path around it, who commands it, what its processes run with, the
//! relay's link to it, and why nothing of it comes.
//!
//! `model` is all that a screen or a page knows of one robot: `freshness` says how old that is, `changes` what is wrong
//! now, `history` what happened and how values went.

pub mod absence;
pub mod changes;
pub mod chart;
pub mod clock;
pub mod controller;
pub mod domain;
#[doc(hidden)]
pub mod fixture;
pub mod freshness;
pub mod geo;
pub mod history;
pub mod model;
pub mod pilot;
pub mod position;
pub mod relay_link;
pub mod running;
