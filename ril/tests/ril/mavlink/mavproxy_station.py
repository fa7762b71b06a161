"""A station by MAVProxy, as somebody types it, for the judges beside this file. The first word of their command lines is its port."""

import pathlib
import queue
import subprocess
import sys
import threading
import time

LIMIT_S = 90
# After a standstill of this machine MAVProxy gives a transfer up and does not begin it again.
AGAIN_S = 10

program = pathlib.Path(sys.executable).with_name("mavproxy.py")
modules = "fence,wp,param,mode,arm,cmdlong"
words = [f"--master=udpin:127.0.0.1:{sys.argv[1]}", "--mav20", f"--default-modules={modules}"]
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


def until(text, again=None):
    """The next line with this text; those before are dropped. Prompts can stand before it, and behind it. A command can be typed again."""
    begun = time.monotonic()
    typed = begun
    while time.monotonic() < begun + LIMIT_S:
        if again and time.monotonic() > typed + AGAIN_S:
            command(again)
            typed = time.monotonic()
        try:
            line = lines.get(timeout=1.0)
        except queue.Empty:
            continue
        if text in line:
            return line
    sys.exit(f"{text} did not come")


def ask(text, answer):
    """Types a command that may be repeated until the answer comes."""
    command(text)
    return until(answer, again=text)


def plan(name, items):
    """A file as MAVProxy and Mission Planner write it, of items with frame, command, four parameters, place and height."""
    rows = ["QGC WPL 110"]
    for number, item in enumerate(items):
        rows.append("\t".join(str(value) for value in (number, 0, *item, 1)))
    pathlib.Path(name).write_text("\n".join(rows) + "\n")


def end():
    mavproxy.kill()
    print("all is well", flush=True)


# It is told this when its first heartbeat has come.
until("`zero_above_sea_m` is not set")
