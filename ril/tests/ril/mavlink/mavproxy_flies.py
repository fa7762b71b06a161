"""Parameters, a mission and modes by MAVProxy: `mavproxy_flies.py PORT`. What it has read of the parameters stays in `mav.parm`."""

import pathlib

from mavproxy_station import command, end, plan, until
from pymavlink.mavutil import px4_map

ABOVE_SEA, NO_PLACE, ABOVE_HOME = 0, 2, 3
# The mission's first waypoint is 111 m from the simulator's start, and the second one a kilometre further.
MISSION = [
    (ABOVE_HOME, 22, 0, 0, 0, 0, 0, 0, 12),
    (ABOVE_HOME, 16, 0, 0, 0, 0, 37.412, -6.001, 12),
    (NO_PLACE, 178, 1, 7, -1, 0, 0, 0, 0),
    (ABOVE_HOME, 16, 0, 0, 0, 0, 37.422, -6.001, 15.5),
    (NO_PLACE, 20, 0, 0, 0, 0, 0, 0, 0),
]


def load(name, answer):
    """Waits for this answer. A machine that stalls is too late with an item: then all of it again."""
    line = "OPERATION_CANCELLED"
    while "OPERATION_CANCELLED" in line:
        command(f"wp load {name}")
        line = until("Got MISSION_ACK: TYPE_MISSION: ")
    assert answer in line, line


def is_in(mode):
    """Waits for a heartbeat with this mode of PX4."""
    _, main, sub = px4_map[mode]
    until(f"custom_mode : {main << 16 | sub << 24},")


def set_mode(mode):
    """As `mode` would send it."""
    command("long DO_SET_MODE {} {} {}".format(*px4_map[mode]))


# It reads all of them by itself when it begins.
until("Received ")
command("param watch DSP_CRUISE_MPS")
command("param set DSP_CRUISE_MPS 6.5")
until("> DSP_CRUISE_MPS=6.500000")
command("param fetch")
until("Requested parameter list")
count = int(until("Received ").partition("Received ")[2].split()[0])
until(f"Saved {count} parameters to mav.parm")
values = dict(row.split() for row in pathlib.Path("mav.parm").read_text().splitlines())
assert len(values) == count, (count, values)
assert (float(values["DSP_CRUISE_MPS"]), float(values["SYS_AUTOSTART"])) == (6.5, 16001.0), values

plan("mission.txt", MISSION)
load("mission.txt", "ACCEPTED")
# ArduPilot's stations write its home as the first item, which is a waypoint to PX4.
plan("home.txt", [(ABOVE_SEA, 16, 0, 0, 0, 0, 37.411, -6.001, 0), *MISSION])
load("home.txt", "UNSUPPORTED_FRAME")
command("wp list")
until(f"Requesting {len(MISSION)} waypoints")
for frame, number, *params, latitude, longitude, height in MISSION:
    shown = " ".join(f"p{place}={value:.1f}" for place, value in enumerate(params, 1))
    until(f"{number} {frame} {latitude:.10f} {longitude:.10f} {height:f} {shown}")

# To a vehicle of PX4 it sends numbers alone, as the base mode.
command("mode RTL")
until("required argument is not a float")
command("mode 4")
until("Got COMMAND_ACK: DO_SET_MODE: DENIED")
command("watch HEARTBEAT")
is_in("LOITER")
command("arm throttle")
until("Got COMMAND_ACK: COMPONENT_ARM_DISARM: ACCEPTED")
set_mode("MISSION")
is_in("MISSION")
until("waypoint 3")
set_mode("LOITER")
until("mission paused: item 4 is the next one")
is_in("LOITER")
set_mode("RTL")
is_in("RTL")
until("land done")
is_in("LOITER")
end()
