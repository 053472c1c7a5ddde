"""Protocol buffers: the shape of one message, and the message types out of a FileDescriptorSet.

A varint's width is fixed by the highest bits of its bytes, so those are the bytes that fix a shape, beside
keys and lengths. A number that is nought is left out of proto3 messages: it is read as nought.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from algid.readers.mcap.columnar import MOST_PARTS, MisfitError, Numbers, Shape

_FIXED = {1: "<f8", 2: "<f4", 6: "<u8", 7: "<u4", 15: "<i4", 16: "<i8"}
_VARINTS = {3, 4, 5, 8, 13, 14, 17, 18}
_ZIGZAG = {17, 18}
_STRING, _MESSAGE, _BYTES, _REPEATED = 9, 11, 12, 3
_DEEPEST = 32


@dataclass(frozen=True)
class Field:
    """A field: its name, type number, message type where it is one, and whether it repeats."""

    name: str
    type: int
    message: str
    repeated: bool


Types = dict[str, dict[int, Field]]


def parse(data: bytes) -> Types:
    """Fields by message type and number, out of a serialised FileDescriptorSet.

    Raises
    ------
    MisfitError
        If the bytes are no such set.
    """
    types: Types = {}
    for number, file in _lengths(data):
        if number != 1:
            continue
        parts = list(_lengths(file))
        package = next((_name(part) for number, part in parts if number == 2), "")
        for number, part in parts:
            if number == 4:
                _add(types, package, part, 0)
    return types


def _add(types: Types, scope: str, message: bytes, depth: int) -> None:
    if depth > _DEEPEST:
        raise MisfitError("message types nested too deep")
    parts = list(_lengths(message))
    name = next((_name(part) for number, part in parts if number == 1), "")
    full = f"{scope}.{name}" if scope else name
    types[full] = dict(_field(part) for number, part in parts if number == 2)
    for number, part in parts:
        if number == 3:
            _add(types, full, part, depth + 1)


def _field(data: bytes) -> tuple[int, Field]:
    values: dict[int, int] = {}
    texts: dict[int, str] = {}
    for number, wire, start, end, value in _entries(data, 0, len(data)):
        if wire == 0:
            values[number] = value
        elif wire == 2:
            texts[number] = _name(data[start:end]) if number in (1, 6) else ""
    field = Field(texts.get(1, ""), values.get(5, 0), texts.get(6, "").lstrip("."), values.get(4) == _REPEATED)
    return values.get(3, 0), field


def _name(data: bytes) -> str:
    return data.decode("utf-8", errors="replace")


def _lengths(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Number and bytes of each length-delimited entry."""
    for number, wire, start, end, _ in _entries(data, 0, len(data)):
        if wire == 2:
            yield number, data[start:end]


def _entries(data: bytes, start: int, end: int) -> Iterator[tuple[int, int, int, int, int]]:
    """Number, wire type, first and last byte, and varint value of each entry of a message."""
    count = 0
    while start < end:
        key, start = _varint(data, start, end)
        number, wire, value = key >> 3, key & 7, 0
        if wire == 0:
            value, stop = _varint(data, start, end)
        elif wire == 2:
            size, start = _varint(data, start, end)
            stop = start + size
        elif wire in (1, 5):
            stop = start + (8 if wire == 1 else 4)
        else:
            raise MisfitError(f"a protobuf entry of wire type {wire}")
        count += 1
        if stop > end or count > MOST_PARTS:
            raise MisfitError("a protobuf entry that reaches past its message")
        yield number, wire, start, stop, value
        start = stop


def _varint(data: bytes, start: int, end: int) -> tuple[int, int]:
    value = 0
    for place in range(start, min(end, start + 10)):
        value |= (data[place] & 0x7F) << (7 * (place - start))
        if data[place] < 0x80:
            return value, place + 1
    raise MisfitError("a protobuf number without an end")


def walk(payload: bytes, root: str, types: Types) -> Shape:
    """The shape of one message.

    Raises
    ------
    MisfitError
        If its bytes do not fit the schema.
    """
    if root not in types:
        raise MisfitError(f"no definition of {root!r}")
    shape = Shape()
    _walk(payload, 0, len(payload), types, root, "", shape, 0)
    return shape


def _walk(data: bytes, start: int, end: int, types: Types, kind: str, prefix: str, shape: Shape, depth: int) -> None:
    if depth > _DEEPEST:
        raise MisfitError("messages nested too deep")
    seen: dict[str, int] = {}
    texts: dict[str, list[str]] = {}
    last = start
    for number, wire, first, stop, _ in _entries(data, start, end):
        field = types[kind].get(number)
        shape.fix(last, first)
        last = stop
        if field is None:
            if wire == 0:
                shape.flags.extend(range(first, stop))
            continue
        path = f"{prefix}{field.name}"
        index = seen.get(path, 0)
        seen[path] = index + 1
        if wire == 2 and field.type == _MESSAGE:
            inner = f"{path}[{index}]." if field.repeated else f"{path}."
            _walk(data, first, stop, types, field.message, inner, shape, depth + 1)
        elif wire == 2 and field.type == _STRING:
            if field.repeated:
                shape.fix(first, stop)
                texts.setdefault(path, []).append(_name(data[first:stop]))
        elif wire == 2 and field.type != _BYTES:
            _packed(data, first, stop, field, path, shape)
        else:
            _number(first, stop, wire, field, f"{path}[{index}]" if field.repeated else path, shape)
    shape.fix(last, end)
    shape.texts |= {path: tuple(found) for path, found in texts.items()}
    _absent(types, kind, prefix, seen, shape, depth)


def _number(first: int, stop: int, wire: int, field: Field, path: str, shape: Shape) -> None:
    if wire == 0 and field.type in _VARINTS:
        shape.flags.extend(range(first, stop))
        shape.numbers[path] = Numbers(first, "varint", 1, stop - first, field.type in _ZIGZAG)
    elif wire in (1, 5) and field.type in _FIXED and int(_FIXED[field.type][-1]) == stop - first:
        shape.numbers[path] = Numbers(first, _FIXED[field.type])
    elif wire != 2:
        raise MisfitError(f"the field {field.name!r} is not encoded as its type says")


def _packed(data: bytes, first: int, stop: int, field: Field, path: str, shape: Shape) -> None:
    if field.type in _FIXED:
        width = int(_FIXED[field.type][-1])
        if (stop - first) % width:
            raise MisfitError(f"the list {field.name!r} has a broken length")
        shape.numbers[path] = Numbers(first, _FIXED[field.type], (stop - first) // width)
    elif field.type in _VARINTS:
        index = 0
        while first < stop:
            _, after = _varint(data, first, stop)
            _number(first, after, 0, field, f"{path}[{index}]", shape)
            first, index = after, index + 1
            shape.fix(after, after)
    else:
        raise MisfitError(f"the field {field.name!r} is not encoded as its type says")


def _absent(types: Types, kind: str, prefix: str, seen: dict[str, int], shape: Shape, depth: int) -> None:
    """Numbers that a message leaves out: nought, also those of a stamp that is left out itself."""
    for field in types[kind].values():
        path = f"{prefix}{field.name}"
        if path in seen or field.repeated:
            continue
        if field.type in _FIXED or field.type in _VARINTS:
            shape.numbers[path] = Numbers(0, "zero")
        elif field.type == _MESSAGE and field.message in types and depth < 4:
            _absent(types, field.message, f"{path}.", {}, shape, depth + 1)
