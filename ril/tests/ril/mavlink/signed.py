"""Signatures by pymavlink, which has its own: `signed.py PORT PASSPHRASE`."""

import functools
import hashlib
import sys

import pymavlink_station
from pymavlink_station import looks, vehicle

until = functools.partial(pymavlink_station.until, limit_s=80)
# As QGroundControl and MAVProxy make it of a passphrase.
key = hashlib.sha256(sys.argv[2].encode()).digest()
# Nothing without a right signature gets through here.
vehicle.setup_signing(key, sign_outgoing=True, allow_unsigned_callback=lambda *_: False)


def is_signed(message):
    assert message.get_signed(), message


looks.append(is_signed)


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
