//! What a pilot asks first: up or down, where, how fast, with how much in the battery; and how old all of that is.

use ipc_types::MonotonicNs;
use serde::Serialize;

use super::super::sample_age::{STALE_AFTER, age_ms};
use super::samples::Samples;
use crate::pilot::{self, PilotView};

/// See the module's documentation. What is not known is nothing.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Flight {
    pub(super) flying: Option<bool>,
    /// What the helicopter does, in words; nothing without a state of the bridge.
    pub(super) phase: Option<String>,
    pub(super) latitude_deg: Option<f64>,
    pub(super) longitude_deg: Option<f64>,
    /// Telemetry altitude, m.
    pub(super) altitude_m: Option<f64>,
    pub(super) climb_mps: Option<f64>,
    pub(super) ground_speed_mps: Option<f64>,
    /// 0 … 360, clockwise from true north.
    pub(super) course_deg: Option<f64>,
    /// 0 … 360, clockwise from true north.
    pub(super) heading_deg: Option<f64>,
    pub(super) battery_v: Option<f64>,
    pub(super) fuel_percent: Option<f64>,
    pub(super) pilot_switch: Option<&'static str>,
    /// NMEA 0 … 8.
    pub(super) gps_quality: Option<u32>,
    pub(super) gps_fix: Option<&'static str>,
    /// Of the telemetry from its reading by the bridge; nothing without any, and for a time of the future.
    pub(super) age_ms: Option<u64>,
    /// Whether the telemetry is too old to say how things are now; nothing without any.
    pub(super) stale: Option<bool>,
}

impl Flight {
    /// What the newest telemetry and state say at `now`.
    pub(super) fn new(samples: &Samples<'_>, now: MonotonicNs) -> Flight {
        let view = PilotView::of(samples.hero, samples.dsp);
        Flight {
            flying: view.flying,
            phase: samples.state.map(|state| pilot::phase(state, view.flying)),
            latitude_deg: view.place.map(|place| place.latitude_deg),
            longitude_deg: view.place.map(|place| place.longitude_deg),
            altitude_m: view.altitude_m,
            climb_mps: view.climb_mps,
            ground_speed_mps: view.ground_speed_mps,
            course_deg: view.course_deg,
            heading_deg: view.heading_deg,
            battery_v: view.battery_v,
            fuel_percent: view.fuel_percent,
            pilot_switch: view.switch.map(|switch| switch.name()),
            gps_quality: view.gps.map(|gps| gps.0),
            gps_fix: view.gps.map(|gps| gps.name()),
            age_ms: view.received.and_then(|received| age_ms(received, now)),
            stale: view
                .received
                .map(|received| received > now || now.since(received) > STALE_AFTER),
        }
    }

    /// Whether there is none that says how things are now.
    pub(super) fn is_stale(&self) -> bool {
        self.stale != Some(false)
    }

    /// Flying or not, in words.
    pub(super) fn up_or_down(&self) -> &'static str {
        match self.flying {
            Some(true) => "in the air",
            Some(false) => "on the ground",
            None => "no telemetry",
        }
    }
}

/// In words.
impl Flight {
    pub(super) fn in_words(&self) -> String {
        match (&self.phase, self.flying) {
            (Some(phase), Some(_)) if phase == self.up_or_down() => phase.clone(),
            (Some(phase), _) => format!("{}, {phase}", self.up_or_down()),
            (None, _) => self.up_or_down().to_owned(),
        }
    }

    pub(super) fn altitude(&self) -> String {
        let Some(altitude_m) = self.altitude_m else {
            return "-".to_owned();
        };
        match self.climb_mps {
            Some(climb_mps) => format!("{altitude_m:.1} m, climb {climb_mps:+.1} m/s"),
            None => format!("{altitude_m:.1} m"),
        }
    }

    pub(super) fn position(&self) -> String {
        match (self.latitude_deg, self.longitude_deg) {
            (Some(latitude), Some(longitude)) => format!("{latitude:.7}° {longitude:.7}°"),
            _ => "-".to_owned(),
        }
    }

    pub(super) fn speed(&self) -> String {
        let Some(speed_mps) = self.ground_speed_mps else {
            return "-".to_owned();
        };
        match self.course_deg {
            Some(course) => format!("{speed_mps:.1} m/s over ground, course {course:03.0}°"),
            None => format!("{speed_mps:.1} m/s over ground"),
        }
    }

    pub(super) fn supply(&self) -> String {
        let parts = [
            self.battery_v.map(|volts| format!("battery {volts:.1} V")),
            self.fuel_percent
                .map(|percent| format!("fuel {percent:.0} %")),
            self.pilot_switch
                .map(|switch| format!("pilot's switch {switch}")),
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        if parts.is_empty() {
            "-".to_owned()
        } else {
            parts.join(", ")
        }
    }

    pub(super) fn fix(&self) -> String {
        match (self.gps_fix, self.gps_quality) {
            (Some(fix), Some(quality)) => format!("{fix} ({quality})"),
            _ => "-".to_owned(),
        }
    }
}
