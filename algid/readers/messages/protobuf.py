"""Protocol buffers: the layout of one message, and the message types out of a FileDescriptorSet.

A varint's width is fixed by the highest bits of its bytes, so those are the bytes that fix a
layout, beside keys and lengths. A plain number of proto3 that is zero is left out of its message:
it is read as zero. A number that is known to be unset is not: one of a oneof, an ``optional``
one, one of proto2, one of a message that is not there.

google.protobuf reads the descriptors. Messages are parsed by hand, since it does not tell where in
a message a number stands: that is what lets a hundred thousand be read at once (`make
bench-ingest` has the figure).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from algid.base.limits import LIMITS
from algid.readers.messages.definitions import DefinitionError
from algid.readers.messages.layout import MessageLayout, MisfitError, Numbers

_FIXED = {1: "<f8", 2: "<f4", 6: "<u8", 7: "<u4", 15: "<i4", 16: "<i8"}
_VARINTS = dict.fromkeys((3, 5, 8, 13, 14), "varint") | {
    4: "unsigned",
    17: "zigzag",
    18: "zigzag",
}
_STRING, _MESSAGE, _BYTES, _REPEATED = 9, 11, 12, 3


@dataclass(frozen=True)
class ProtobufField:
    """A field: its name, type number, message type where it is one, and whether it repeats.

    `implicit`: it is left out where it is zero.
    """

    name: str
    type: int
    message: str
    repeated: bool
    implicit: bool


Types = dict[str, dict[int, ProtobufField]]


def parse(root: str, data: bytes) -> Types:
    """Fields by message type and number, of `root` and all its parts, from a FileDescriptorSet.

    Raises
    ------
    DefinitionError
        If the bytes are no such set, or a type is missing.
    """
    from google.protobuf.descriptor_pb2 import FileDescriptorSet
    from google.protobuf.message import DecodeError

    try:
        known = {}
        for file in FileDescriptorSet.FromString(data).file:
            for name, message in _messages(file.package, file.message_type):
                known[name] = message, file.syntax == "proto3"
    except (DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise DefinitionError(f"{root}: no set of descriptors ({error})") from error
    types: Types = {}
    waiting = [root]
    while waiting:
        name = waiting.pop()
        if name in types:
            continue
        if name not in known:
            raise DefinitionError(f"{root}: the type {name[:80]!r} is not defined")
        message, proto3 = known[name]
        types[name] = {}
        for one in message.field:
            repeated = one.label == _REPEATED
            # an optional field of proto3 has a oneof of its own
            implicit = proto3 and not repeated and not one.HasField("oneof_index")
            kind = one.type_name.lstrip(".")
            types[name][one.number] = ProtobufField(one.name, one.type, kind, repeated, implicit)
            if one.type == _MESSAGE:
                waiting.append(kind)
    return types


def _messages(scope: str, messages: Any) -> Iterator[tuple[str, Any]]:
    for message in messages:
        name = f"{scope}.{message.name}" if scope else message.name
        yield name, message
        yield from _messages(name, message.nested_type)


def _entries(data: bytes, start: int, end: int) -> Iterator[tuple[int, int, int, int]]:
    """Number, wire type, first and last byte of each entry of a message."""
    while start < end:
        key, start = _varint(data, start, end)
        wire, stop = key & 7, start
        if wire == 0:
            _, stop = _varint(data, start, end)
        elif wire == 2:
            size, start = _varint(data, start, end)
            stop = start + size
        elif wire in (1, 5):
            stop = start + (8 if wire == 1 else 4)
        else:
            raise MisfitError(f"a protobuf entry of wire type {wire}")
        if stop > end:
            raise MisfitError("a protobuf entry that reaches past its message")
        yield key >> 3, wire, start, stop
        start = stop


def _varint(data: bytes, start: int, end: int) -> tuple[int, int]:
    value = 0
    for place in range(start, min(end, start + 10)):
        value |= (data[place] & 0x7F) << (7 * (place - start))
        if data[place] < 0x80:
            return value, place + 1
    raise MisfitError("a protobuf number without an end")


def parse_layout(payload: bytes, root: str, types: Types) -> MessageLayout:
    """The layout of one message of a type among `types`.

    Raises
    ------
    MisfitError
        If its bytes do not fit the schema.
    """
    walk = _Walk(payload, types)
    walk.message(0, len(payload), root, "")
    walk.layout.absent = lambda path: walk.is_absent(root, path)
    return walk.layout


@dataclass
class _Walk:
    """A walk over one message.

    `counts` has by path of a repeated field how many of it there are so far, `there` the paths of
    messages.
    """

    data: bytes
    types: Types
    counts: dict[str, int] = field(default_factory=dict)
    there: set[str] = field(default_factory=set)
    layout: MessageLayout = field(default_factory=MessageLayout)
    depth: int = 0

    def is_absent(self, kind: str, path: str) -> bool:
        """True for the path of a number that the message leaves out because it is zero."""
        *inner, last = path.split(".")
        for place, part in enumerate(inner, start=1):
            outer = self._named(kind, part.partition("[")[0])
            if outer is None or ".".join(inner[:place]) not in self.there:
                return False
            kind = outer.message
        found = self._named(kind, last)
        return found is not None and found.implicit and found.type in {**_FIXED, **_VARINTS}

    def _named(self, kind: str, name: str) -> ProtobufField | None:
        return next((one for one in self.types[kind].values() if one.name == name), None)

    def message(self, start: int, end: int, kind: str, prefix: str) -> None:
        """Take in the fields of a message of type `kind`, whose bytes are [start, end)."""
        self.depth += 1
        if self.depth > LIMITS.definition_depth:
            raise MisfitError("messages nested too deep")
        last = start
        for number, wire, first, stop in _entries(self.data, start, end):
            self.layout.pin(last, first)
            last = stop
            own = self.types[kind].get(number)
            if own is not None:
                self._field(own, wire, first, stop, f"{prefix}{own.name}")
            elif wire == 0:
                self.layout.flags.extend(range(first, stop))
        self.layout.pin(last, end)
        self.depth -= 1

    def _field(self, own: ProtobufField, wire: int, first: int, stop: int, path: str) -> None:
        numbers, fixed = self.layout.numbers, _FIXED.get(own.type, "")
        if own.repeated and wire == 2 and fixed:  # a packed list
            width = int(fixed[-1])
            if path in self.counts or (stop - first) % width:
                raise MisfitError(f"the list {own.name!r} comes in parts or has a broken length")
            self.counts[path] = (stop - first) // width
            numbers[path] = Numbers(first, fixed, self.counts[path])
            return
        place = path
        if own.repeated:
            if path in numbers:
                raise MisfitError(f"the list {own.name!r} comes in parts")
            place = f"{path}[{self.counts.get(path, 0)}]"
            self.counts[path] = self.counts.get(path, 0) + 1
        if wire == 2 and own.type == _MESSAGE:
            self.there.add(place)
            self.message(first, stop, own.message, f"{place}.")
        elif wire == 2 and own.type == _STRING:
            if own.repeated:
                self.layout.pin(first, stop)
                text = self.data[first:stop].decode("utf-8", errors="replace")
                self.layout.texts[path] = (*self.layout.texts.get(path, ()), text)
        elif wire == 0 and own.type in _VARINTS:
            self.layout.flags.extend(range(first, stop))
            numbers[place] = Numbers(first, _VARINTS[own.type], 1, stop - first)
        elif wire in (1, 5) and fixed and int(fixed[-1]) == stop - first:
            numbers[place] = Numbers(first, fixed)
        elif wire != 2 or not (own.type == _BYTES or (own.repeated and own.type in _VARINTS)):
            raise MisfitError(f"the field {own.name!r} is not encoded as its type says")
