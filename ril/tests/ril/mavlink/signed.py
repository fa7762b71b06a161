"""Signatures by pymavlink, which has its own: `signed.py PORT PASSPHRASE`."""

import hashlib
import os
import sys
import time

os.environ["MAVLINK20"] = "1"
os.environ["MAVLINK_DIALECT"] = "development"
from pymavlink import mavutil  # noqa: E402

LIMIT_S = 80
# As QGroundControl and MAVProxy make it of a passphrase.
key = hashlib.sha256(sys.argv[2].encode()).digest()
vehicle = mavutil.mavlink_connection(f"udpin:127.0.0.1:{sys.argv[1]}", source_system=255, source_component=190)
# Nothing without a right signature gets through here.
vehicle.setup_signing(key, sign_outgoing=True, allow_unsigned_callback=lambda *_: False)
last_beat = 0.0


def until(what, is_right):
    """The first message that is right; the station stays there meanwhile."""
    global last_beat
    give_up = time.monotonic() + LIMIT_S
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
        assert message.get_type() != "BAD_DATA", message
        assert message.get_signed(), message
        if is_right(message):
            return message
    sys.exit(f"{what} did not come")


def answered(number):
    return until(f"the answer to {number}", lambda one: one.get_type() == "COMMAND_ACK" and one.command == number)


until("a heartbeat that is signed", lambda message: message.get_type() == "HEARTBEAT")
# Signatures are taken: telemetry comes to a station that was heard.
until("telemetry", lambda message: message.get_type() == "ATTITUDE")
vehicle.mav.command_long_send(1, 1, 512, 0, 148, 0, 0, 0, 0, 0, 0)
assert answered(512).result == 0
# The same bytes once more are not.
message = vehicle.mav.command_long_encode(1, 1, 512, 0, 242, 0, 0, 0, 0, 0, 0)
recorded = message.pack(vehicle.mav)
vehicle.write(recorded)
assert answered(512).result == 0
for _ in range(3):
    vehicle.write(recorded)
# With another key neither.
right, vehicle.mav.signing.secret_key = vehicle.mav.signing.secret_key, b"\x07" * 32
vehicle.write(message.pack(vehicle.mav))
vehicle.mav.signing.secret_key = right
# A command of a kind that is answered at once ends the row: what was dropped before it got no answer.
vehicle.mav.command_long_send(1, 1, 2000, 0, 0, 0, 0, 0, 0, 0, 0)
count = 0


def is_last(message):
    global count
    count += message.get_type() == "COMMAND_ACK" and message.command == 512
    return message.get_type() == "COMMAND_ACK" and message.command == 2000


until("the last answer", is_last)
assert count == 0, f"{count} recorded commands were answered"
print("all is well")
