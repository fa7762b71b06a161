"""Takes off, flies to a point north of here and lands: mission.py [ALTITUDE_M]"""

import math
import sys

import hero_ril


def follow(request, what, telemetry):
    for report in request:
        print(f"{what}: {report.stage}")
        sample = telemetry.latest()
        if sample is not None:
            print(f"{sample.sequence} {sample.geodetic.altitude_m:.2f} m, flying {sample.flying}")
    return request


def main(altitude_m=10.0):
    with hero_ril.Robot(name="python-mission") as robot:
        telemetry = robot.telemetry()
        here = telemetry.receive(timeout=5)
        if here is None:
            sys.exit("no telemetry: start `ril run status`")
        latitude_deg = math.degrees(here.geodetic.latitude_rad)
        longitude_deg = math.degrees(here.geodetic.longitude_rad)
        north = (latitude_deg + 1e-4, longitude_deg, here.geodetic.altitude_m + altitude_m)
        # Each is a step behind the one before: not taken when somebody else has ordered something meanwhile.
        start = follow(robot.start(), "start", telemetry)
        take_off = follow(robot.take_off(altitude_m, after=start), "take off", telemetry)
        go_to = follow(robot.go_to(north, after=take_off), "go to", telemetry)
        follow(robot.land(after=go_to), "land", telemetry)


if __name__ == "__main__":
    try:
        main(*map(float, sys.argv[1:]))
    except hero_ril.RilError as error:
        sys.exit(str(error))
