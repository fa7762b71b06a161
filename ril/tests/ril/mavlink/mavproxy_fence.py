"""A geofence by MAVProxy: `mavproxy_fence.py PORT`. The last one stays in force."""

import pathlib

from mavproxy_station import command, end, plan, until

# Corners of an area to stay outside, and a circle.
CORNERS = [(37.4200000, -6.0100000), (37.4200000, -6.0090000), (37.4210000, -6.0090000), (37.4210000, -6.0100000)]
CIRCLE = (37.4300000, -6.0200000)


def area(kind, param1, place):
    return (0, kind, param1, 0, 0, 0, *place, 0)


plan("areas.txt", [*(area(5002, 4, corner) for corner in CORNERS), area(5004, 30, CIRCLE)])
plan("circle.txt", [area(5004, 25, CIRCLE)])
# A return point, then the corners and the first one again: the form of before.
old = [(37.4205, -6.0095), *CORNERS, CORNERS[0]]
pathlib.Path("old.txt").write_text("".join(f"{latitude} {longitude}\n" for latitude, longitude in old))

command("fence load areas.txt")
until("its areas: 2, of bridge.toml: 0")
command("fence list")
for latitude, longitude in CORNERS:
    until(f"5002 0 {latitude:.10f} {longitude:.10f}")
# It cuts off what lies behind the seventh digit, and not always what one sees.
until(f"5004 0 {CIRCLE[0]:.10f}")
command("fence clear")
until("no fence of a station is in force")
command("fence list")
until("Requesting 0 fence items")
command("fence load old.txt")
until("the return point of the fence is not used")
until("its areas: 1, of bridge.toml: 0")
until("Got MISSION_ACK: TYPE_FENCE: ACCEPTED")
command("fence disable")
until("is never done over MAVLink")
command("fence load circle.txt")
# A text that was said within five seconds is not said again.
until("Got MISSION_ACK: TYPE_FENCE: ACCEPTED")
end()
