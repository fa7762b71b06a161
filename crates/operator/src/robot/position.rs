//! Where the helicopter is now, and how high the ground of its take-off is.

use std::time::Duration;

use dsp_protocol::Waypoint;
use ipc_types::payload::{DspTelemetry, ModuleState};
use ipc_types::{MonotonicNs, TelemetryGroup, Topic};
use runtime::exit::{ExitCode, Failure};

use crate::robot::absence::nothing_came;
use crate::session::{Latest, Session};

/// A position from telemetry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Present {
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
pub fn present_position(session: &Session, timeout: Duration) -> Result<Present, Failure> {
    let mut telemetry = Latest::<DspTelemetry>::open(&session.ipc)?;
    let begin = MonotonicNs::now();
    let (mut found, mut is_heard) = (None, false);
    session.gather(&mut telemetry, begin + timeout, |telemetry, _| {
        let sample = telemetry.sample.as_ref();
        let new = sample.filter(|sample| sample.received_ns >= begin.0);
        is_heard |= new.is_some();
        found = new.and_then(present);
        Ok(found.is_some())
    })?;
    match found {
        Some(found) => Ok(found),
        None if session.termination.requested() => {
            let text = "interrupted before the position was known; nothing was sent";
            Err(Failure::new(ExitCode::OutcomeUnknown, text))
        }
        None if is_heard => {
            let text = "the position is not known: the helicopter has no GPS fix; nothing was sent";
            Err(Failure::new(ExitCode::Timeout, text).with_next_step(
                "wait for a fix: `ril status` shows it; `ril hold` and `ril land` need none",
            ))
        }
        None => Err(nothing_came(session, DspTelemetry::KEY, timeout)?),
    }
}

/// The telemetry altitude of the ground of the take-off, m.
///
/// # Errors
///
/// Code 3 when there is no bridge, 4 when it publishes no state in time, 5 when it has not seen the helicopter on the
/// ground.
pub fn ground_altitude_m(session: &Session, timeout: Duration) -> Result<f64, Failure> {
    let Some(state) = newest_state(session, timeout)? else {
        return Err(nothing_came(session, ModuleState::KEY, timeout)?);
    };
    state.ground_altitude().ok_or_else(|| {
        let text = "the height above take-off is not known: the bridge has not seen the helicopter on the ground; nothing was sent";
        Failure::new(ExitCode::Refused, text)
            .with_next_step("give telemetry altitudes, without a plus sign: `ril status` shows the present one")
    })
}

/// The newest state of the bridge; `None` if none came in time.
pub fn newest_state(session: &Session, timeout: Duration) -> Result<Option<ModuleState>, Failure> {
    let mut state = Latest::<ModuleState>::open(&session.ipc)?;
    let give_up = MonotonicNs::now() + timeout;
    let has_come = |state: &mut Latest<ModuleState>, _| Ok(state.sample.is_some());
    session.gather(&mut state, give_up, has_come)?;
    Ok(state.sample)
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
