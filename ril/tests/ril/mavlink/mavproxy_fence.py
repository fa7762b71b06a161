"""A geofence by MAVProxy: `mavproxy_fence.py PORT`. The last one stays in force."""

import pathlib

from mavproxy_station import ask, end, plan, until

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

ask("fence load areas.txt", "its areas: 2, of bridge.toml: 0")
corners = [f"5002 0 {latitude:.10f} {longitude:.10f}" for latitude, longitude in CORNERS]
ask("fence list", corners[0])
for corner in corners[1:]:
    until(corner)
# It cuts off what lies behind the seventh digit, and not always what one sees.
until(f"5004 0 {CIRCLE[0]:.10f}")
ask("fence clear", "no fence of a station is in force")
ask("fence list", "Requesting 0 fence items")
ask("fence load old.txt", "the return point of the fence is not used")
until("its areas: 1, of bridge.toml: 0")
until("Got MISSION_ACK: TYPE_FENCE: ACCEPTED")
ask("fence disable", "is never done over MAVLink")
# A text that was said within five seconds is not said again.
ask("fence load circle.txt", "Got MISSION_ACK: TYPE_FENCE: ACCEPTED")
end()
