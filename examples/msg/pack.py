# Made by `ril topic generate` from Pack.msg: do not edit.
import ctypes


class Cell(ctypes.Structure):
    _fields_ = [
        ("voltage_v", ctypes.c_float),
        ("temperature_c", ctypes.c_float),
    ]

    @staticmethod
    def type_name() -> str:
        return "battery_watch.Cell.v1"


assert ctypes.sizeof(Cell) == 8
assert Cell.voltage_v.offset == 0
assert Cell.temperature_c.offset == 4


class Pack(ctypes.Structure):
    _fields_ = [
        ("sequence", ctypes.c_uint64),
        ("epoch_ns", ctypes.c_uint64),
        ("charge", ctypes.c_double),
        ("cells", Cell * 6),
    ]

    @staticmethod
    def type_name() -> str:
        return "battery_watch.Pack.v1"


assert ctypes.sizeof(Pack) == 72
assert Pack.sequence.offset == 0
assert Pack.epoch_ns.offset == 8
assert Pack.charge.offset == 16
assert Pack.cells.offset == 24


Pack.SCHEMA = """\
# The flight battery, cell by cell.
#
# Layout: battery_watch.Pack.v1

# Counts the samples of this publisher from 1.
uint64 sequence
# When the publisher began, host monotonic ns. [ns]
uint64 epoch_ns
# Charge that is left, 0 to 1.
float64 charge
# From the negative pole.
battery_watch_msgs/Cell[6] cells
================================================================================
MSG: battery_watch_msgs/Cell
# One cell.
#
# Layout: battery_watch.Cell.v1

# Under load. [V]
float32 voltage_v
# At its surface. [deg C]
float32 temperature_c
"""
