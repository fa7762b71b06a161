"""ctypes structures and the schemas of topics, in both directions."""

import ctypes

#: By ctypes type: its name in a message definition of ROS 2.
_ROS_NAMES = {
    ctypes.c_uint8: "uint8",
    ctypes.c_char: "uint8",
    ctypes.c_uint16: "uint16",
    ctypes.c_uint32: "uint32",
    ctypes.c_uint64: "uint64",
    ctypes.c_int8: "int8",
    ctypes.c_int16: "int16",
    ctypes.c_int32: "int32",
    ctypes.c_int64: "int64",
    ctypes.c_float: "float32",
    ctypes.c_double: "float64",
}

#: By name in Rust: the ctypes type.
_NUMBERS = {
    "u8": ctypes.c_uint8,
    "u16": ctypes.c_uint16,
    "u32": ctypes.c_uint32,
    "u64": ctypes.c_uint64,
    "i8": ctypes.c_int8,
    "i16": ctypes.c_int16,
    "i32": ctypes.c_int32,
    "i64": ctypes.c_int64,
    "f32": ctypes.c_float,
    "f64": ctypes.c_double,
}


def schema_of(struct):
    """The schema of a ctypes structure, as text.

    Its static method `type_name` says what the layout is called, such as "battery_watch.Voltages.v1"; nested structures have one
    too. The fields follow one another without a hole, and there are no pointers or flags among them. A character is a `uint8`, and an
    array of several dimensions lies there, and is described, as one of one dimension. A structure that `ril topic generate` made has its
    text with it.
    """
    made = struct.__dict__.get("SCHEMA")
    if made is not None:
        return made
    nested = []
    _collect(struct, nested)
    texts = [_definition(struct)]
    for other in nested:
        package, name, _ = other.type_name().split(".")
        texts.append(f"{'=' * 80}\nMSG: {package}_msgs/{name}\n{_definition(other)}")
    return "\n".join(texts)


def _element(kind):
    """The elements of an array, of its innermost dimension, and how many there are; None of what is no array."""
    length = None
    while issubclass(kind, ctypes.Array):
        length = kind._length_ * (1 if length is None else length)
        kind = kind._type_
    return kind, length


def _collect(struct, nested):
    for _, kind in struct._fields_:
        element, _ = _element(kind)
        if issubclass(element, ctypes.Structure) and element not in nested:
            _collect(element, nested)
            nested.append(element)


def _definition(struct):
    lines = [f"# Layout: {struct.type_name()}", ""]
    for name, kind in struct._fields_:
        element, length = _element(kind)
        length = "" if length is None else f"[{length}]"
        if issubclass(element, ctypes.Structure):
            package, nested, _ = element.type_name().split(".")
            type_name = f"{package}_msgs/{nested}"
        else:
            type_name = _ROS_NAMES.get(element)
        if type_name is None:
            raise TypeError(f"`{name}` of {struct.__name__} is no number of fixed size, structure or array of these")
        lines.append(f"{type_name}{length} {name}")
    return "\n".join(lines) + "\n"


def structure_of(name, type_name, fields):
    """The ctypes structure of a topic that this program was not written for."""
    members = []
    for field, kind, length in fields:
        element = _NUMBERS[kind] if isinstance(kind, str) else structure_of(*kind[:1], None, kind[1])
        members.append((field, element if length is None else element * length))
    body = {"_fields_": members}
    if type_name is not None:
        body["type_name"] = staticmethod(lambda: type_name)
    return type(name, (ctypes.Structure,), body)
