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

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from algid.base.limits import LIMITS
from algid.readers.messages.layout import MessageLayout, MisfitError, Number, tells

_KINDS = {1: "<f8", 2: "<f4", 6: "<u8", 7: "<u4", 15: "<i4", 16: "<i8"}
_KINDS |= dict.fromkeys((3, 5, 8, 13, 14), "varint") | {4: "unsigned", 17: "zigzag", 18: "zigzag"}
_STRING, _MESSAGE, _BYTES, _REPEATED = 9, 11, 12, 3
_ZERO = Number(0, "zero", 0)

Types = dict[str, tuple[dict[int, Any], list[str]]]
"""By message type its field descriptors by number, and the names of the numbers that it leaves out
where they are zero."""


def parse(root: str, data: bytes) -> Types:
    """The message types of a FileDescriptorSet.

    Raises
    ------
    MisfitError
        If the bytes are no such set, or `root` is not in it.
    """
    from google.protobuf.descriptor_pb2 import FileDescriptorSet
    from google.protobuf.message import DecodeError

    types: Types = {}
    try:
        for file in FileDescriptorSet.FromString(data).file:
            waiting = [(f".{file.package}".rstrip("."), one) for one in file.message_type]
            while waiting:
                scope, message = waiting.pop()
                name = f"{scope}.{message.name}"
                zeros = []
                for own in message.field:
                    # an optional field of proto3 has a oneof of its own
                    told = own.label == _REPEATED or own.HasField("oneof_index")
                    if file.syntax == "proto3" and own.type in _KINDS and not told:
                        zeros.append(own.name)
                types[name] = {own.number: own for own in message.field}, zeros
                waiting += [(name, one) for one in message.nested_type]
    except (DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise MisfitError(f"{root}: no set of descriptors ({error})") from error
    if f".{root}" not in types:
        raise MisfitError(f"{root}: the type is not defined")
    return types


def comments(data: bytes) -> list[str]:
    """The comments beside the fields of a FileDescriptorSet, where it was made with them."""
    from google.protobuf.descriptor_pb2 import FileDescriptorSet

    lines = []
    for file in FileDescriptorSet.FromString(data).file:
        for place in file.source_code_info.location:
            lines += f"{place.leading_comments}\n{place.trailing_comments}".splitlines()
    return list(filter(str.strip, lines))


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
    walk.message(0, len(payload), f".{root}", "")
    return walk.layout


@dataclass
class _Walk:
    """A walk over one message; `counts` has how many of a repeated field there are, or -1."""

    data: bytes
    types: Types
    counts: Counter[str] = field(default_factory=Counter)
    layout: MessageLayout = field(default_factory=MessageLayout)

    def message(self, start: int, end: int, kind: str, prefix: str) -> None:
        """Take in the fields of a message of type `kind`, whose bytes are [start, end)."""
        if prefix.count(".") > LIMITS.definition_depth or kind not in self.types:
            raise MisfitError(f"a message of type {kind[:80]!r}, nested too deep or not defined")
        fields, zeros = self.types[kind]
        last = start
        for number, wire, first, stop in _entries(self.data, start, end):
            self.layout.pin(last, first)
            last = stop
            if number in fields:
                self.field(fields[number], wire, first, stop, prefix)
            elif wire == 0:
                self.layout.flags.extend(range(first, stop))
        self.layout.pin(last, end)
        for name in zeros:
            self.layout.numbers.setdefault(prefix + name, _ZERO)

    def field(self, own: Any, wire: int, first: int, stop: int, prefix: str) -> None:
        """Take in a field, whose bytes are [first, stop)."""
        kind, repeated = _KINDS.get(own.type, ""), own.label == _REPEATED
        path = place = prefix + own.name
        width = int(kind[-1]) if kind.startswith("<") else 0
        packed = repeated and wire == 2 and width > 0
        if repeated:
            before = self.counts[path]
            if before < 0 or (packed and (before or (stop - first) % width)):
                raise MisfitError(f"the list {own.name!r} comes in parts or has a broken length")
            place = f"{path}[{before}]"
            self.counts[path] = -1 if packed else before + 1
        if packed:
            self.layout.add(path, first, kind, (stop - first) // width)
        elif wire == 2 and own.type == _MESSAGE:
            self.message(first, stop, own.type_name, f"{place}.")
        elif wire == 2 and own.type == _STRING:
            if repeated or tells(path):
                self.layout.pin(first, stop)
                text = self.data[first:stop].decode("utf-8", errors="replace")
                if repeated:
                    self.layout.texts[path] = (*self.layout.texts.get(path, ()), text)
                else:
                    self.layout.label(path, text)
        elif wire == 0 and kind and not width:
            self.layout.flags.extend(range(first, stop))
            self.layout.numbers[place] = Number(first, kind, stop - first)
        elif wire in (1, 5) and width == stop - first:
            self.layout.add(place, first, kind)
        elif wire != 2 or not (own.type == _BYTES or (repeated and kind and not width)):
            raise MisfitError(f"the field {own.name!r} is not encoded as its type says")
