//! Files of each format written by hand, mistakes in them, files that were mutated at random, and the parser of
//! pymavlink.

mod altitudes;
mod checks;
mod files;
mod kinds;
mod mistakes;
mod mutations;
mod parameters;
mod pymavlink;
mod reading;
mod structure;
