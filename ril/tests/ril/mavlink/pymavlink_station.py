"""A station by pymavlink, which has messages and checksums of its own, for the judges beside this file. The first word of their command
lines is its port."""

import os
import sys
import time

os.environ["MAVLINK20"] = "1"
os.environ["MAVLINK_DIALECT"] = "development"
from pymavlink import mavutil  # noqa: E402

LIMIT_S = 90
vehicle = mavutil.mavlink_connection(f"udpin:127.0.0.1:{sys.argv[1]}", source_system=255, source_component=190)
# The newest message of each type.
seen = {}
# What looks at each message.
looks = []
last_beat = 0.0


def until(what, is_right, limit_s=LIMIT_S):
    """The first message that is right; the station stays there meanwhile."""
    global last_beat
    give_up = time.monotonic() + limit_s
    while time.monotonic() < give_up:
        if vehicle.target_system and time.monotonic() >= last_beat + 0.5:
            last_beat = time.monotonic()
            vehicle.mav.heartbeat_send(6, 8, 0, 0, 4)
        message = vehicle.recv_match(blocking=True, timeout=0.5)
        if message is None:
            continue
        # pymavlink 2.4.50 has no FUEL_STATUS, and does not say of it whether it is signed.
        if message.get_type() == "UNKNOWN_371":
            continue
        assert message.get_type() != "BAD_DATA" and not message.get_type().startswith("UNKNOWN"), message
        seen[message.get_type()] = message
        for look in looks:
            look(message)
        if is_right(message):
            return message
    sys.exit(f"{what} did not come")
