//! Places and moments.

use std::ffi::c_int;

use ipc_types::payload::{HeroTelemetry, WaypointPosition};

use super::requests::Waypoint;
use super::{OK, guard, null, write};
use crate::error::Error;
use crate::place::{self, Offset};

/// A moment of the host's monotonic clock as nanoseconds since 1970 (UTC), by the host's clock now; 0 of 0.
#[unsafe(no_mangle)]
pub extern "C" fn hero_ril_utc_ns(monotonic_ns: u64) -> u64 {
    place::utc_ns(monotonic_ns)
}

/// Radians as degrees.
#[unsafe(no_mangle)]
pub extern "C" fn hero_ril_degrees(radians: f64) -> f64 {
    radians.to_degrees()
}

/// Where a sample is, in degrees and as a place to fly to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_place_of(
    sample: *const HeroTelemetry,
    place: *mut Waypoint,
) -> c_int {
    guard(|| {
        // SAFETY: the caller has it point to a sample.
        let at = unsafe { read(sample, "sample")? }.geodetic;
        let found = WaypointPosition {
            latitude_deg: at.latitude_rad.to_degrees(),
            longitude_deg: at.longitude_rad.to_degrees(),
            altitude_m: at.altitude_m,
        };
        // SAFETY: the caller has it point to a variable.
        unsafe { write(place, found.into(), "place")? };
        Ok(OK)
    })
}

/// Metres north, east and up of `origin`, along the ellipsoid WGS 84.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_offset_of(
    origin: *const Waypoint,
    place: *const Waypoint,
    offset: *mut Offset,
) -> c_int {
    guard(|| {
        // SAFETY: the caller has them point to places.
        let (origin, place) = unsafe { (read(origin, "origin")?, read(place, "place")?) };
        let found = place::offset(&origin.into(), &place.into());
        // SAFETY: the caller has it point to a variable.
        unsafe { write(offset, found, "offset")? };
        Ok(OK)
    })
}

/// The place that is `offset` away from `origin`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hero_ril_place_at(
    origin: *const Waypoint,
    offset: *const Offset,
    place: *mut Waypoint,
) -> c_int {
    guard(|| {
        // SAFETY: the caller has them point to a place and an offset.
        let (origin, offset) = unsafe { (read(origin, "origin")?, read(offset, "offset")?) };
        let found = place::place(&origin.into(), &offset);
        // SAFETY: the caller has it point to a variable.
        unsafe { write(place, found.into(), "place")? };
        Ok(OK)
    })
}

unsafe fn read<T: Copy>(from: *const T, what: &str) -> Result<T, Error> {
    // SAFETY: null, or the caller has it point to one.
    unsafe { from.as_ref() }.copied().ok_or_else(|| null(what))
}
