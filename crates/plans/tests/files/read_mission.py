"""Prints the items of a mission file, one JSON list a line: index, frame, command, seven parameters, autocontinue.

A QGC WPL file is read by pymavlink's own loader. For a .plan, pymavlink has none: its items are taken from the members that
QGroundControl documents. A number that is none is null.
"""

import json
import math
import sys


def of_waypoints(path):
    from pymavlink import mavwp

    loader = mavwp.MAVWPLoader()
    loader.load(path)
    for index in range(loader.count()):
        item = loader.wp(index)
        yield [
            item.seq, item.frame, item.command,
            item.param1, item.param2, item.param3, item.param4, item.x, item.y, item.z,
            item.autocontinue,
        ]


def of_plan(path):
    with open(path, encoding="utf-8") as file:
        mission = json.load(file)["mission"]
    index = 0
    for item in mission["items"]:
        parts = [item]
        if item["type"] == "ComplexItem":
            parts = item.get("TransectStyleComplexItem", {}).get("Items", [])
        for part in parts:
            if part["type"] != "SimpleItem":
                continue
            yield [index, part["frame"], part["command"], *part["params"], int(part["autoContinue"])]
            index += 1


def plain(value):
    return None if isinstance(value, float) and math.isnan(value) else value


path = sys.argv[1]
for row in of_plan(path) if path.endswith(".plan") else of_waypoints(path):
    print(json.dumps([plain(value) for value in row]))
