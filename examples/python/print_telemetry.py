"""Prints the robot's telemetry: PYTHONPATH=ipc-types/layouts python3 examples/python/print_telemetry.py [COUNT]

Ends after COUNT samples, or with Ctrl+C. Exit codes are those of `ril`: 3 when nobody publishes.
"""

import signal
import sys

from hero_consumer import Consumer, NotThere, OtherLayout, is_valid
from hero_ipc import TelemetryGroup


def print_telemetry(count):
    with Consumer("hero_telemetry") as telemetry:
        print("subscribed", file=sys.stderr, flush=True)
        while telemetry.received < count:
            for sample in telemetry.wait():
                altitude = "-"
                if is_valid(sample, TelemetryGroup.GEOGRAPHIC):
                    altitude = f"{sample.geodetic.altitude_m:.2f}"
                print(f"{sample.sequence} {altitude} m, flying {sample.flying}, {telemetry.lost} lost", flush=True)


if __name__ == "__main__":
    # A clean end, so that everything is given back.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    try:
        print_telemetry(int(sys.argv[1]) if len(sys.argv) > 1 else sys.maxsize)
    except KeyboardInterrupt:
        sys.exit(0)
    except NotThere as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(3)
    except OtherLayout as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(1)
