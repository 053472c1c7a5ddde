"""Protocol buffers: the shape of one message, and the message types out of a FileDescriptorSet.

A varint's width is fixed by the highest bits of its bytes, so those are the bytes that fix a shape, beside
keys and lengths. A number that is zero is left out of proto3 messages: it is read as zero.

google.protobuf reads the descriptors. Messages are walked by hand, since it does not tell where in a message a number
stands: that is what lets a hundred thousand be read at once (`make bench-ingest` has the figure).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from algid.limits import LIMITS
from algid.readers.mcap.columnar import MisfitError, Numbers, Shape
from algid.readers.mcap.definitions import DefinitionError
from algid.words import counted

_FIXED = {1: "<f8", 2: "<f4", 6: "<u8", 7: "<u4", 15: "<i4", 16: "<i8"}
_VARINTS = {3, 4, 5, 8, 13, 14, 17, 18}
_ZIGZAG = {17, 18}
_UINT64 = 4
_STRING, _MESSAGE, _BYTES, _REPEATED = 9, 11, 12, 3


@dataclass(frozen=True)
class ProtobufField:
    """A field: its name, type number, message type where it is one, and whether it repeats."""

    name: str
    type: int
    message: str
    repeated: bool


Types = dict[str, dict[int, ProtobufField]]


def parse(root: str, data: bytes) -> Types:
    """Fields by message type and number, of `root` and all it is made of, out of a serialised FileDescriptorSet.

    Raises
    ------
    DefinitionError
        If the bytes are no such set, or a type is missing.
    """
    from google.protobuf.descriptor_pb2 import FileDescriptorSet
    from google.protobuf.message import DecodeError

    if len(data) > LIMITS.definition_letters:
        raise DefinitionError(
            f"{root}: a descriptor of {counted(len(data), 'byte')}; expected {LIMITS.definition_letters} at most"
        )
    try:
        found = {
            name: message
            for file in FileDescriptorSet.FromString(data).file
            for name, message in _messages(file.package, file.message_type)
        }
        types: Types = {}
        waiting = [root]
        while waiting:
            name = waiting.pop()
            if name in types:
                continue
            if name not in found:
                raise DefinitionError(f"{root}: the type {name[:80]!r} is not defined")
            types[name] = {
                one.number: ProtobufField(one.name, one.type, one.type_name.lstrip("."), one.label == _REPEATED)
                for one in found[name].field
            }
            waiting += [one.message for one in types[name].values() if one.type == _MESSAGE]
    except (DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise DefinitionError(f"{root}: no set of descriptors ({error})") from error
    return types


def _messages(scope: str, messages: Any) -> Iterator[tuple[str, Any]]:
    for message in messages:
        name = f"{scope}.{message.name}" if scope else message.name
        yield name, message
        yield from _messages(name, message.nested_type)


def _entries(data: bytes, start: int, end: int) -> Iterator[tuple[int, int, int, int, int]]:
    """Number, wire type, first and last byte, and varint value of each entry of a message."""
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
        if stop > end:
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
    """The shape of one message of a type among `types`.

    Raises
    ------
    MisfitError
        If its bytes do not fit the schema.
    """
    absent = _Absent(types, root)
    shape = Shape(absent=absent)
    _walk(payload, 0, len(payload), root, "", shape, absent, 0)
    return shape


@dataclass(frozen=True)
class _Absent:
    """Which numbers a message leaves out: those of a stamp that is left out itself, too."""

    types: Types
    root: str
    lists: dict[str, int] = field(default_factory=dict)
    """By path of a repeated field how many of it there are."""

    def __call__(self, path: str) -> bool:
        kind, done = self.root, ""
        *inner, last = path.split(".")
        for part in inner:
            place = re.fullmatch(r"(.*)\[(\d{1,9})\]", part)
            name, index = (place[1], int(place[2])) if place else (part, None)
            found = self._named(kind, name)
            done += name
            if found is None or found.type != _MESSAGE or found.repeated != (index is not None):
                return False
            if index is not None and index >= self.lists.get(done, 0):
                return False
            done += part.removeprefix(name) + "."
            kind = found.message
        found = self._named(kind, last)
        return found is not None and not found.repeated and (found.type in _FIXED or found.type in _VARINTS)

    def _named(self, kind: str, name: str) -> ProtobufField | None:
        return next((one for one in self.types[kind].values() if one.name == name), None)


def _walk(data: bytes, start: int, end: int, kind: str, prefix: str, shape: Shape, absent: _Absent, depth: int) -> None:
    if depth > LIMITS.definition_depth:
        raise MisfitError("messages nested too deep")
    fields: Mapping[int, ProtobufField] = absent.types[kind]
    seen: dict[str, int] = {}
    texts: dict[str, list[str]] = {}
    last = start
    for number, wire, first, stop, _ in _entries(data, start, end):
        shape.count()
        shape.fix(last, first)
        last = stop
        field = fields.get(number)
        if field is None:
            if wire == 0:
                shape.flags.extend(range(first, stop))
            continue
        path = f"{prefix}{field.name}"
        index = seen.get(path, 0)
        seen[path] = index + 1
        if wire == 2 and field.type == _MESSAGE:
            inner = f"{path}[{index}]." if field.repeated else f"{path}."
            _walk(data, first, stop, field.message, inner, shape, absent, depth + 1)
        elif wire == 2 and field.type == _STRING:
            if field.repeated:
                shape.fix(first, stop)
                texts.setdefault(path, []).append(data[first:stop].decode("utf-8", errors="replace"))
        elif wire == 2 and field.type != _BYTES:
            _packed(data, first, stop, field, path, shape)
        else:
            _number(first, stop, wire, field, f"{path}[{index}]" if field.repeated else path, shape)
    shape.fix(last, end)
    shape.texts |= {path: tuple(found) for path, found in texts.items()}
    absent.lists.update(seen)


def _number(first: int, stop: int, wire: int, field: ProtobufField, path: str, shape: Shape) -> None:
    if wire == 0 and field.type in _VARINTS:
        shape.flags.extend(range(first, stop))
        kind = "zigzag" if field.type in _ZIGZAG else "unsigned" if field.type == _UINT64 else "varint"
        shape.numbers[path] = Numbers(first, kind, 1, stop - first)
    elif wire in (1, 5) and field.type in _FIXED and int(_FIXED[field.type][-1]) == stop - first:
        shape.numbers[path] = Numbers(first, _FIXED[field.type])
    elif wire != 2:
        raise MisfitError(f"the field {field.name!r} is not encoded as its type says")


def _packed(data: bytes, first: int, stop: int, field: ProtobufField, path: str, shape: Shape) -> None:
    if field.type in _FIXED:
        width = int(_FIXED[field.type][-1])
        if (stop - first) % width:
            raise MisfitError(f"the list {field.name!r} has a broken length")
        shape.numbers[path] = Numbers(first, _FIXED[field.type], (stop - first) // width)
    elif field.type in _VARINTS:
        index = 0
        while first < stop:
            shape.count()
            _, after = _varint(data, first, stop)
            _number(first, after, 0, field, f"{path}[{index}]", shape)
            first, index = after, index + 1
            shape.fix(after, after)
    else:
        raise MisfitError(f"the field {field.name!r} is not encoded as its type says")
