//! `ril doctor` and `ril preflight`: what is wrong with a machine, whether a robot is ready to take off, and what to do.
//!
//! `gather` looks up [`facts`]; what they mean is pure: [`diagnosis`] judges the machine for the doctor, with `clock`, `domain`,
//! `services`, `serial`, `relay_link`, `view` and `mavlink`; for the preflight `robot`, `helicopter` and `machine` judge the rest. All of them give
//! [findings](runtime::finding).

mod clock;
pub mod diagnosis;
pub mod doctor;
mod domain;
pub mod facts;
pub(crate) mod gather;
mod helicopter;
mod machine;
mod mavlink;
pub mod options;
pub mod preflight;
mod relay_link;
mod robot;
mod serial;
mod services;
#[cfg(test)]
mod tests;
mod view;

use std::io::IsTerminal;
use std::os::fd::AsFd;

use crate::render::terminal::Size;

/// Width of the name of a check or a subject, and the space behind it.
const HEADING: usize = 16;

/// How wide text on `out` may be: a file has no width.
fn width(out: &(impl AsFd + IsTerminal)) -> usize {
    match out.is_terminal() {
        true => Size::of(out).columns,
        false => usize::MAX,
    }
}
