"""Compares a decoded message with expected values from JSON."""

import math
import struct


def is_equal(value, expected):
    if expected is None:
        return math.isnan(value)
    if isinstance(expected, float):
        # JSON has the shortest text of a number with 32 bits, which is another number with 64.
        return value == expected or value == struct.unpack("f", struct.pack("f", expected))[0]
    return value == expected


def differences(message, expected, path=""):
    """What differs between a message and the expected values, as texts."""
    for name, want in expected.items():
        field = f"{path}{name}"
        if not hasattr(message, name):
            yield f"{field} is missing"
            continue
        value = getattr(message, name)
        if isinstance(want, dict):
            yield from differences(value, want, f"{field}.")
        elif isinstance(want, list):
            values = list(value)
            pairs = enumerate(zip(values, want))
            if len(values) != len(want):
                yield f"{field} has {len(values)} elements, not {len(want)}"
            for index, (one, other) in pairs:
                if isinstance(other, dict):
                    yield from differences(one, other, f"{field}[{index}].")
                elif not is_equal(one, other):
                    yield f"{field}[{index}] is {one}, not {other}"
        elif not is_equal(value, want):
            yield f"{field} is {value}, not {want}"
