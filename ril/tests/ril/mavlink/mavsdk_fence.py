"""A geofence by MAVSDK: `mavsdk_fence.py PORT`. The last one stays in force."""

from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.geofence import GeofenceAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins.geofence import Circle, FenceType, GeofenceData, Point, Polygon
from mavsdk_station import IN_AIR, ON_GROUND, done, judge, refused, until


async def fly(system):
    telemetry, action, geofence = TelemetryAsync(system), ActionAsync(system), GeofenceAsync(system)
    await until("health", telemetry.subscribe_health_all_ok(), lambda is_ok: is_ok)
    home = await until("a position", telemetry.subscribe_position(), lambda position: True)

    def point(north, east):
        return Point(home.latitude_deg + north, home.longitude_deg + east)

    def square(half, fence_type):
        corners = [point(half, half), point(half, -half), point(-half, -half), point(-half, half)]
        return Polygon(corners, fence_type)

    async def put(what, fence):
        """Brings it into force, and reads it back."""
        await done(what, lambda: geofence.upload_geofence(fence))
        read = await done("download_geofence", lambda: geofence.download_geofence())
        assert len(read.polygons) == len(fence.polygons) and len(read.circles) == len(fence.circles), read
        sent_points = [point for polygon in fence.polygons for point in polygon.points]
        read_points = [point for polygon in read.polygons for point in polygon.points]
        sent_points += [circle.point for circle in fence.circles]
        read_points += [circle.point for circle in read.circles]
        for sent, got in zip(sent_points, read_points, strict=True):
            assert abs(sent.latitude_deg - got.latitude_deg) < 2e-7, (sent, got)
            assert abs(sent.longitude_deg - got.longitude_deg) < 2e-7, (sent, got)
        for sent, got in zip(fence.circles, read.circles, strict=True):
            assert (sent.radius, sent.fence_type) == (got.radius, got.fence_type), (sent, got)
        for sent, got in zip(fence.polygons, read.polygons, strict=True):
            assert sent.fence_type == got.fence_type, (sent, got)

    inside, outside = FenceType.INCLUSION, FenceType.EXCLUSION
    await put("a circle", GeofenceData(circles=[Circle(point(0.001, 0.001), 12.5, outside)]))
    await done("clear_geofence", lambda: geofence.clear_geofence())
    await put("areas", GeofenceData([square(0.002, inside)], [Circle(point(0.001, 0.001), 20.0, outside)]))

    await done("arm", lambda: action.arm())
    await done("takeoff", lambda: action.takeoff())
    await until("the air", telemetry.subscribe_landed_state(), lambda state: int(state) == IN_AIR)
    await refused("a fence in flight", lambda: geofence.upload_geofence(GeofenceData([square(0.1, inside)])), "ERROR")
    beyond = point(0.003, 0.0)
    there = (beyond.latitude_deg, beyond.longitude_deg, home.absolute_altitude_m + 15.0, 0.0)
    await refused("a place outside", lambda: action.goto_location(*there))
    await done("land", lambda: action.land())
    await until("the ground", telemetry.subscribe_landed_state(), lambda state: int(state) == ON_GROUND)


judge(fly)
