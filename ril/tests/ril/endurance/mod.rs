//! The short form of the program `endurance`: loops of kills and of starts, attacks, floods, full memories and power cuts, bad links,
//! stations and viewers.

mod attacks;
mod field;
mod loops;
mod mavlink;
mod power_cut;
mod views;
