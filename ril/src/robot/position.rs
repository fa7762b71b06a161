//! Where the helicopter is now, and how high the ground of its take-off is.

use std::time::Duration;

use dsp_protocol::Waypoint;
use ipc_types::payload::{DspTelemetry, ModuleState};
use ipc_types::{MonotonicNs, Subscriber, TelemetryGroup, Topic};
use runtime::exit::{ExitCode, Failure, OrFail};

use crate::session::Session;

/// A position from telemetry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Present {
    /// Where, with the telemetry altitude.
    pub at: Waypoint,
    /// Whether the helicopter is in the air.
    pub is_flying: bool,
}

/// The next position that the bridge publishes. A sample that lies there may be old: it does not count.
///
/// # Errors
///
/// Code 3 when there is no bridge, 4 when it publishes no position in time, 7 when a signal ends the wait.
pub(crate) fn present_position(session: &Session, timeout: Duration) -> Result<Present, Failure> {
    let mut telemetry: Subscriber<DspTelemetry> =
        session.ipc.subscriber().or_fail(ExitCode::Internal)?;
    let begin = MonotonicNs::now();
    let give_up = begin + timeout;
    loop {
        let mut found = None;
        let mut is_old = false;
        telemetry
            .drain(|sample| {
                is_old |= sample.received_ns < begin.0;
                found = present(sample)
                    .filter(|_| sample.received_ns >= begin.0)
                    .or(found);
            })
            .or_fail(ExitCode::Internal)?;
        if let Some(found) = found {
            return Ok(found);
        }
        if session.termination.requested() {
            let text = "interrupted before the position was known; nothing was sent";
            return Err(Failure::new(ExitCode::OutcomeUnknown, text));
        }
        if MonotonicNs::now() >= give_up {
            tracing::debug!(is_old, "no position in time");
            return Err(session.nothing_came(DspTelemetry::KEY, timeout)?);
        }
        session.wait([&mut telemetry as _], Some(give_up))?;
    }
}

/// The telemetry altitude of the ground of the take-off, m.
///
/// # Errors
///
/// Code 3 when there is no bridge, 4 when it publishes no state in time, 5 when it has not seen the helicopter on the ground.
pub(crate) fn ground_altitude_m(session: &Session, timeout: Duration) -> Result<f64, Failure> {
    let Some(state) = newest_state(session, timeout)? else {
        return Err(session.nothing_came(ModuleState::KEY, timeout)?);
    };
    state.ground_altitude().ok_or_else(|| {
        let text = "the height above take-off is not known: the bridge has not seen the helicopter on the ground; nothing was sent";
        Failure::new(ExitCode::Refused, text)
            .with_next_step("give telemetry altitudes, without a plus sign: `ril status` shows the present one")
    })
}

/// The newest state of the bridge; `None` if none came in time.
pub(crate) fn newest_state(
    session: &Session,
    timeout: Duration,
) -> Result<Option<ModuleState>, Failure> {
    let mut states: Subscriber<ModuleState> =
        session.ipc.subscriber().or_fail(ExitCode::Internal)?;
    let give_up = MonotonicNs::now() + timeout;
    loop {
        if let Some(state) = states.latest().or_fail(ExitCode::Internal)? {
            return Ok(Some(state));
        }
        if session.termination.requested() || MonotonicNs::now() >= give_up {
            return Ok(None);
        }
        session.wait([&mut states as _], Some(give_up))?;
    }
}

/// `None` if the sample has no position.
fn present(sample: &DspTelemetry) -> Option<Present> {
    let at = Waypoint {
        latitude_deg: sample.geographic.latitude_deg,
        longitude_deg: sample.geographic.longitude_deg,
        altitude_m: sample.geographic.altitude_m,
    };
    let is_known = sample.valid(TelemetryGroup::Geographic) && at.is_plausible();
    is_known.then_some(Present {
        at,
        is_flying: sample.flying == 1,
    })
}
