"""Takes off, flies a square and lands, by MAVSDK beside `ril run mavlink`: mavsdk_mission.py [PORT]

It needs `pip install mavsdk`, and nothing of the RIL.
"""

import asyncio
import math
import sys

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.mission import MissionAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins.mission import MissionItem, MissionPlan

METRES_PER_DEGREE = 111_195
ON_GROUND, HOLD = 1, 3  # of landed states and of flight modes
# East, north and up of the place of take-off, m: a square that ends where it began, and a second path.
PATH = [(0, 8, 6), (8, 8, 7), (8, 0, 6), (0, 0, 5), (-4, 3, 5), (-3, -2, 4)]


async def first(values, is_right=lambda value: True):
    """The first value that is right."""
    async for value in values:
        if is_right(value):
            return value


async def done(order):
    """Gives the order, again when no answer came: the gateway carries out no copy of one that it has."""
    for is_last in (False, False, True):
        try:
            return await order()
        except Exception as error:  # each plugin has its own
            if is_last or "TIMEOUT" not in str(error):
                raise
            await asyncio.sleep(3)


async def fly(system):
    telemetry, action, mission = TelemetryAsync(system), ActionAsync(system), MissionAsync(system)
    await first(telemetry.subscribe_health_all_ok(), lambda is_ok: is_ok)
    home = await first(telemetry.subscribe_position())
    east = METRES_PER_DEGREE * math.cos(math.radians(home.latitude_deg))
    items = [
        MissionItem(
            latitude_deg=home.latitude_deg + north_m / METRES_PER_DEGREE,
            longitude_deg=home.longitude_deg + east_m / east,
            relative_altitude_m=up_m,
            speed_m_s=3.0,
            is_fly_through=True,
        )
        for east_m, north_m, up_m in PATH
    ]
    await done(lambda: mission.set_return_to_launch_after_mission(False))
    await done(lambda: mission.upload_mission(MissionPlan(items)))
    await done(action.arm)
    # Without a take-off in it, a mission begins with one to `take_off_m` of mavlink.toml.
    await done(mission.start_mission)
    async for progress in mission.subscribe_mission_progress():
        print(f"{progress.current} of {progress.total} waypoints", flush=True)
        if progress.current == progress.total:
            break
    await done(action.land)
    await first(telemetry.subscribe_landed_state(), lambda state: int(state) == ON_GROUND)
    # The landing is over when the rotor has stopped.
    await first(telemetry.subscribe_flight_mode(), lambda mode: int(mode) == HOLD)
    await done(action.disarm)
    print("landed", flush=True)


async def main(port="14540"):
    config = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(config) as mavsdk:
        await mavsdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        await fly(await mavsdk.first_autopilot(timeout_s=30))


if __name__ == "__main__":
    asyncio.run(main(*sys.argv[1:]))
