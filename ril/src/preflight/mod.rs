//! Whether a robot is ready to take off: the judgement of `ril preflight`.
//!
//! [`facts`] are gathered by the command and judged here: [`judge`] makes one [`Check`] of each thing that must be in
//! order, with its value, its limit and what to do. What `ril doctor` finds about the machine is taken over from there
//! (`machine`), not judged a second time. Pure: the same facts give the same checks. [`limits`] is `[preflight]` of
//! `ril.toml`.

pub mod check;
pub mod facts;
mod helicopter;
pub mod limits;
mod machine;
pub mod report;
mod robot;
#[cfg(test)]
mod tests;

use check::Check;
use facts::Facts;
use limits::Limits;

/// What the facts mean, in the order in which an operator sets things right: processes, link, helicopter, rules, machine.
pub fn judge(facts: &Facts, limits: &Limits) -> Vec<Check> {
    let mut checks = robot::judge(facts, limits);
    checks.extend(helicopter::judge(facts, limits));
    checks.extend(machine::judge(facts, limits));
    let does_without = |check: &Check| limits.may_be_unchecked.iter().any(|id| id == check.id);
    checks
        .into_iter()
        .map(|check| match does_without(&check) {
            true => check.may_be_unchecked(),
            false => check,
        })
        .collect()
}
