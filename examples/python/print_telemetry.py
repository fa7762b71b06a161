"""Prints telemetry until Ctrl+C, or so many samples: print_telemetry.py [COUNT]"""

import itertools
import sys

import hero_ril


def main(count=None):
    with hero_ril.Robot(name="print-telemetry") as robot:
        telemetry = robot.telemetry()
        print("subscribed", file=sys.stderr, flush=True)
        for sample in itertools.islice(telemetry, count):
            lost = telemetry.losses.lost
            print(f"{sample.sequence} {sample.geodetic.altitude_m:.2f} m, flying {sample.flying}, {lost} lost", flush=True)


if __name__ == "__main__":
    try:
        main(*map(int, sys.argv[1:]))
    except KeyboardInterrupt:
        pass
    except hero_ril.RilError as error:
        sys.exit(str(error))
