"""Prints all that a reader finds in files of recordings: read.py READER [--sums] FILE...

READER is `mcap` (with `mcap-ros2-support`), `rosbags`, or `hero_ril`, the package of this workspace. Lines, divided by tabs:

    file <path>
    profile <topic> <reliability> <durability> <depth>    from `rosbags`: the numbers of ROS 2
    message <topic> <log time> <publish time> <sequence> <name=value> ...
    error <text>                                    what the reader complained of behind the last message

With `--sums`, which `hero_ril` does not have, there is no line for each message, but one for each topic:

    sum <topic> <messages> <SHA-256 of the log time, u64 little-endian, and the data of each message>

Floats are the bits of a float64 in hexadecimal, texts are their UTF-8 in hexadecimal; what a reader does not give is "-".
"""

import hashlib
import os
import pathlib
import struct
import sys
import types

import numpy


def number(value):
    if isinstance(value, (bool, numpy.bool_)):
        return str(int(value))
    if isinstance(value, (float, numpy.floating)):
        return "nan" if value != value else struct.pack(">d", value).hex()
    return str(int(value))


def flat(value, name, fields, members):
    """Appends `name=value` for each number and text in a message, whose names and values `members` gives."""
    if isinstance(value, str):
        fields.append(f"{name}={value.encode().hex()}")
    elif isinstance(value, (list, tuple, bytes, bytearray, memoryview, numpy.ndarray)):
        if len(value) == 0:
            fields.append(f"{name}=[]")
        for i, element in enumerate(value):
            flat(element, f"{name}[{i}]", fields, members)
    elif isinstance(value, (bool, int, float, numpy.generic)):
        fields.append(f"{name}={number(value)}")
    else:
        prefix = f"{name}." if name else ""
        for key, element in members(value):
            flat(element, prefix + key, fields, members)


def slots(message):
    return message.items() if isinstance(message, dict) else [(name, getattr(message, name)) for name in message.__slots__]


def message(topic, log_time, publish_time, sequence, value, members=slots):
    fields = []
    flat(value, "", fields, members)
    print("message", topic, log_time, publish_time, sequence, *fields, sep="\t")


def read_mcap(path):
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, found, value in reader.iter_decoded_messages():
            message(channel.topic, found.log_time, found.publish_time, found.sequence, value)


def read_rosbags(path):
    from rosbags.highlevel import AnyReader

    with AnyReader([pathlib.Path(path)]) as reader:
        # Constants are members of its classes, too.
        fields = reader.typestore.fielddefs
        members = lambda value: [(name, getattr(value, name)) for name, _ in fields[value.__msgtype__][1]]
        for connection in reader.connections:
            for qos in connection.ext.offered_qos_profiles:
                print("profile", connection.topic, qos.reliability.value, qos.durability.value, qos.depth, sep="\t")
        for connection, time, data in reader.messages():
            message(connection.topic, time, "-", "-", reader.deserialize(data, connection.msgtype), members)


def read_hero_ril(path):
    # Without its compiled part, which a flight does not need.
    package = types.ModuleType("hero_ril")
    package.__path__ = [os.environ["HERO_RIL_SOURCE"]]
    sys.modules.setdefault("hero_ril", package)
    from hero_ril.flight import Flight

    flight = Flight(path)
    for topic in flight:
        frame = flight.frame(topic, masked=False)
        times = frame.index.as_unit("ns").asi8
        columns = [(name, frame[name].to_numpy()) for name in frame.columns]
        for i, time in enumerate(times):
            message(topic, "-", time, "-", {name: values[i] for name, values in columns})


class Sums:
    def __init__(self):
        self.topics = {}

    def take(self, topic, log_time, data):
        sum = self.topics.setdefault(topic, [0, hashlib.sha256()])
        sum[0] += 1
        sum[1].update(struct.pack("<Q", log_time))
        sum[1].update(data)

    def print(self):
        for topic, (messages, digest) in self.topics.items():
            print("sum", topic, messages, digest.hexdigest(), sep="\t")


def sum_mcap(path, sums):
    from mcap.reader import make_reader

    with open(path, "rb") as file:
        for _, channel, found in make_reader(file, validate_crcs=True).iter_messages():
            sums.take(channel.topic, found.log_time, found.data)


def sum_rosbags(path, sums):
    from rosbags.highlevel import AnyReader

    with AnyReader([pathlib.Path(path)]) as reader:
        for connection, time, data in reader.messages():
            sums.take(connection.topic, time, data)


def summed(reader):
    sum_up = {"mcap": sum_mcap, "rosbags": sum_rosbags}[reader]

    def read(path):
        sums = Sums()
        try:
            sum_up(path, sums)
        finally:
            sums.print()

    return read


def main():
    reader, *paths = sys.argv[1:]
    read = {"mcap": read_mcap, "rosbags": read_rosbags, "hero_ril": read_hero_ril}[reader]
    if paths[:1] == ["--sums"]:
        read, paths = summed(reader), paths[1:]
    for path in paths:
        print("file", path, sep="\t")
        try:
            read(path)
        except Exception as error:
            text = " ".join(f"{type(error).__name__}: {error}".split())
            print("error", text, sep="\t")


main()
