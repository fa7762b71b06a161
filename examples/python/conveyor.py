"""A conveyor belt: `Drive` publishes how it runs and serves requests for its speed, `Counter` reads where it is. No helicopter is in it;
`test_conveyor.py` tests it with the fixtures of `hero_ril.testing`."""

import ctypes
import math
import time

import hero_ril

BELT, SPEED = "conveyor/belt", "conveyor/speed"
PERIOD_S = 0.02


class Belt(ctypes.Structure):
    _fields_ = [
        ("sequence", ctypes.c_uint64),
        ("epoch_ns", ctypes.c_uint64),
        ("speed_mps", ctypes.c_double),
        ("moved_m", ctypes.c_double),
    ]

    @staticmethod
    def type_name():
        return "conveyor.Belt.v1"


class SetSpeed(ctypes.Structure):
    _fields_ = [("request_id", ctypes.c_uint64), ("speed_mps", ctypes.c_double)]

    @staticmethod
    def type_name():
        return "conveyor.SetSpeed.v1"


class Drive:
    def __init__(self, robot):
        self.belt = robot.advertise(BELT, Belt)
        self.orders = robot.serve(SPEED, SetSpeed)
        self.speed_mps = self.moved_m = 0.0

    def step(self, seconds):
        """Serves what has come, moves the belt for so long, and publishes."""
        while (order := self.orders.receive(0)) is not None:
            if 0 <= order.data.speed_mps <= 3:
                self.speed_mps = order.data.speed_mps
                order.done()
            else:
                order.refuse("out-of-range")
        self.moved_m += self.speed_mps * seconds
        self.belt.publish(Belt(speed_mps=self.speed_mps, moved_m=self.moved_m))


class Counter:
    def __init__(self, robot):
        self.belt = robot.subscribe(BELT, Belt)
        self.moved_m = self.before_m = 0.0

    def wait_for(self, metres, timeout=60.0):
        """Waits until the belt has moved so far, over restarts of its drive, and says how many samples that took."""
        while self.moved_m < metres:
            sample = self.belt.receive(timeout)
            if sample is None:
                raise TimeoutError("the belt stands still")
            # What is no number is a fault of the drive; what goes back is its new beginning.
            if math.isfinite(sample.moved_m):
                self.moved_m += max(0.0, sample.moved_m - self.before_m)
                self.before_m = sample.moved_m
        return self.belt.losses.received


def main():
    with hero_ril.Robot(name="conveyor") as robot:
        drive = Drive(robot)
        print("ready", flush=True)
        while True:
            time.sleep(PERIOD_S)
            drive.step(PERIOD_S)


if __name__ == "__main__":
    main()
