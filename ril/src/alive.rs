//! The robots of a domain that are alive.

use std::collections::BTreeSet;

use ipc_types::payload::{DspTelemetry, HeroTelemetry, ModuleState, MovementData};
use ipc_types::{Domain, DomainError, Request, RobotId, Topic};

/// The robots of which a bridge, a status or a relay lives, in ascending order.
///
/// # Errors
///
/// When the domain's folder cannot be read.
pub fn alive(domain: &Domain) -> Result<Vec<RobotId>, DomainError> {
    let mut robots = BTreeSet::new();
    for key in [
        MovementData::KEY,
        ModuleState::KEY,
        DspTelemetry::KEY,
        HeroTelemetry::KEY,
    ] {
        robots.extend(domain.robots(key)?);
    }
    Ok(robots.into_iter().collect())
}

/// The robots that take movements, in ascending order: a bridge of theirs lives, here or beyond a relay.
///
/// # Errors
///
/// When the domain's folder cannot be read.
pub fn commandable(domain: &Domain) -> Result<Vec<RobotId>, DomainError> {
    domain.robots(MovementData::KEY)
}
