"""A geofence by MAVProxy, as somebody types it: `mavproxy_fence.py PORT`. The last one stays in force."""

import pathlib
import queue
import subprocess
import sys
import threading
import time

LIMIT_S = 90
# Corners of an area to stay outside, and a circle.
CORNERS = [(37.4200000, -6.0100000), (37.4200000, -6.0090000), (37.4210000, -6.0090000), (37.4210000, -6.0100000)]
CIRCLE = (37.4300000, -6.0200000)

program = pathlib.Path(sys.executable).with_name("mavproxy.py")
words = [f"--master=udpin:127.0.0.1:{sys.argv[1]}", "--mav20", "--default-modules=fence,mode,arm,cmdlong"]
mavproxy = subprocess.Popen(
    [sys.executable, "-u", program, *words],
    stdin=subprocess.PIPE,
    stdout=subprocess.PIPE,
    stderr=subprocess.STDOUT,
    text=True,
    bufsize=1,
)
lines = queue.Queue()


def read():
    for line in mavproxy.stdout:
        print(line, end="", flush=True)
        lines.put(line)


threading.Thread(target=read, daemon=True).start()


def command(text):
    mavproxy.stdin.write(text + "\n")


def until(text):
    """Waits for a line with this text; those before are dropped."""
    give_up = time.monotonic() + LIMIT_S
    while time.monotonic() < give_up:
        try:
            if text in lines.get(timeout=1.0):
                return
        except queue.Empty:
            pass
    sys.exit(f"{text} did not come")


def fence(name, areas):
    """A file as MAVProxy and Mission Planner write it."""
    rows = ["QGC WPL 110"]
    for number, (kind, param1, (latitude, longitude)) in enumerate(areas):
        rows.append(f"{number}\t0\t0\t{kind}\t{param1}\t0\t0\t0\t{latitude}\t{longitude}\t0\t1")
    pathlib.Path(name).write_text("\n".join(rows) + "\n")


fence("areas.txt", [*((5002, 4, corner) for corner in CORNERS), (5004, 30, CIRCLE)])
fence("circle.txt", [(5004, 25, CIRCLE)])
# A return point, then the corners and the first one again: the form of before.
old = [(37.4205, -6.0095), *CORNERS, CORNERS[0]]
pathlib.Path("old.txt").write_text("".join(f"{latitude} {longitude}\n" for latitude, longitude in old))

# It is told this when its first heartbeat has come.
until("`zero_above_sea_m` is not set")
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
mavproxy.kill()
print("all is well", flush=True)
