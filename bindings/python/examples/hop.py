"""The consumer of bindings/c/examples/hop.rs in Python: hop.py SAMPLES WARM_UP"""

import statistics
import sys
import time

import hero_ril

samples, warm_up = map(int, sys.argv[1:])
hops = []
with hero_ril.Robot(name="hop-python") as robot:
    for sample in robot.telemetry():
        hops.append((time.monotonic_ns() - sample.received_ns) / 1000)
        if len(hops) == samples:
            break
print(statistics.median(hops[warm_up:]))
