//! The table of all checks: one for each sentence of docs/protocol.md that the PC can judge.

use dsp_protocol::Profile;

use crate::check::{Check, How};
use crate::checks::{
    boot, commands, errors, extended, flight, frames, groups, path, ports, status,
};

/// All checks in the order of a run: what moves no rotor, what needs a reset, what moves a rotor, and last what is
/// judged of all messages.
pub fn table() -> Vec<Check> {
    let mut checks = Vec::new();
    for some in [
        commands::checks(),
        frames::checks(),
        groups::checks(),
        status::checks(),
        ports::checks(),
        errors::checks(),
        extended::checks(),
        boot::checks(),
        flight::before_hover(),
        path::checks(),
        flight::after_hover(),
    ] {
        checks.extend(some);
    }
    // Stable: within a kind the order is that of the lists above.
    checks.sort_by_key(|check| match &check.how {
        How::Harmless(_) => u8::from(check.needs_reset),
        // A reset takes what a hover needs.
        How::Moving(..) => 3 - u8::from(check.needs_reset),
        How::Watched(_) => 4,
    });
    checks
}

/// The checks of a profile of which the name or the section begins with one of `only`; all of them if there is none.
pub fn chosen(profile: Profile, only: &[String]) -> Vec<Check> {
    let is_chosen = |check: &Check| {
        only.is_empty()
            || only
                .iter()
                .any(|start| check.id.starts_with(start.as_str()) || check.section == start)
    };
    table()
        .into_iter()
        .filter(|check| check.profile.is_none_or(|only| only == profile))
        .filter(is_chosen)
        .collect()
}
