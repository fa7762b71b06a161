"""A station by MAVSDK, for the judges beside this file. The first word of their command lines is its port."""

import asyncio
import sys

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk

LIMIT_S = 90
ON_GROUND, IN_AIR = 1, 2
HOLD, MISSION = 3, 4


async def until(what, values, is_right):
    """The first value that is right."""

    async def look():
        async for value in values:
            if is_right(value):
                return value

    try:
        return await asyncio.wait_for(look(), LIMIT_S)
    except TimeoutError:
        sys.exit(f"{what} did not come")


def is_of_time(error):
    """Whether MAVSDK gave up, or was told that the order takes longer: it waits for 1.5 s, and a machine can stand still for longer."""
    return any(word in str(error) for word in ("BUSY", "TIMEOUT"))


async def done(what, order):
    """Gives the order, again while there is no answer in time. One that came late is perhaps refused then: what follows shows the outcome."""
    for is_again in (False, True, True, True):
        try:
            return await asyncio.wait_for(order(), LIMIT_S)
        except Exception as error:  # noqa: BLE001 each plugin has its own
            if not is_of_time(error):
                if is_again:
                    return None
                raise
            print(f"{what}: {error}", flush=True)
            # A command that comes again within 2.5 s counts as a copy.
            await asyncio.sleep(3.0)
    return None


async def refused(what, order, how="DENIED"):
    """The order must end with an error that says so."""
    for _ in range(4):
        try:
            await asyncio.wait_for(order(), LIMIT_S)
        except Exception as error:  # noqa: BLE001 each plugin has its own
            if how in str(error):
                return
            assert is_of_time(error), f"{what}: {error}"
            await asyncio.sleep(3.0)
        else:
            break
    sys.exit(f"{what} was not refused")


def judge(fly):
    """Runs `fly` with the vehicle, when it has appeared."""

    async def main():
        config = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
        async with Mavsdk(config) as mavsdk:
            await mavsdk.add_any_connection(f"udpin://127.0.0.1:{sys.argv[1]}")
            await fly(await mavsdk.first_autopilot(timeout_s=LIMIT_S))

    asyncio.run(main())
    print("all is well", flush=True)
