# Made by `ril topic generate` from Pack.msg: do not edit.
from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hero_ril.structs import Array, Struct
else:
    Struct = ctypes.Structure


class Cell(Struct):
    """One cell."""

    voltage_v: float
    """Under load. [V]"""
    temperature_c: float
    """At its surface. [deg C]"""

    if TYPE_CHECKING:
        def __init__(self, voltage_v: float = ..., temperature_c: float = ...) -> None: ...
    else:
        _fields_ = [
            ("voltage_v", ctypes.c_float),
            ("temperature_c", ctypes.c_float),
        ]

    @staticmethod
    def type_name() -> str:
        return "battery_watch.Cell.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(Cell) == 8
    assert Cell.voltage_v.offset == 0
    assert Cell.temperature_c.offset == 4


class Pack(Struct):
    """The flight battery, cell by cell."""

    sequence: int
    """Counts the samples of this publisher from 1."""
    epoch_ns: int
    """When the publisher began, host monotonic ns. [ns]"""
    charge: float
    """Charge that is left, 0 to 1."""
    cells: Array[Cell]
    """From the negative pole."""

    if TYPE_CHECKING:
        def __init__(self, sequence: int = ..., epoch_ns: int = ..., charge: float = ..., cells: Any = ...) -> None: ...
    else:
        _fields_ = [
            ("sequence", ctypes.c_uint64),
            ("epoch_ns", ctypes.c_uint64),
            ("charge", ctypes.c_double),
            ("cells", Cell * 6),
        ]

    @staticmethod
    def type_name() -> str:
        return "battery_watch.Pack.v1"


if not TYPE_CHECKING:
    assert ctypes.sizeof(Pack) == 72
    assert Pack.sequence.offset == 0
    assert Pack.epoch_ns.offset == 8
    assert Pack.charge.offset == 16
    assert Pack.cells.offset == 24


setattr(Pack, "SCHEMA", """\
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
""")
