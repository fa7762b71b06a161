"""Reads a robot's relay with Zenoh's own library for Python and docs/network.md alone: its keys, its messages, its samples.

As a station that only watches it pings, asks what the robot has, reads each schema to its end, and decodes samples of one topic by
that schema. Then it receives the same topic under the key of ROS 2. Once as a peer and once as a client, because a node of ROS 2
may be either. What differs from what is expected is printed; the exit code is 1 then.
"""

import argparse
import faulthandler
import json
import queue
import struct
import sys
import time
import zlib

import zenoh
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from compare import differences

# A program that hangs ends after this time, and says where it was.
WATCHDOG_S = 120
VERSION = 4
STATION = "watcher"
CDR = bytes([0, 1, 0, 0])


def varint(number):
    encoded = bytearray()
    while number > 0x7F:
        encoded.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes(encoded + bytes([number]))


class Fields:
    """The fields of a message, in order, as postcard writes them."""

    def __init__(self, message):
        if message[0] != VERSION:
            raise ValueError(f"version {message[0]}, not {VERSION}")
        self.rest = message[1:]

    @classmethod
    def without_version(cls, text):
        return cls(bytes([VERSION]) + text)

    def number(self):
        value = shift = 0
        while True:
            byte, self.rest = self.rest[0], self.rest[1:]
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value

    def bytes(self):
        length = self.number()
        field, self.rest = self.rest[:length], self.rest[length:]
        return field

    def numbers(self, names):
        return {name: self.number() for name in names.split()}

    def end(self):
        if self.rest:
            raise ValueError(f"{len(self.rest)} bytes too many")


def ping(instance):
    # Ask::Ping: station_instance, sent_ns, suspended_ns, wants_latest, late_ms.
    return bytes([VERSION, 0]) + varint(instance) + varint(time.monotonic_ns()) + varint(0) + bytes([1]) + varint(0)


def describe(instance, index, begin):
    return bytes([VERSION, 1]) + varint(instance) + varint(index) + varint(begin)


def answer(told, put, question, variant):
    """Asks until an answer of this kind comes: a question may be lost."""
    while True:
        put(question())
        try:
            fields = Fields(told.get(timeout=1.0))
        except queue.Empty:
            continue
        if fields.number() == variant:
            return fields


def schemas(session, robot):
    """What the robot has: schemas by key, and the instance of its relay."""
    told = queue.Queue()
    subscriber = session.declare_subscriber(f"hero/{robot}/tell/{STATION}", lambda sample: told.put(sample.payload.to_bytes()))
    put = lambda message: session.put(f"hero/{robot}/ask/{STATION}", message)
    pong = answer(told, put, lambda: ping(7), 0)
    names = "robot_instance station_instance ping_sent_ns ping_suspended_ns received_ns sent_ns suspended_ns session pages"
    pong = pong.numbers(names)
    if pong["station_instance"] != 7 or pong["session"] != 0:
        raise ValueError(f"a pong for another station, or one that may command: {pong}")
    found = {}
    for index in range(pong["pages"]):
        packed, size = b"", None
        while size is None or len(packed) < size:
            part = answer(told, put, lambda: describe(pong["robot_instance"], index, len(packed)), 1)
            part.number()
            at, size, begin, piece = part.number(), part.number(), part.number(), part.bytes()
            part.end()
            if (at, begin) == (index, len(packed)):
                packed += piece
        page = Fields.without_version(zlib.decompress(packed))
        for _ in range(page.number()):
            key, takes_requests, text = page.bytes().decode(), page.number(), page.bytes().decode()
            found[key] = (text, bool(takes_requests))
        page.end()
    subscriber.undeclare()
    return found, pong["robot_instance"]


def decoder(text, type_name):
    """A function that decodes CDR by a schema of ours."""
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(text, type_name))
    return lambda cdr: store.deserialize_cdr(cdr, type_name)


def samples(session, key):
    arrived = queue.Queue()
    subscriber = session.declare_subscriber(key, arrived.put)
    return subscriber, arrived


def check(session, expected):
    robot, key, type_name = (expected[name] for name in ("robot", "key", "type"))
    found, instance = schemas(session, robot)
    if key not in found or found[key][1]:
        yield f"{key} is not among {sorted(found)}"
        return
    text, _ = found[key]
    decode = decoder(text, type_name)
    subscriber, arrived = samples(session, f"hero/{robot}/topic/{key}")
    last = 0
    for _ in range(3):
        sample = arrived.get(timeout=expected["timeout_s"])
        payload = sample.payload.to_bytes()
        if payload[:4] != CDR:
            yield f"a sample begins with {payload[:4].hex()}"
        header = Fields(sample.attachment.to_bytes())
        numbers = header.numbers("robot_instance number left_out lost")
        header.end()
        if numbers["robot_instance"] != instance or numbers["number"] <= last:
            yield f"{numbers} after the number {last}, of the relay {instance}"
        last = numbers["number"]
        yield from differences(decode(payload), expected["values"])
    subscriber.undeclare()
    # The same for ROS 2: sequence, Unix time, the length of the publisher's id, the id.
    subscriber, arrived = samples(session, expected["ros2_key"])
    sample = arrived.get(timeout=expected["timeout_s"])
    sequence, _, length = struct.unpack_from("<qqB", sample.attachment.to_bytes())
    if sequence < 1 or length != 16 or len(sample.attachment.to_bytes()) != 33:
        yield f"the attachment of ROS 2 is {sample.attachment.to_bytes().hex()}"
    yield from differences(decode(sample.payload.to_bytes()), expected["values"])
    subscriber.undeclare()


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--endpoint", required=True, help="Zenoh endpoint, such as tcp/127.0.0.1:7447")
    parser.add_argument("--expected", required=True, help="JSON: robot, key, type, ros2_key, timeout_s, values")
    arguments = parser.parse_args()
    faulthandler.dump_traceback_later(WATCHDOG_S, exit=True)
    expected = json.loads(arguments.expected)
    wrong = []
    for mode in ("peer", "client"):
        config = zenoh.Config()
        for key, value in {
            "mode": mode,
            "connect/endpoints": [arguments.endpoint],
            "listen/endpoints": [],
            "scouting/multicast/enabled": False,
        }.items():
            config.insert_json5(key, json.dumps(value))
        with zenoh.open(config) as session:
            wrong += [f"as a {mode}: {problem}" for problem in check(session, expected)]
    for problem in wrong:
        print(problem, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
