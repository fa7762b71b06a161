"""A mission and all actions by MAVSDK, as a script that knows nothing of this project: `mavsdk_flies.py PORT`."""

import asyncio

from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.mission import MissionAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins.mission import MissionItem, MissionPlan
from mavsdk_station import HOLD, IN_AIR, MISSION, ON_GROUND, done, judge, refused, until


async def fly(system):
    telemetry, action, mission = TelemetryAsync(system), ActionAsync(system), MissionAsync(system)
    await until("health", telemetry.subscribe_health_all_ok(), lambda is_ok: is_ok)
    home = await until("a position", telemetry.subscribe_position(), lambda position: True)
    lat, lon = home.latitude_deg, home.longitude_deg

    def item(number):
        place = {"latitude_deg": lat + 0.0003 * number, "longitude_deg": lon, "relative_altitude_m": 10.0 + number}
        return MissionItem(**place, speed_m_s=6.0, is_fly_through=True)

    plan = MissionPlan([item(number) for number in (1, 2, 3)])
    await done("set_return_to_launch_after_mission", lambda: mission.set_return_to_launch_after_mission(True))
    await done("upload_mission", lambda: mission.upload_mission(plan))
    downloaded = await done("download_mission", lambda: mission.download_mission())
    for sent, one in zip(plan.mission_items, downloaded.mission_items, strict=True):
        assert abs(sent.latitude_deg - one.latitude_deg) < 2e-7, (sent, one)
        assert (sent.relative_altitude_m, sent.speed_m_s) == (one.relative_altitude_m, one.speed_m_s), (sent, one)
    # In the mode of a mission MAVSDK holds before it arms, also on the ground, and that mission is not begun.
    await done("start_mission", lambda: mission.start_mission())
    await until("the mode of a mission", telemetry.subscribe_flight_mode(), lambda mode: int(mode) == MISSION)
    await done("arm", lambda: action.arm())
    await done("takeoff", lambda: action.takeoff())
    await until("the air", telemetry.subscribe_landed_state(), lambda state: int(state) == IN_AIR)
    await done("land", lambda: action.land())
    await until("the ground", telemetry.subscribe_landed_state(), lambda state: int(state) == ON_GROUND)
    # On the ground it is a moment before it has ended to land.
    await until("the end of the landing", telemetry.subscribe_flight_mode(), lambda mode: int(mode) == HOLD)
    # Without a take-off in it, as such scripts have it.
    await done("start_mission", lambda: mission.start_mission())
    await until("item 1", mission.subscribe_mission_progress(), lambda progress: progress.current >= 1)
    await refused("an upload in flight", lambda: mission.upload_mission(plan))
    await done("pause_mission", lambda: mission.pause_mission())
    # A command that comes again within 2.5 s counts as a copy, which is not carried out.
    await asyncio.sleep(3.0)
    await done("start_mission", lambda: mission.start_mission())
    await until("the end", mission.subscribe_mission_progress(), lambda progress: progress.current == progress.total == 3)
    assert await mission.is_mission_finished()
    await until("the ground", telemetry.subscribe_landed_state(), lambda state: int(state) == ON_GROUND)
    await done("disarm", lambda: action.disarm())
    await until("disarmed", telemetry.subscribe_armed(), lambda is_armed: not is_armed)
    await done("clear_mission", lambda: mission.clear_mission())
    await refused("a mission that is none", lambda: mission.start_mission())

    await done("arm", lambda: action.arm())
    await done("takeoff", lambda: action.takeoff())
    await until("the air", telemetry.subscribe_landed_state(), lambda state: int(state) == IN_AIR)
    await done("goto_location", lambda: action.goto_location(lat + 0.0005, lon, home.absolute_altitude_m + 15.0, 0.0))
    await refused("kill", lambda: action.kill())
    await done("hold", lambda: action.hold())
    await done("set_current_speed", lambda: action.set_current_speed(5.0))
    await done("return_to_launch", lambda: action.return_to_launch())
    await until("the ground", telemetry.subscribe_landed_state(), lambda state: int(state) == ON_GROUND)


judge(fly)
