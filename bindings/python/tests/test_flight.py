"""Flights from files that the package `mcap` writes. `ril-tests` runs it, and reads recordings of the RIL besides."""

import os
import struct
import tempfile
import unittest

import hero_ril

try:
    import pandas
    from mcap.writer import CompressionType, Writer
except ImportError as error:
    raise unittest.SkipTest(f"no flights: {error}") from error

#: Unix time of the first message, ns.
BEGIN_NS = 1_700_000_000_000_000_000

BATTERY = """\
# Voltages of the flight battery.
#
# Layout: battery_watch.Battery.v1

uint8 PARTS=2
# Counts the samples.
uint64 sequence
# Bit *k* is set when group *k* is valid.
uint16 valid_groups
uint8[2] name
# Of the pack, under load [V] (group 3).
float32 pack
battery_watch_msgs/Cell[2] cells
# In the middle, 0 to 1 [0, 1]; no unit.
int32 middle  # (group 4)
Position position

================================================================================
MSG: battery_watch_msgs/Cell
float32 voltage_v # [V]
int16 temperature

================================================================================
MSG: battery_watch_msgs/Position
# Latitude. [deg]
float64 latitude
"""

PIECE = "uint64 at_ns\nuint8[] data\nstring[<=3] names\nfloat32[] numbers\nstring<=20 text\nstranger_msgs/Pair[] pairs\n"
PIECE += "=" * 80 + "\nMSG: stranger_msgs/Pair\nint8 a\nuint16 b\n"


def battery(sequence, valid_groups, voltage):
    cells = struct.pack("<fhxxfhxx", voltage, -5, voltage + 1, 7)
    return struct.pack("<4sQHBBf", b"\0\1\0\0", sequence, valid_groups, 65, 66, 2 * voltage) + cells + struct.pack("<i4xd", 9, 47.5)


def text(value):
    data = value.encode() + b"\0"
    return struct.pack("<I", len(data)) + data


class Recorded(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = os.path.join(folder.name, "flight.mcap")

    def record(self, messages, *, schemas, finished=True, path=None, chunk_size=200, compression=CompressionType.NONE, begin=0):
        """Writes messages (topic, bytes), one each second; returns the file's path."""
        path = path or self.path
        with open(path, "wb") as file:
            writer = Writer(file, chunk_size=chunk_size, compression=compression)
            writer.start(profile="ros2")
            writer.add_metadata("ril.flight", {"host": "field"})
            writer.add_attachment(BEGIN_NS, BEGIN_NS, "bridge.toml", "application/toml", b"robot = 1\n")
            channels = {}
            for topic, (name, definition) in schemas.items():
                schema = writer.register_schema(name, "ros2msg", definition.encode())
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            for i, (topic, data) in enumerate(messages, begin):
                time = BEGIN_NS + i * 1_000_000_000
                writer.add_message(channels[topic], time, data, time - 1, i)
            writer.finish()
        return path

    def batteries(self, **options):
        schemas = {"/robot1/battery/cells": ("battery_watch_msgs/msg/Battery", BATTERY)}
        messages = [("/robot1/battery/cells", battery(i, 0b1000 if i % 2 else 0b10000, 3.5 + i)) for i in range(20)]
        return self.record(messages, schemas=schemas, **options)


class Frames(Recorded):
    def test_three_lines(self):
        flight = hero_ril.Flight(self.batteries())
        self.assertEqual(list(flight.topics.loc["/robot1/battery/cells"]), ["battery_watch_msgs/msg/Battery", 20])
        frame = flight["battery/cells"]
        self.assertEqual(len(frame), 20)
        self.assertEqual(frame.index.name, "time")
        self.assertEqual(frame.index[0], pandas.Timestamp(BEGIN_NS - 1, unit="ns", tz="UTC"))
        self.assertEqual(
            list(frame.columns),
            [
                "sequence", "valid_groups", "name[0]", "name[1]", "pack", "cells[0].voltage_v", "cells[0].temperature",
                "cells[1].voltage_v", "cells[1].temperature", "middle", "position.latitude",
            ],
        )  # fmt: skip
        self.assertEqual(list(frame["cells[1].voltage_v"][:2]), [4.5, 5.5])
        self.assertEqual(list(frame["cells[1].temperature"][:2]), [7, 7])
        self.assertEqual(frame["position.latitude"].iloc[-1], 47.5)
        units = {"pack": "V", "cells[0].voltage_v": "V", "cells[1].voltage_v": "V", "position.latitude": "deg"}
        self.assertEqual(frame.attrs["units"], units)
        self.assertEqual(flight.units("battery/cells"), units)

    def test_what_was_not_measured_is_nan_unless_it_is_asked_for(self):
        flight = hero_ril.Flight(self.batteries())
        frame = flight["battery/cells"]
        self.assertEqual(list(frame["pack"].isna()[:3]), [True, False, True])
        self.assertEqual(list(frame["middle"].isna()[:3]), [False, True, False])
        self.assertFalse(frame["sequence"].isna().any())
        raw = flight.frame("battery/cells", masked=False)
        self.assertEqual((raw["pack"].iloc[0], raw["middle"].iloc[1]), (7.0, 9))

    def test_arrays_of_numpy(self):
        definition = "uint64 sequence\nx_msgs/Cell[3] cells\n" + "=" * 80 + "\nMSG: x_msgs/Cell\nfloat32 voltage_v\nint16[2] t\n"
        for order, header in (("<", b"\0\1\0\0"), (">", b"\0\0\0\0")):
            data = [header + struct.pack(f"{order}Qfhhfhhfhh", i, i, 1, 2, i + 0.5, 3, 4, 7, 5, 6) for i in range(20)]
            schemas = {"/robot1/cells": ("x_msgs/msg/Battery", definition)}
            flight = hero_ril.Flight(self.record([("/robot1/cells", one) for one in data], schemas=schemas))
            array = flight.array("cells")
            self.assertEqual(array["cells"]["voltage_v"].shape, (20, 3))
            self.assertEqual(array["cells"]["voltage_v"][3, 1], 3.5)
            self.assertEqual(list(flight["cells"].loc[:, "cells[1].t[1]"]), [4] * 20)

    def test_texts_and_sequences(self):
        head = b"\0\1\0\0" + struct.pack("<Q", 5)
        # Each number behind the header lies at a multiple of its size.
        empty = head + struct.pack("<III", 0, 0, 0) + text("") + bytes(3) + struct.pack("<I", 0)
        full = head + struct.pack("<I3sx", 3, b"abc") + struct.pack("<I", 2) + text("") + bytes(3) + text("é") + bytes(1)
        full += struct.pack("<I2f", 2, 1.5, 2.5) + text("end") + struct.pack("<IbxHbxH", 2, -1, 2, -3, 4)
        schemas = {"/pieces": ("stranger_msgs/msg/Piece", PIECE)}
        flight = hero_ril.Flight(self.record([("/pieces", empty), ("/pieces", full)], schemas=schemas))
        frame = flight["/pieces"]
        self.assertEqual(list(frame["data"]), [b"", b"abc"])
        self.assertEqual(list(frame["names"]), [[], ["", "é"]])
        self.assertEqual([list(numbers) for numbers in frame["numbers"]], [[], [1.5, 2.5]])
        self.assertEqual(list(frame["text"]), ["", "end"])
        self.assertEqual(frame["pairs"].iloc[1], [{"a": -1, "b": 2}, {"a": -3, "b": 4}])
        with self.assertRaisesRegex(TypeError, "no fixed layout"):
            flight.array("/pieces")

    def test_a_topic_without_messages_has_its_columns(self):
        schemas = {"/robot1/a": ("battery_watch_msgs/msg/Battery", BATTERY), "/robot1/b": ("stranger_msgs/msg/Piece", PIECE)}
        flight = hero_ril.Flight(self.record([], schemas=schemas))
        self.assertEqual(len(flight["a"]), 0)
        self.assertIn("cells[1].voltage_v", flight["a"].columns)
        self.assertIn("names", flight["b"].columns)
        self.assertIsNone(flight.start)
        self.assertTrue(flight.requests.empty and flight.events.empty)

    def test_names(self):
        schemas = {name: ("stranger_msgs/msg/A", "uint8 a\n") for name in ("/robot1/a", "/robot2/a", "/robot2/b/c", "/other")}
        flight = hero_ril.Flight(self.record([], schemas=schemas))
        self.assertEqual(list(flight), ["/other", "/robot1/a", "/robot2/a", "/robot2/b/c"])
        self.assertIn("b/c", flight)
        self.assertNotIn("c", flight)
        with self.assertRaisesRegex(KeyError, "one of /robot1/a, /robot2/a"):
            flight["a"]
        with self.assertRaisesRegex(KeyError, "the topics are /other"):
            flight["x"]

    def test_schemas_that_are_none(self):
        for definition, problem in [
            ("x_msgs/Missing a\n", "x_msgs/Missing is not in the file"),
            ("A a\n", "contains itself"),
            ("uint8\n", "no field of a message"),
        ]:
            flight = hero_ril.Flight(self.record([], schemas={"/a": ("x_msgs/msg/A", definition)}))
            with self.assertRaisesRegex(ValueError, problem):
                flight["/a"]

    def test_messages_that_are_none(self):
        schemas = {"/a": ("x_msgs/msg/A", "uint32 a\n"), "/b": ("x_msgs/msg/B", "string b\n")}
        for data, problem in [(b"\0\1\0\0\1\2", "shorter than its definition"), (b"\0\7\0\0abcd", "CDR header 00070000")]:
            flight = hero_ril.Flight(self.record([("/a", data)], schemas=schemas))
            with self.assertRaisesRegex(ValueError, problem):
                flight["/a"]
        flight = hero_ril.Flight(self.record([("/b", b"\0\1\0\0\xff\xff\xff\xffabc")], schemas=schemas))
        with self.assertRaisesRegex(ValueError, "shorter than its definition"):
            flight["/b"]


class Files(Recorded):
    def test_metadata_and_attachments(self):
        flight = hero_ril.Flight(self.batteries())
        self.assertEqual(flight.metadata, {"ril.flight": {"host": "field"}})
        self.assertEqual(flight.attachments, {"bridge.toml": b"robot = 1\n"})
        self.assertEqual((flight.end - flight.start).total_seconds(), 19)
        self.assertEqual(flight.problems, [])
        self.assertIn("Layout: battery_watch.Battery.v1", flight.schema("battery/cells"))

    def test_compressed_files_and_files_without_chunks(self):
        for options in [{"compression": CompressionType.ZSTD}, {"compression": CompressionType.LZ4}, {"chunk_size": 1 << 20}]:
            frame = hero_ril.Flight(self.batteries(**options))["battery/cells"]
            self.assertEqual(list(frame["sequence"]), list(range(20)))

    def test_a_file_that_is_cut_anywhere(self):
        with open(self.batteries(), "rb") as file:
            whole = file.read()
        most = 0
        for end in range(8, len(whole), 7):
            with open(self.path, "wb") as file:
                file.write(whole[:end])
            flight = hero_ril.Flight(self.path)
            self.assertEqual(len(flight.problems), 2, end)
            count = len(flight["battery/cells"]) if "battery/cells" in flight else 0
            self.assertGreaterEqual(count, most)
            most = count
        self.assertEqual(most, 20)

    def test_a_damaged_chunk_is_left_out_and_said(self):
        with open(self.batteries(), "rb") as file:
            whole = bytearray(file.read())
        place = whole.index(struct.pack("<d", 47.5))
        whole[place] ^= 1
        with open(self.path, "wb") as file:
            file.write(whole)
        flight = hero_ril.Flight(self.path)
        frame = flight["battery/cells"]
        self.assertTrue(0 < len(frame) < 20, len(frame))
        self.assertRegex(flight.problems[0], "a chunk is damaged")

    def test_the_files_of_a_split_are_one_flight(self):
        schemas = {"/a": ("x_msgs/msg/A", "uint32 a\n")}
        paths = []
        for part in (1, 0, 2):
            messages = [("/a", b"\0\1\0\0" + struct.pack("<I", 10 * part + i)) for i in range(10)]
            path = self.path.replace("flight", f"flight-{part}")
            paths.append(self.record(messages, schemas=schemas, path=path, begin=10 * part))
        for flight in (hero_ril.Flight(*paths), hero_ril.Flight(self.path.replace("flight.", "flight-*."))):
            self.assertEqual(list(flight["/a"]["a"]), list(range(30)))
            self.assertEqual(flight.topics.loc["/a", "messages"], 30)

    def test_files_that_are_none(self):
        with open(self.path, "wb") as file:
            file.write(b"no recording at all")
        with self.assertRaisesRegex(ValueError, "is no MCAP file"):
            hero_ril.Flight(self.path)
        with self.assertRaises(FileNotFoundError):
            hero_ril.Flight(self.path + "x")
        with self.assertRaises(FileNotFoundError):
            hero_ril.Flight(self.path + "*.x")


if __name__ == "__main__":
    unittest.main()
