"""Compares our type hashes, message definitions and messages with those of rosbags.

Arguments: a folder with packages of .msg files, and a JSON file:

    {"hashes": {"hero_msgs/msg/HeroTelemetry": "RIHS01_..."},
     "messages": [{"type": "sensor_msgs/msg/Imu", "cdr": "00010000...", "values": {...}}]}
"""

import json
import pathlib
import sys

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import compare

STORES = [Stores.ROS2_IRON, Stores.ROS2_JAZZY, Stores.ROS2_KILTED, Stores.ROS2_LYRICAL]


def main():
    packages, expected = map(pathlib.Path, sys.argv[1:])
    expected = json.loads(expected.read_text())
    wrong = []
    for store in STORES:
        types = get_typestore(store)
        known = set(types.types)
        added = {}
        for path in sorted(packages.glob("*/msg/*.msg")):
            name = f"{path.parts[-3]}/msg/{path.stem}"
            added.update(get_types_from_msg(path.read_text(), name))
        types.register(added)
        for name, value in expected["hashes"].items():
            found = types.hash_rihs01(name)
            if found != value:
                wrong.append(f"{store}: {name} has the hash {found}, not {value}")
        for name in added.keys() - expected["hashes"].keys() - known:
            types.hash_rihs01(name)
        for message in expected["messages"]:
            cdr = bytes.fromhex(message["cdr"])
            name = message["type"]
            decoded = types.deserialize_cdr(cdr, name)
            wrong += [f"{store}: {name}: {problem}" for problem in compare.differences(decoded, message["values"])]
            written = bytes(types.serialize_cdr(decoded, name))
            # rosbags may fill up the end.
            if written[: len(cdr)] != cdr:
                wrong.append(f"{store}: {name} is written as {written.hex()}, not {cdr.hex()}")
    for problem in wrong:
        print(problem, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
