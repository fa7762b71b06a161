mod exchanges;
mod jumps;
mod link;
mod truth;
