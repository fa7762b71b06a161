"""A module in Python that serves a request of its own, and a program that sends it.

    gripper.py serve            opens and closes until SIGINT or SIGTERM
    gripper.py move WIDTH_M     exit code 0 when the gripper is there
"""

import ctypes
import math
import signal
import sys

import hero_ril

KEY = "gripper/move"
WIDEST_M = 0.1
STEP_M = 0.001
STEP_S = 0.01


class Move(ctypes.Structure):
    """The request: begins with `request_id`, has no padding."""

    _fields_ = [("request_id", ctypes.c_uint64), ("width_m", ctypes.c_double)]

    @staticmethod
    def type_name():
        return "gripper.Move.v1"


def step(width_m, to_m):
    """One step towards `to_m`."""
    left_m = to_m - width_m
    return to_m if abs(left_m) <= STEP_M else width_m + math.copysign(STEP_M, left_m)


def serve(robot):
    server = robot.serve(KEY, Move)
    print("serving")
    current, width_m = None, 0.0
    while True:
        order = server.receive(STEP_S if current else 1.0)
        if order is not None and current is not None:
            order.refuse("busy")
        elif order is not None and not 0 <= order.data.width_m <= WIDEST_M:
            order.refuse("out-of-range")
        elif order is not None:
            order.accept()
            current = order
        elif current is not None and not current.is_vanished:
            width_m = step(width_m, current.data.width_m)
            is_there = width_m == current.data.width_m
            current.report("done" if is_there else "progress", value=width_m, value_valid=1)
        if current is not None and not current.is_open:
            if current.is_vanished:
                print("given up")
            current = None


def move(robot, width_m):
    for report in robot.send(KEY, Move(width_m=width_m)):
        print(f"{report.stage}: {report.raw.value:.3f} m")


def end(*_):
    raise KeyboardInterrupt


def main():
    signal.signal(signal.SIGTERM, end)
    with hero_ril.Robot(name="gripper-python") as robot:
        if sys.argv[1:2] == ["serve"]:
            serve(robot)
        else:
            move(robot, float(sys.argv[2]))


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        pass
    except hero_ril.RilError as error:
        sys.exit(str(error))
