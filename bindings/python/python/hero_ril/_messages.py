"""Messages of ROS 2: definitions (`ros2msg`) and bytes (CDR), as arrays of NumPy.

A definition whose messages all have one size becomes a structured dtype, with which a whole topic is read at once. Others, with
strings or sequences in them, are read message by message.
"""

import re
import struct
from typing import NamedTuple, Optional, Union

#: By name in a definition: the code of `struct` and NumPy. The size of a number is its alignment.
_NUMBERS = {
    "bool": "?",
    "byte": "B",
    "char": "B",
    "uint8": "B",
    "int8": "b",
    "uint16": "H",
    "int16": "h",
    "uint32": "I",
    "int32": "i",
    "uint64": "Q",
    "int64": "q",
    "float32": "f",
    "float64": "d",
}

#: `len` of a field whose message says how many elements there are.
SEQUENCE = -1

#: Bytes before each message: how it is encoded.
HEADER_LEN = 4

#: By those bytes: the byte order.
_BYTE_ORDERS = {b"\0\1": "<", b"\0\0": ">"}

_FIELD = re.compile(r"([\w/]+)(?:<=\d+)?(\[(?:<=)?(\d*)\])?\s+(\w+)\s*(=?)")
_UNIT = re.compile(r"\[([^\[\],\n]+)\]")
_GROUP = re.compile(r"\(group (\d+)")


class Field(NamedTuple):
    name: str
    #: A name of `_NUMBERS`, "string", or a definition.
    kind: Union[str, "Definition"]
    #: Of an array; None for one value, SEQUENCE when the message says it.
    len: Optional[int]
    comment: str

    @property
    def unit(self):
        """What stands in brackets in the comment, such as "m/s"; None when nothing does."""
        found = _UNIT.findall(self.comment)
        return found[-1] if found else None

    @property
    def group(self):
        """The bit of `valid_groups` that says whether the field means something; None when it always does."""
        found = _GROUP.search(self.comment)
        return int(found[1]) if found else None


class Definition(NamedTuple):
    name: str
    fields: tuple


def parse(name, text):
    """The definition of the type `name`, such as "hero_msgs/msg/DspTelemetry", with all that it contains."""
    texts = {}
    current = _short(name)
    texts[current] = []
    for line in text.splitlines():
        if line.startswith("==="):
            current = None
        elif current is None:
            if line.startswith("MSG:"):
                current = _short(line[4:].strip())
                texts[current] = []
        else:
            texts[current].append(line)
    return _definition(_short(name), texts, ())


def _short(name):
    return name.replace("/msg/", "/")


def _definition(name, texts, within):
    if name not in texts:
        raise ValueError(f"the definition of the message type {name} is not in the file")
    if name in within:
        raise ValueError(f"the message type {name} contains itself")
    fields = []
    comments = []
    for line in texts[name]:
        code, _, comment = line.partition("#")
        code = code.strip()
        if not code:
            # An empty line ends what is said about the message as a whole.
            comments = comments + [comment.strip()] if "#" in line else []
            continue
        found = _FIELD.match(code)
        if not found:
            raise ValueError(f"no field of a message: {line}")
        kind, brackets, count, field, is_constant = found.groups()
        if not is_constant:
            length = None if brackets is None else SEQUENCE if "<" in brackets or not count else int(count)
            if kind not in _NUMBERS and kind != "string":
                kind = _definition(_full(kind, name, texts), texts, (*within, name))
            fields.append(Field(field, kind, length, "\n".join([*comments, comment.strip()])))
        comments = []
    # ROS 2 gives a message without fields one.
    return Definition(name, tuple(fields) or (Field("structure_needs_at_least_one_member", "uint8", None, ""),))


def _full(kind, within, texts):
    if kind == "Header":
        return "std_msgs/Header"
    if "/" in kind:
        return _short(kind)
    return f"{within.rpartition('/')[0]}/{kind}"


# Messages of one size


def dtype_of(definition, byte_order="<"):
    """The dtype of a message behind its header, or None when there is none: its size differs from message to message, or elements
    of an array lie at different alignments."""
    import numpy

    layout = _layout(definition, 0, byte_order)
    return layout and numpy.dtype(layout)


def _layout(definition, position, byte_order):
    """Arguments of a structured dtype for a message that begins at `position`: alignments count from the outermost message."""
    begin = position
    names, formats, offsets = [], [], []
    for field in definition.fields:
        if field.kind == "string" or field.len == SEQUENCE:
            return None
        count = 1 if field.len is None else field.len
        if isinstance(field.kind, Definition):
            element = _layout(field.kind, position, byte_order)
            if element is None:
                return None
            start, step = position, element["itemsize"]
            # Each element has to look like the first one. Alignments repeat after eight elements at the latest.
            others = range(1, min(count, 9))
            if any(element != _layout(field.kind, position + i * step, byte_order) for i in others):
                return None
        else:
            code = _NUMBERS[field.kind]
            step = struct.calcsize("=" + code)
            element = byte_order + code if step > 1 else code
            start = -(-position // step) * step
        names.append(field.name)
        formats.append(element if field.len is None else (element, (count,)))
        offsets.append(start - begin)
        position = start + step * count
    return {"names": names, "formats": formats, "offsets": offsets, "itemsize": position - begin}


# Messages of any size


class _Cursor:
    def __init__(self, data, byte_order):
        self.data = data
        self.position = HEADER_LEN
        self.byte_order = byte_order

    def numbers(self, code, count):
        if count == 0:
            return ()
        size = struct.calcsize("=" + code)
        begin = HEADER_LEN - (HEADER_LEN - self.position) // size * size
        self.position = begin + size * count
        return struct.unpack_from(f"{self.byte_order}{count}{code}", self.data, begin)

    def bytes(self, count):
        begin, self.position = self.position, self.position + count
        if self.position > len(self.data):
            raise struct.error("the message ends too early")
        return bytes(self.data[begin : self.position])

    def value(self, kind):
        if isinstance(kind, Definition):
            return {field.name: self.field(field) for field in kind.fields}
        if kind == "string":
            return self.bytes(self.numbers("I", 1)[0]).rstrip(b"\0").decode(errors="replace")
        return self.numbers(_NUMBERS[kind], 1)[0]

    def field(self, field):
        if field.len is None:
            return self.value(field.kind)
        count = self.numbers("I", 1)[0] if field.len == SEQUENCE else field.len
        if field.kind in ("uint8", "byte", "char"):
            return self.bytes(count)
        if field.kind in _NUMBERS:
            return self.numbers(_NUMBERS[field.kind], count)
        # A damaged count ends with the message.
        return [self.value(field.kind) for _ in range(count)]


def decode(definition, data):
    """One message with its header, as a dict of numbers, strings, bytes, tuples of numbers, lists and dicts."""
    try:
        return _Cursor(data, byte_order(data)).value(definition)
    except struct.error as error:
        raise ValueError(f"a message of type {definition.name} is shorter than its definition") from error


def byte_order(data):
    order = _BYTE_ORDERS.get(bytes(data[:2]))
    if order is None:
        raise ValueError(f"messages with the CDR header {bytes(data[:HEADER_LEN]).hex()} cannot be read; plain CDR begins with 0001 or 0000")
    return order


def array_of(definition, messages):
    """Messages as a structured array, or None when there is no dtype for them."""
    import numpy

    order = byte_order(messages[0]) if messages else "<"
    dtype = dtype_of(definition, order)
    if dtype is None or any(byte_order(data) != order for data in {bytes(data[:2]) for data in messages}):
        return None
    end = HEADER_LEN + dtype.itemsize
    if any(len(data) < end for data in messages):
        raise ValueError(f"a message of type {definition.name} is shorter than its definition")
    if not messages:
        return numpy.empty(0, dtype)
    # What follows are bytes that fill up the end.
    return numpy.frombuffer(b"".join([data[HEADER_LEN:end] for data in messages]), dtype=dtype)
