//! Where the helicopter is now, for commands whose arguments are relative to it.

use std::time::Duration;

use dsp_protocol::Waypoint;
use ipc_types::payload::DspTelemetry;
use ipc_types::{MonotonicNs, Subscriber, TelemetryGroup, Topic};
use runtime::exit::{ExitCode, Failure, OrFail};

use super::Session;

/// A position from telemetry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Present {
    /// Where; the altitude has the zero of telemetry.
    pub at: Waypoint,
    /// Whether the helicopter is in the air.
    pub is_flying: bool,
}

/// The next position that the bridge publishes. A sample that lies there may be old: it does not count.
///
/// # Errors
///
/// Code 3 when there is no bridge, 4 when it publishes no position in time, 7 when a signal ends the wait.
pub(super) fn present_position(session: &Session, timeout: Duration) -> Result<Present, Failure> {
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

/// Nothing when the sample has no position.
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
