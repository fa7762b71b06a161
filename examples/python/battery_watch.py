"""A module in Python: watches the flight battery, and commands a landing when its cells are below a limit."""

import ctypes
import dataclasses

import hero_ril
from hero_ril.structs import TelemetryGroup


class Cells(ctypes.Structure):
    """A topic's struct begins with these two numbers, which the library fills in."""

    _fields_ = [
        ("sequence", ctypes.c_uint64),
        ("epoch_ns", ctypes.c_uint64),
        ("mean_v", ctypes.c_double),
        ("limit_v", ctypes.c_double),
    ]

    @staticmethod
    def type_name():
        return "battery_watch.Cells.v1"


class SetLimit(ctypes.Structure):
    """A request's struct begins with its id."""

    _fields_ = [("request_id", ctypes.c_uint64), ("limit_v", ctypes.c_double)]

    @staticmethod
    def type_name():
        return "battery_watch.SetLimit.v1"


class BatteryWatch(hero_ril.Module):
    name = "battery_watch"
    id = 1001

    @dataclasses.dataclass
    class Config:
        """What can stand in battery_watch.toml."""

        limit_v: float = hero_ril.ranged(3.5, 2.5, 4.2)
        cells: int = hero_ril.ranged(6, 1, 24)

    def open(self):
        self.is_low = False
        self.cells = self.robot.advertise("battery_watch/cells", Cells)
        self.serve("battery_watch/limits", SetLimit, self.set_limit)
        self.on(self.robot.telemetry(), self.look)

    def set_limit(self, order):
        if 2.5 <= order.data.limit_v <= 4.2:
            self.config.limit_v = order.data.limit_v
            order.done()
        else:
            order.refuse("out-of-range")

    def look(self, sample):
        if sample.valid_groups & TelemetryGroup.SUPPLY:
            mean_v = sample.supply.battery_v / self.config.cells
            self.is_low = bool(sample.flying) and mean_v < self.config.limit_v
            self.cells.publish(Cells(mean_v=mean_v, limit_v=self.config.limit_v))

    def step(self):
        # Once for each start. A stop is refused while the helicopter lands.
        if self.is_low and self.is_ready and self.begin(1, "landing", on_stop="refused"):
            try:
                self.on(self.robot.land(preempt=True), self.landing)
            except hero_ril.RilError:
                self.fail(1001)

    def landing(self, report):
        if report.stage == "done":
            self.done()
        elif report.is_final:
            self.fail(1001)


if __name__ == "__main__":
    BatteryWatch.main()
