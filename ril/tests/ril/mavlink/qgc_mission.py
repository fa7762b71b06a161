"""A mission by pymavlink in the order in which QGroundControl (its source of August 2026) sends, starts, pauses and reads it:
`qgc_mission.py PORT`."""

import struct
import time

from pymavlink_station import LIMIT_S, looks, mavutil, seen, until, vehicle

NAN = float("nan")
ABOVE_HOME, NO_PLACE = 3, 2
reached = []


def note_reached(message):
    if message.get_type() == "MISSION_ITEM_REACHED":
        reached.append(message.seq)


looks.append(note_reached)


def is_type(name):
    return lambda message: message.get_type() == name


def command(number, *params):
    vehicle.mav.command_long_send(1, 1, number, 0, *params, *[0] * (7 - len(params)))
    is_answer = lambda one: one.get_type() == "COMMAND_ACK" and one.command == number and one.result != 5  # noqa: E731
    return until(f"the answer to {number}", is_answer).result


def mode(name):
    until(name, lambda message: message.get_type() == "HEARTBEAT" and vehicle.flightmode == name)


def set_mode(name):
    """SET_MODE has no answer: QGroundControl looks at the heartbeats of 1.3 s, and sends it again."""
    give_up = time.monotonic() + LIMIT_S
    next_at = 0.0
    while vehicle.flightmode != name:
        assert time.monotonic() < give_up, name
        if time.monotonic() >= next_at:
            next_at = time.monotonic() + 1.3
            vehicle.set_mode(name)
        until("anything", lambda message: True)


def item(seq, frame, number, params, x, y, z):
    return (1, 1, seq, frame, number, 1 if seq == 0 else 0, 1, *params, x, y, z, 0)


def upload(items):
    """Count, then what is asked for, until the answer. A machine that stalls is too late with an item: then all of it again."""
    vehicle.mav.mission_count_send(1, 1, len(items), 0)
    while True:
        message = until("the next question", lambda one: one.get_type() in ("MISSION_REQUEST_INT", "MISSION_ACK"))
        if message.get_type() == "MISSION_ACK" and message.type == mavutil.mavlink.MAV_MISSION_OPERATION_CANCELLED:
            vehicle.mav.mission_count_send(1, 1, len(items), 0)
            continue
        if message.get_type() == "MISSION_ACK":
            return message
        vehicle.mav.mission_item_int_send(*items[message.seq])


def download():
    vehicle.mav.mission_request_list_send(1, 1, 0)
    count = until("a count", is_type("MISSION_COUNT"))
    items = []
    for seq in range(count.count):
        vehicle.mav.mission_request_int_send(1, 1, seq, 0)
        items.append(until("an item", lambda one: one.get_type() == "MISSION_ITEM_INT" and one.seq == seq))
    vehicle.mav.mission_ack_send(1, 1, 0, 0)
    return items


until("a heartbeat", is_type("HEARTBEAT"))
until("telemetry, which comes to stations that are known", is_type("ATTITUDE"))
assert command(512, mavutil.mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION) == 0
version = until("the version", lambda message: "AUTOPILOT_VERSION" in seen)
assert seen["AUTOPILOT_VERSION"].capabilities & mavutil.mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
position = until("a position", is_type("GLOBAL_POSITION_INT"))
for mission_type in (0, 1, 2):
    vehicle.mav.mission_request_list_send(1, 1, mission_type)
    count = until("a count", lambda one: one.get_type() == "MISSION_COUNT" and one.mission_type == mission_type)
    assert count.count == 0, count

lat, lon = position.lat, position.lon
items = [
    item(0, ABOVE_HOME, 22, (0, 0, 0, NAN), 0, 0, 12.0),
    item(1, ABOVE_HOME, 16, (0, 0, 0, NAN), lat + 3_000, lon, 12.0),
    item(2, NO_PLACE, 178, (1, 6.0, -1, 0), 0, 0, 0.0),
    item(3, ABOVE_HOME, 16, (2, 0, 0, NAN), lat + 6_000, lon, 15.3),
    item(4, NO_PLACE, 20, (0, 0, 0, 0), 0, 0, 0.0),
]
answer = upload(items)
assert (answer.type, answer.mission_type, answer.target_system) == (0, 0, 255), answer
found = download()
for sent, one in zip(items, found, strict=True):
    bits = lambda *numbers: struct.pack(f"<{len(numbers)}f", *numbers)  # noqa: E731
    assert bits(one.param1, one.param2, one.param3, one.param4, one.z) == bits(*sent[7:11], sent[13]), one
    assert (one.seq, one.frame, one.command, one.current, one.autocontinue, one.x, one.y) == sent[2:7] + sent[11:13], one

# What cannot be flown is refused with the parameter, and the mission of before stays.
no_height = [items[0], item(1, ABOVE_HOME, 16, (0, 0, 0, NAN), lat, lon, NAN)]
assert upload(no_height).type == mavutil.mavlink.MAV_MISSION_INVALID_PARAM7
assert upload([item(0, ABOVE_HOME, 18, (2, 0, 9, 0), lat, lon, 9.0)]).type == mavutil.mavlink.MAV_MISSION_UNSUPPORTED
assert [str(one) for one in download()] == [str(one) for one in found]

# Chosen, then armed.
set_mode("MISSION")
assert command(400, 1) == 0
until("the first item", lambda message: 0 in reached)
until("the second item", lambda message: 1 in reached)
assert upload(items).type == mavutil.mavlink.MAV_MISSION_DENIED
# Pause, in two halves.
vehicle.mav.command_int_send(1, 1, 0, 192, 0, 0, -1, 0, 0, NAN, 2**31 - 1, 2**31 - 1, NAN)
mode("LOITER")
current = until("a paused mission", lambda one: one.get_type() == "MISSION_CURRENT" and one.mission_state == 4)
assert current.total == 5, current
set_mode("MISSION")
until("the last item", lambda message: 4 in reached)
until("the ground", lambda one: one.get_type() == "EXTENDED_SYS_STATE" and one.landed_state == 1)
until("its end", lambda one: one.get_type() == "MISSION_CURRENT" and one.mission_state == 5)
assert reached == [0, 1, 2, 3, 4], reached
vehicle.mav.mission_clear_all_send(1, 1, 0)
assert until("the answer", is_type("MISSION_ACK")).type == 0
assert download() == []
print("all is well")
