"""A file in the format MCAP, finished or not, through the package `mcap`."""

import struct

#: Opcode, length, channel, sequence, log time, publish time.
_MESSAGE_HEAD = struct.Struct("<BQHIQQ")

#: The index of a channel's messages in a chunk, which `mcap` reads more slowly than the messages: opcode, length, channel, length of
#: the entries; log time and offset of each message.
_INDEX_HEAD = struct.Struct("<BQHI")
_INDEX_ENTRY = struct.Struct("<QQ")


def needed(name):
    """A module of a package that only flights need."""
    try:
        return __import__(name, fromlist=["_"])
    except ImportError as error:
        raise ImportError(f"a flight is read with the package `{name.partition('.')[0]}`: pip install 'hero_ril[flight]'") from error


class File:
    """A file, of which everything but its messages is read at once."""

    def __init__(self, path):
        needed("mcap.reader")
        self.path = path
        self.problems = []
        self.schemas = {}
        self.channels = {}
        self.metadata = {}
        self.attachments = {}
        #: Messages by channel.
        self.counts = {}
        #: Unix times of the first and the last message, ns.
        self.begin = self.end = 0
        self._chunks = None
        with open(path, "rb") as stream:
            if not self._read_summary(stream):
                self._read_all(stream)

    def _read_summary(self, stream):
        """Reads what stands at the end of a finished file; returns whether it is one."""
        from mcap.exceptions import McapError
        from mcap.reader import make_reader

        try:
            reader = make_reader(stream)
        except (McapError, struct.error) as error:
            raise ValueError(f"{self.path} is no MCAP file") from error
        try:
            summary = reader.get_summary()
            if summary is None or summary.statistics is None:
                return False
            if summary.statistics.message_count > 0 and not summary.chunk_indexes:
                return False
            self.metadata = {record.name: record.metadata for record in reader.iter_metadata()}
            self.attachments = {file.name: file.data for file in reader.iter_attachments()}
        except (McapError, struct.error, ValueError, OSError):
            return False
        statistics = summary.statistics
        self.schemas, self.channels = summary.schemas, summary.channels
        self.counts = {id: count for id, count in statistics.channel_message_counts.items() if count}
        self.begin, self.end = statistics.message_start_time, statistics.message_end_time
        self._chunks = sorted(summary.chunk_indexes, key=lambda chunk: chunk.chunk_start_offset)
        return True

    def _read_all(self, stream):
        """Goes through a file that was not finished, as far as it is whole."""
        from mcap.records import Attachment, Chunk, Message, Metadata

        is_first = True
        for record in self._records(stream, self.problems):
            if isinstance(record, Metadata):
                self.metadata[record.name] = record.metadata
            elif isinstance(record, Attachment):
                self.attachments[record.name] = record.data
            elif isinstance(record, (Chunk, Message)):
                for id, time, _, _ in self._in_chunk(record, None, self.problems):
                    self.counts[id] = self.counts.get(id, 0) + 1
                    self.begin = time if is_first else min(self.begin, time)
                    self.end = time if is_first else max(self.end, time)
                    is_first = False
        self.problems.insert(0, "it was not finished")

    def _records(self, stream, problems):
        """Records from the beginning, chunks as a whole, up to the first that is not whole."""
        from mcap.exceptions import McapError
        from mcap.records import Channel, Schema
        from mcap.stream_reader import StreamReader

        stream.seek(0)
        try:
            for record in StreamReader(stream, emit_chunks=True).records:
                if isinstance(record, Schema):
                    self.schemas[record.id] = record
                elif isinstance(record, Channel):
                    self.channels[record.id] = record
                else:
                    yield record
        except (McapError, struct.error, ValueError, OverflowError, MemoryError) as error:
            problems.append(f"it ends early: {str(error) or type(error).__name__}")

    def messages(self, ids):
        """Time (Unix, ns) and bytes of each message of some channels, in the order of the file."""
        with open(self.path, "rb") as stream:
            for _, _, time, data in self._indexed(stream, ids) if self._chunks is not None else self._walked(stream, ids):
                yield time, data

    def _walked(self, stream, ids):
        from mcap.records import Chunk, Message

        for record in self._records(stream, []):
            if isinstance(record, (Chunk, Message)):
                yield from self._in_chunk(record, ids, [])

    def _indexed(self, stream, ids):
        from mcap.exceptions import McapError

        for place in self._chunks:
            if place.message_index_offsets and not ids.intersection(place.message_index_offsets):
                continue
            try:
                # As a whole, so that a damaged chunk gives nothing and not a part.
                yield from list(self._of_place(stream, place, ids))
            except (McapError, struct.error) as error:
                self._note(self.problems, f"a chunk is damaged: {str(error) or type(error).__name__}")

    def _of_place(self, stream, place, ids):
        from mcap.data_stream import ReadDataStream
        from mcap.records import Chunk

        stream.seek(place.chunk_start_offset + 9)
        chunk = Chunk.read(ReadDataStream(stream))
        offsets = [offset for id, offset in place.message_index_offsets.items() if id in ids]
        if not offsets:
            yield from self._in_chunk(chunk, ids, self.problems)
            return
        data = self._data(chunk, self.problems)
        if data is None:
            return
        entries = []
        for offset in offsets:
            stream.seek(offset)
            _, _, _, size = _INDEX_HEAD.unpack(stream.read(_INDEX_HEAD.size))
            entries.extend(at for _, at in _INDEX_ENTRY.iter_unpack(stream.read(size)))
        for at in sorted(entries):
            yield _message(data, at)

    def _in_chunk(self, record, ids, problems):
        """Messages of a chunk, or the one that stands alone: channel, log time, time in the message, bytes."""
        from mcap.records import Channel, Message, Schema
        from mcap.stream_reader import breakup_chunk

        if isinstance(record, Message):
            records = [record]
        elif self._data(record, problems) is None:
            return
        else:
            records = breakup_chunk(record)
        for record in records:
            if isinstance(record, Schema):
                self.schemas[record.id] = record
            elif isinstance(record, Channel):
                self.channels[record.id] = record
            elif isinstance(record, Message) and (ids is None or record.channel_id in ids):
                yield record.channel_id, record.log_time, record.publish_time, record.data

    @staticmethod
    def _note(problems, problem):
        if problem not in problems:
            problems.append(problem)

    @classmethod
    def _data(cls, chunk, problems):
        """A chunk's bytes, or None when they are not what was written."""
        from mcap.stream_reader import get_chunk_data_stream

        try:
            stream, length = get_chunk_data_stream(chunk, validate_crc=True)
            return stream.read(length)
        except ValueError as error:
            cls._note(problems, f"a chunk is damaged: {error}")
            return None

    def schema_name(self, channel):
        schema = self.schemas.get(channel.schema_id)
        return schema.name if schema else ""

    def schema_text(self, channel):
        schema = self.schemas.get(channel.schema_id)
        return schema.data.decode(errors="replace") if schema else ""

    def require_ros2(self, channel):
        schema = self.schemas.get(channel.schema_id)
        encoding = schema.encoding if schema else "none"
        if (channel.message_encoding, encoding) != ("cdr", "ros2msg"):
            raise ValueError(
                f"{channel.topic} has messages in {channel.message_encoding} with a schema in {encoding}; "
                "Flight reads cdr with ros2msg"
            )


def _message(data, at):
    _, length, channel, _, log_time, publish_time = _MESSAGE_HEAD.unpack_from(data, at)
    return channel, log_time, publish_time, data[at + _MESSAGE_HEAD.size : at + 9 + length]
