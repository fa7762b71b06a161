"""A recorded flight as frames of pandas.

    flight = hero_ril.Flight("flight.mcap")
    print(flight.topics)
    flight["hero/telemetry"].plot(y="geodetic.altitude_m")

It reads recordings of `ril record`, finished or not, and other MCAP files with messages of ROS 2. It needs the packages `mcap`,
`numpy` and `pandas`: `pip install 'hero_ril[flight]'`.
"""

import glob
import os

from ._file import File, needed
from ._frames import columns_of, units_of
from ._messages import array_of, parse
from ._names import IN_RECORDINGS

__all__ = ["Flight"]


class Flight:
    """A recording: one file, or the files of a recording that was split, in any order; names may have wildcards.

    Topics are called as in the file, or without the robot when there is one robot: "/robot1/hero/telemetry" or "hero/telemetry"; the
    robot's own also as in `ril echo` and `Robot.subscribe`: "hero", "hero_telemetry".
    """

    def __init__(self, *paths):
        names = []
        for path in map(os.fspath, paths):
            names.extend(glob.glob(path) if not os.path.exists(path) and glob.has_magic(path) else [path])
        if not names:
            raise FileNotFoundError(f"no such file: {', '.join(map(str, paths))}")
        self._files = sorted((File(name) for name in dict.fromkeys(names)), key=lambda file: file.begin)
        self._channels = {}
        for file in self._files:
            for channel in file.channels.values():
                self._channels.setdefault(channel.topic, []).append((file, channel))
        self._definitions = {}

    # What is in it

    @property
    def topics(self):
        """Each topic with its type and the number of its messages."""
        pandas = needed("pandas")
        rows = []
        for topic, channels in sorted(self._channels.items()):
            file, channel = channels[0]
            messages = sum(file.counts.get(channel.id, 0) for file, channel in channels)
            rows.append((topic, file.schema_name(channel), messages))
        return pandas.DataFrame(rows, columns=["topic", "type", "messages"]).set_index("topic")

    @property
    def metadata(self):
        """What the recording says of itself: texts by key, by name of the record, such as `metadata["ril.flight"]["host"]`. Of
        several files the first one's."""
        return self._of_first("metadata")

    @property
    def attachments(self):
        """Files that were recorded along: bytes by name, such as `attachments["bridge.toml"]`. Of several files the first one's."""
        return self._of_first("attachments")

    def _of_first(self, name):
        return {key: value for file in reversed(self._files) for key, value in getattr(file, name).items()}

    @property
    def start(self):
        """The time of the first message, or None without messages."""
        return self._time([file.begin for file in self._files if file.counts], min)

    @property
    def end(self):
        """The time of the last message, or None without messages."""
        return self._time([file.end for file in self._files if file.counts], max)

    @staticmethod
    def _time(times_ns, which):
        pandas = needed("pandas")
        return pandas.Timestamp(which(times_ns), unit="ns", tz="UTC") if times_ns else None

    @property
    def problems(self):
        """What is wrong with the files, in words; empty when all are whole. An unfinished or damaged file is read as far as that
        goes, and `ril log recover` makes a whole one of it."""
        return [f"{file.path}: {problem}" for file in self._files for problem in file.problems]

    def __iter__(self):
        return iter(sorted(self._channels))

    def __len__(self):
        return len(self._channels)

    def __contains__(self, topic):
        return bool(self._candidates(topic))

    def __repr__(self):
        names = ", ".join(repr(file.path) for file in self._files)
        return f"Flight({names}): {len(self)} topics, {self.start} to {self.end}"

    # Topics

    def __getitem__(self, topic):
        """The topic as a frame: a row for each message, by its time, and a column for each number, such as `geodetic.altitude_m`
        or `cells[2].voltage_v`. Units are in `attrs["units"]`.

        The time is the one in the message, as the file's wall clock (UTC). Values of groups that were not valid are NaN; see `frame`.
        """
        return self.frame(topic)

    def frame(self, topic, *, masked=True):
        """The same as `flight[topic]`. With `masked=False`, values of groups that were not valid are as they were recorded, 0."""
        numpy, pandas = needed("numpy"), needed("pandas")
        name = self._name(topic)
        times, messages = self._messages(name)
        definition = self._definition(name)
        columns = columns_of(definition, messages, masked)
        index = pandas.DatetimeIndex(numpy.array(times, dtype="datetime64[ns]"), name="time").tz_localize("UTC")
        frame = pandas.DataFrame(columns, index=index, copy=False)
        if not index.is_monotonic_increasing:
            frame = frame.sort_index(kind="stable")
        frame.attrs.update(topic=name, units=units_of(definition, frame.columns))
        return frame

    def array(self, topic):
        """The messages of a topic as a structured array of NumPy, as they were recorded. Only for messages of a fixed layout,
        without strings and sequences, as all topics in shared memory have."""
        name = self._name(topic)
        array = array_of(self._definition(name), self._messages(name)[1])
        if array is None:
            raise TypeError(f"messages of {name} have no fixed layout; read them with flight[{topic!r}]")
        return array

    def units(self, topic):
        """Units by column, such as `{"geodetic.altitude_m": "m"}`; columns without a unit are left out."""
        return self.frame(topic).attrs["units"]

    def schema(self, topic):
        """The definition of a topic's messages, as text: every field with a comment."""
        file, channel = self._channels[self._name(topic)][0]
        return file.schema_text(channel)

    @property
    def events(self):
        """What happened to the recording itself: losses, gaps, restarts, splits; empty when nothing did."""
        return self._all_of("recording/events")

    @property
    def requests(self):
        """Requests to the robot with their senders, and what the bridge reported about each; empty when there were none."""
        return self._all_of("requests")

    def _all_of(self, end):
        pandas = needed("pandas")
        frames = [self.frame(topic) for topic in self._candidates(end)]
        if len(frames) == 1:
            return frames[0]
        return pandas.concat(frames).sort_index(kind="stable") if frames else pandas.DataFrame()

    def _candidates(self, topic):
        if topic in self._channels:
            return [topic]
        topic = IN_RECORDINGS.get(topic, topic)
        is_meant = lambda name: name.startswith("/robot") and name.partition("/robot")[2].partition("/")[2] == topic
        return sorted(filter(is_meant, self._channels))

    def _name(self, topic):
        candidates = self._candidates(topic)
        if len(candidates) != 1:
            why = f"one of {', '.join(candidates)}" if candidates else f"the topics are {', '.join(self)}"
            raise KeyError(f"{topic}: {why}")
        return candidates[0]

    def _definition(self, name):
        if name not in self._definitions:
            schemas = {}
            for file, channel in self._channels[name]:
                file.require_ros2(channel)
                schemas[file.schema_name(channel), file.schema_text(channel)] = None
            if len(schemas) > 1:
                raise ValueError(f"{name} changes its type within the recording; read the files one by one")
            self._definitions[name] = parse(*next(iter(schemas)))
        return self._definitions[name]

    def _messages(self, name):
        """Times (ns) and bytes of all messages."""
        times, messages = [], []
        for file in dict.fromkeys(file for file, _ in self._channels[name]):
            ids = {channel.id for other, channel in self._channels[name] if other is file}
            for time, data in file.messages(ids):
                times.append(time)
                messages.append(data)
        return times, messages
