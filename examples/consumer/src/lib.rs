//! Watches how high the helicopter flies, and says when it is too high, when nobody knows, and when nothing is heard.
//!
//! What is told is decided by [`Guard`], which a test builds without anything else; [`watch`] feeds it from shared
//! memory.

use std::error::Error;
use std::fmt;
use std::time::Duration;

use ipc_types::payload::HeroTelemetry;
use ipc_types::{Subscriber, TelemetryGroup, Wake};

/// Something that the operator should know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Notice {
    /// It flies higher than it may.
    Above {
        /// Altitude, m.
        altitude_m: f64,
    },
    /// It is low enough again.
    Below,
    /// Telemetry does not say where it is.
    NoPosition,
    /// Nothing was heard for a while.
    Silent,
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Notice::Above { altitude_m } => write!(f, "above the limit: {altitude_m:.1} m"),
            Notice::Below => f.write_str("below the limit again"),
            Notice::NoPosition => f.write_str("the position is not known"),
            Notice::Silent => f.write_str("no telemetry"),
        }
    }
}

/// Where the helicopter is, as far as is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    Below,
    Above,
    Unknown,
}

/// Decides what to tell: each change once.
#[derive(Clone, Debug)]
pub struct Guard {
    limit_m: f64,
    place: Place,
    has_flown: bool,
    is_flying: bool,
}

impl Guard {
    /// Guards this altitude, m.
    pub fn new(limit_m: f64) -> Guard {
        Guard {
            limit_m,
            place: Place::Below,
            has_flown: false,
            is_flying: false,
        }
    }

    /// Takes a sample.
    pub fn sample(&mut self, sample: &HeroTelemetry) -> Option<Notice> {
        self.is_flying = sample.is_flying();
        self.has_flown |= self.is_flying;
        let altitude_m = sample.geodetic.altitude_m;
        // A group that was not transmitted is zero: without this check the helicopter would be at sea level.
        let place = if !sample.valid(TelemetryGroup::Geographic) {
            Place::Unknown
        } else if altitude_m > self.limit_m {
            Place::Above
        } else {
            Place::Below
        };
        if place == self.place {
            return None;
        }
        self.place = place;
        Some(match place {
            Place::Above => Notice::Above { altitude_m },
            Place::Below => Notice::Below,
            Place::Unknown => Notice::NoPosition,
        })
    }

    /// Whether the flight is over.
    pub fn has_landed(&self) -> bool {
        self.has_flown && !self.is_flying
    }
}

/// Follows a flight to its end and reports what `guard` finds. Sleeps while nothing comes, and reports that every
/// `timeout`.
///
/// # Errors
///
/// When the wait fails. Trouble with receiving is over with the next call, so that it counts as silence.
pub fn watch(
    telemetry: &mut Subscriber<HeroTelemetry>,
    guard: &mut Guard,
    timeout: Duration,
    mut tell: impl FnMut(Notice),
) -> Result<(), Box<dyn Error>> {
    while !guard.has_landed() {
        if telemetry.wait(timeout)? == Wake::TimedOut {
            tell(Notice::Silent);
        }
        // Whatever woke it: everything that is there is taken.
        let _ = telemetry.drain(|sample| {
            if let Some(notice) = guard.sample(sample) {
                tell(notice);
            }
        });
    }
    Ok(())
}
