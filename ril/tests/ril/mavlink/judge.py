"""A flight by pymavlink: `judge.py PORT`."""

import struct

from pymavlink_station import mavutil, seen, until, vehicle

NAN = float("nan")


def command(number, *params):
    params = list(params) + [0] * (7 - len(params))
    vehicle.mav.command_long_send(1, 1, number, 0, *params)
    return answer(number)


def answer(number):
    def is_answer(message):
        return message.get_type() == "COMMAND_ACK" and message.command == number and message.result != 5

    return until(f"the answer to {number}", is_answer).result


def mode(name):
    until(name, lambda message: message.get_type() == "HEARTBEAT" and vehicle.flightmode == name)


def landed_state(state):
    until(f"state {state}", lambda one: one.get_type() == "EXTENDED_SYS_STATE" and one.landed_state == state)


until("a heartbeat", lambda message: message.get_type() == "HEARTBEAT")
assert (vehicle.target_system, seen["HEARTBEAT"].type, seen["HEARTBEAT"].autopilot) == (1, 4, 12), seen
expected = {
    "ATTITUDE", "GLOBAL_POSITION_INT", "LOCAL_POSITION_NED", "VFR_HUD", "ALTITUDE", "GPS_RAW_INT", "SYS_STATUS",
    "BATTERY_STATUS", "EXTENDED_SYS_STATE", "HOME_POSITION", "CURRENT_MODE",
}
until("all streams", lambda message: expected <= seen.keys())
position, home = seen["GLOBAL_POSITION_INT"], seen["HOME_POSITION"]
assert abs(position.lat - home.latitude) < 1000 and abs(position.relative_alt) < 3000, (position, home)
assert 20_000 < seen["SYS_STATUS"].voltage_battery < 30_000, seen["SYS_STATUS"]
assert seen["GPS_RAW_INT"].fix_type >= 3, seen["GPS_RAW_INT"]

for message in (mavutil.mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION, 435):
    assert command(512, message) == 0
until("the version", lambda message: "AUTOPILOT_VERSION" in seen and "AVAILABLE_MODES" in seen)
assert command(511, 31, 50_000) == 0
until("quaternions", lambda message: message.get_type() == "ATTITUDE_QUATERNION")

vehicle.mav.param_request_list_send(1, 1)
values = {}


def has_all(message):
    if message.get_type() == "PARAM_VALUE":
        values[message.param_id] = message
    return values and len(values) == values["MIS_TAKEOFF_ALT"].param_count


until("all parameters", has_all)
assert values["DSP_CRUISE_MPS"].param_type == 9 and values["DSP_STATUS_MS"].param_type == 6, values
assert struct.unpack("i", struct.pack("f", values["SYS_HAS_MAG"].param_value)) == (0,), values


def set_parameter(name, value, error):
    """Sets it; gives what comes of it."""
    vehicle.mav.param_set_send(1, 1, name.encode(), value, 9)
    what = "PARAM_ERROR" if error else "PARAM_VALUE"
    return until(f"{what} of {name}", lambda one: one.get_type() == what and one.param_id == name)


assert set_parameter("DSP_CRUISE_MPS", 6.5, False).param_value == 6.5
assert set_parameter("DSP_CRUISE_MPS", 99.0, True).error == 2
assert set_parameter("MIS_TAKEOFF_ALT", 8.0, False).param_value == 8.0

# A client that answers in the old form of items is told so, and one that asks in the old form gets the one form that there is.
vehicle.mav.mission_count_send(1, 1, 1, 0)
until("a question", lambda one: one.get_type() == "MISSION_REQUEST_INT")
vehicle.mav.mission_item_send(1, 1, 0, 3, 22, 0, 1, 0, 0, 0, NAN, 0, 0, 10.0, 0)
assert until("an answer", lambda one: one.get_type() == "MISSION_ACK").type == 3
until("the reason", lambda one: one.get_type() == "STATUSTEXT" and one.text.startswith("MISSION_ITEM is not taken"))
vehicle.mav.mission_count_send(1, 1, 1, 0)
until("a question", lambda one: one.get_type() == "MISSION_REQUEST_INT")
vehicle.mav.mission_item_int_send(1, 1, 0, 3, 22, 0, 1, 0, 0, 0, NAN, 0, 0, 10.0, 0)
assert until("an answer", lambda one: one.get_type() == "MISSION_ACK").type == 0
vehicle.mav.mission_request_list_send(1, 1, 0)
until("a number", lambda one: one.get_type() == "MISSION_COUNT" and one.count == 1)
vehicle.mav.mission_request_send(1, 1, 0, 0)
assert until("an item", lambda one: one.get_type() == "MISSION_ITEM_INT").z == 10.0

assert command(22, NAN, 0, 0, NAN, NAN, NAN, NAN) == 0
landed_state(2)
assert command(400, 0, 21196) == 2, "kill in the air"
vehicle.mav.command_int_send(1, 1, 6, 192, 0, 0, -1, 0, 0, NAN, position.lat + 300_000, position.lon, 15.0)
assert answer(192) == 0
mode("OFFBOARD")
vehicle.set_mode("LOITER")
mode("LOITER")
assert command(20) == 0, "return"
mode("RTL")
landed_state(1)
print("all is well")
