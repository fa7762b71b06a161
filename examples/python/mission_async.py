"""The same with asyncio: prints telemetry while it takes off and lands: mission_async.py [ALTITUDE_M]"""

import asyncio
import sys

import hero_ril


async def print_telemetry(robot):
    async for sample in robot.telemetry():
        print(f"{sample.sequence} {sample.geodetic.altitude_m:.2f} m, flying {sample.flying}")


async def main(altitude_m=10.0):
    with hero_ril.Robot(name="python-async") as robot:
        printing = asyncio.create_task(print_telemetry(robot))
        start = robot.start()
        await start
        take_off = robot.take_off(altitude_m, after=start)
        async for report in take_off:
            print(f"take off: {report.stage}")
        print(f"land: {(await robot.land(after=take_off)).stage}")
        printing.cancel()


if __name__ == "__main__":
    try:
        asyncio.run(main(*map(float, sys.argv[1:])))
    except hero_ril.RilError as error:
        sys.exit(str(error))
