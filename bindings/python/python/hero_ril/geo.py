"""Places and moments as people use them: degrees, a local frame in metres, UTC."""

import datetime
import math
import time
from typing import Any, NamedTuple, Optional

#: Half axis of the ellipsoid WGS 84 at the equator [m], and the square of its eccentricity.
_EQUATOR_M = 6378137.0
_E2 = 6.69437999014e-3


def utc(monotonic_ns: int) -> Optional[datetime.datetime]:
    """A moment of the host's monotonic clock, such as `received_ns`, as UTC by the host's clock now; None if it is 0, which is "never"."""
    if monotonic_ns == 0:
        return None
    since_ns = monotonic_ns - time.clock_gettime_ns(time.CLOCK_MONOTONIC)
    moment_s = (time.time_ns() + since_ns) / 1e9
    return datetime.datetime.fromtimestamp(moment_s, datetime.timezone.utc)


class Place(NamedTuple):
    """A place as `Robot.go_to` takes it."""

    #: North of the equator [deg].
    latitude_deg: float
    #: East of Greenwich [deg].
    longitude_deg: float
    #: Telemetry altitude [m].
    altitude_m: float

    @classmethod
    def of(cls, sample: Any) -> "Place":
        """Where a sample of `Robot.telemetry` is."""
        at = sample.geodetic
        return cls(math.degrees(at.latitude_rad), math.degrees(at.longitude_rad), at.altitude_m)


class Offset(NamedTuple):
    """A place by its distances from another one."""

    north_m: float
    east_m: float
    up_m: float


class LocalFrame:
    """Metres north, east and up of an origin, along the ellipsoid WGS 84. Up to 60 degrees of latitude it differs from the plane that touches
    the ellipsoid at the origin by at most 0.15 m in a distance of 1 km, and by 15 m in 10 km."""

    def __init__(self, origin: Place) -> None:
        self.origin = origin
        sine = math.sin(math.radians(origin.latitude_deg))
        curvature = 1.0 - _E2 * sine * sine
        meridian_m = _EQUATOR_M * (1.0 - _E2) / curvature**1.5 + origin.altitude_m
        normal_m = _EQUATOR_M / math.sqrt(curvature) + origin.altitude_m
        self._north_m_per_deg = math.radians(meridian_m)
        self._normal_m = normal_m

    def offset(self, place: Place) -> Offset:
        """Where a place is from the origin."""
        east_m = math.radians(place.longitude_deg - self.origin.longitude_deg + 180.0)
        return Offset(
            (place.latitude_deg - self.origin.latitude_deg) * self._north_m_per_deg,
            (east_m % math.tau - math.pi) * self._parallel_m(place.latitude_deg),
            place.altitude_m - self.origin.altitude_m,
        )

    def place(self, north_m: float, east_m: float, up_m: float = 0.0) -> Place:
        """The place that is so far from the origin."""
        latitude_deg = self.origin.latitude_deg + north_m / self._north_m_per_deg
        longitude_deg = self.origin.longitude_deg + math.degrees(east_m / self._parallel_m(latitude_deg))
        return Place(latitude_deg, (longitude_deg + 180.0) % 360.0 - 180.0, self.origin.altitude_m + up_m)

    def _parallel_m(self, latitude_deg: float) -> float:
        """Radius of the parallel halfway to a latitude [m]."""
        return self._normal_m * math.cos(math.radians((self.origin.latitude_deg + latitude_deg) / 2))
