"""Messages of a topic as columns: name and array of each number."""

from ._file import needed
from ._messages import SEQUENCE, Definition, array_of, decode

#: Arrays of numbers that are as long as this at most have a column for each element.
LONGEST_IN_COLUMNS = 64


def columns_of(definition, messages, is_masked):
    """Columns by name, such as `cells[2].voltage_v`. `is_masked`: what was not measured is NaN."""
    array = array_of(definition, messages)
    columns = {}
    if array is not None:
        _columns_of_array(array, definition, "", columns)
    else:
        _columns_of_values(definition, [decode(definition, data) for data in messages], "", columns)
    if is_masked:
        _mask(definition, columns)
    return columns


def units_of(definition, columns):
    """Units by column, of those that have one."""
    known = {}
    _collect_units(definition, "", known)
    units = ((column, known.get(_without_indexes(column))) for column in columns)
    return {column: unit for column, unit in units if unit}


def _columns_of_array(array, definition, path, columns):
    for field in definition.fields:
        name, values = path + field.name, array[field.name]
        if isinstance(field.kind, Definition):
            if field.len is None:
                _columns_of_array(values, field.kind, f"{name}.", columns)
            else:
                for i in range(field.len):
                    _columns_of_array(values[:, i], field.kind, f"{name}[{i}].", columns)
            continue
        # pandas wants numbers in the machine's byte order; and without the other fields between them they are fast.
        values = values.astype(values.dtype.newbyteorder("="))
        if field.len is None:
            columns[name] = values
        elif field.len <= LONGEST_IN_COLUMNS:
            columns.update((f"{name}[{i}]", values[:, i]) for i in range(field.len))
        else:
            columns[name] = _objects([bytes(row) for row in values] if values.dtype == "u1" else values)


def _columns_of_values(definition, rows, path, columns):
    for field in definition.fields:
        name, values = path + field.name, [row[field.name] for row in rows]
        is_array = field.len not in (None, SEQUENCE)
        if isinstance(field.kind, Definition) and field.len is None:
            _columns_of_values(field.kind, values, f"{name}.", columns)
        elif isinstance(field.kind, Definition) and is_array:
            for i in range(field.len):
                _columns_of_values(field.kind, [value[i] for value in values], f"{name}[{i}].", columns)
        elif is_array and field.len <= LONGEST_IN_COLUMNS:
            columns.update((f"{name}[{i}]", _column(field.kind, [value[i] for value in values])) for i in range(field.len))
        elif field.len is not None and values and isinstance(values[0], tuple):
            columns[name] = _objects([_numbers(field.kind, value) for value in values])
        elif field.len is not None:
            columns[name] = _objects(values)
        else:
            columns[name] = _column(field.kind, values)


def _column(kind, values):
    return _objects(values) if kind == "string" else _numbers(kind, values)


def _numbers(kind, values):
    return needed("numpy").array(values, dtype={"byte": "uint8", "char": "uint8"}.get(kind, kind))


def _objects(values):
    column = needed("numpy").empty(len(values), dtype=object)
    for i, value in enumerate(values):
        column[i] = value
    return column


def _mask(definition, columns):
    """What was not measured becomes NaN: fields whose comment names a group that `valid_groups` does not have."""
    numpy = needed("numpy")
    valid = columns.get("valid_groups")
    if valid is None:
        return
    for field in definition.fields:
        if field.group is None or field.group >= 8 * valid.dtype.itemsize:
            continue
        is_valid = (valid >> field.group) & 1 == 1
        for name in columns:
            if _is_of(name, field.name) and columns[name].dtype.kind in "iuf":
                is_float = columns[name].dtype.kind == "f"
                values = columns[name] if is_float else columns[name].astype("float64")
                columns[name] = numpy.where(is_valid, values, values.dtype.type("nan"))


def _is_of(column, field):
    return column == field or column.startswith((f"{field}.", f"{field}["))


def _without_indexes(column):
    first, *others = column.split("[")
    return first + "".join(other.partition("]")[2] for other in others)


def _collect_units(definition, path, known):
    for field in definition.fields:
        if isinstance(field.kind, Definition):
            _collect_units(field.kind, f"{path}{field.name}.", known)
        elif field.unit:
            known[path + field.name] = field.unit
