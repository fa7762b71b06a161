"""The names of the robot's own topics. Wherever a topic is named, each of its names is understood, as by `ril echo`."""

# The key in shared memory, the name in a recording without the robot, the short name.
_OWN = [
    ("dsp_telemetry", "dsp/telemetry", "dsp"),
    ("hero_telemetry", "hero/telemetry", "hero"),
    ("module_state", "bridge/state", "state"),
]

KEYS = {name: names[0] for names in _OWN for name in names}
IN_RECORDINGS = {name: names[1] for names in _OWN for name in names}
