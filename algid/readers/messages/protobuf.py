"""Protocol buffers: the shape of one message, and the message types out of a FileDescriptorSet.

A varint's width is fixed by the highest bits of its bytes, so those are the bytes that fix a
shape, beside keys and lengths. A plain number of proto3 that is zero is left out of its message:
it is read as zero. A number that is known to be unset is not: one of a oneof, an ``optional``
one, one of proto2, one of a message that is not there.

google.protobuf reads the descriptors. Messages are walked by hand, since it does not tell where in
a message a number stands: that is what lets a hundred thousand be read at once (`make
bench-ingest` has the figure).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from algid.base.limits import LIMITS
from algid.base.words import counted
from algid.readers.messages.columnar import MisfitError, Numbers, Shape
from algid.readers.messages.definitions import DefinitionError

_FIXED = {1: "<f8", 2: "<f4", 6: "<u8", 7: "<u4", 15: "<i4", 16: "<i8"}
_VARINTS = {3, 4, 5, 8, 13, 14, 17, 18}
_ZIGZAG = {17, 18}
_UINT64 = 4
_STRING, _MESSAGE, _BYTES, _REPEATED = 9, 11, 12, 3


@dataclass(frozen=True)
class ProtobufField:
    """A field: its name, type number, message type where it is one, and whether it repeats.

    `implicit`: it is left out where it is zero. `oneof`: the number of the oneof that it is of,
    None if of none.
    """

    name: str
    type: int
    message: str
    repeated: bool
    implicit: bool
    oneof: int | None


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

    if len(data) > LIMITS.definition_letters:
        raise DefinitionError(
            f"{root}: a descriptor of {counted(len(data), 'byte')}; expected "
            f"{LIMITS.definition_letters} at most"
        )
    try:
        known = {}
        for file in FileDescriptorSet.FromString(data).file:
            for name, message in _messages(file.package, file.message_type):
                known[name] = message, file.syntax
        types: Types = {}
        waiting = [root]
        while waiting:
            name = waiting.pop()
            if name in types:
                continue
            if name not in known:
                raise DefinitionError(f"{root}: the type {name[:80]!r} is not defined")
            message, syntax = known[name]
            if syntax == "editions":
                raise DefinitionError(
                    f"{root}: {name} is written in an edition of Protobuf; expected proto2 or "
                    "proto3: record with a schema of either"
                )
            types[name] = {one.number: _field(one, syntax) for one in message.field}
            waiting += [one.message for one in types[name].values() if one.type == _MESSAGE]
    except (DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise DefinitionError(f"{root}: no set of descriptors ({error})") from error
    return types


def _field(one: Any, syntax: str) -> ProtobufField:
    # an optional field of proto3 has a oneof of its own; the others are left out where they are 0
    oneof = one.oneof_index if one.HasField("oneof_index") else None
    return ProtobufField(
        one.name,
        one.type,
        one.type_name.lstrip("."),
        one.label == _REPEATED,
        implicit=syntax == "proto3" and oneof is None,
        oneof=oneof,
    )


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
    walk = _Walk(payload, types, root)
    walk.message(0, len(payload), root, "", 0)
    for path, texts in walk.texts.items():
        walk.shape.texts[path] = tuple(texts)
    return walk.shape


class _Walk:
    """A walk over one message.

    `counts` has by path of a repeated field how many of it there are so far, `there` the paths of
    messages. A field that comes again goes on where it ended, wherever it stands: so do the parts
    of a message that comes again.
    """

    def __init__(self, data: bytes, types: Types, root: str) -> None:
        self.data, self.types, self.root = data, types, root
        self.counts: dict[str, int] = {}
        self.there: set[str] = set()
        self.texts: dict[str, list[str]] = {}
        self.shape = Shape(absent=self.absent)

    def absent(self, path: str) -> bool:
        """Whether the message leaves the number at a path out because it is zero."""
        kind, done = self.root, ""
        *inner, last = path.split(".")
        for part in inner:
            field_of = self._named(kind, part.partition("[")[0])
            done += part
            if field_of is None or field_of.type != _MESSAGE or done not in self.there:
                return False
            done += "."
            kind = field_of.message
        field_of = self._named(kind, last)
        return (
            field_of is not None
            and field_of.implicit
            and not field_of.repeated
            and _is_number(field_of)
        )

    def _named(self, kind: str, name: str) -> ProtobufField | None:
        return next((one for one in self.types[kind].values() if one.name == name), None)

    def message(self, start: int, end: int, kind: str, prefix: str, depth: int) -> None:
        """Take in the fields of a message of type `kind`, whose bytes are [start, end)."""
        if depth > LIMITS.definition_depth:
            raise MisfitError("messages nested too deep")
        fields: Mapping[int, ProtobufField] = self.types[kind]
        chosen: dict[int, ProtobufField] = {}
        last = start
        for number, wire, first, stop, _ in _entries(self.data, start, end):
            self.shape.count()
            self.shape.fix(last, first)
            last = stop
            field = fields.get(number)
            if field is None:
                if wire == 0:
                    self.shape.flags.extend(range(first, stop))
                continue
            if field.oneof is not None:
                before = chosen.setdefault(field.oneof, field)
                if before != field:  # the last one set holds
                    self._unset(f"{prefix}{before.name}")
                    chosen[field.oneof] = field
            self._field(field, wire, first, stop, f"{prefix}{field.name}", depth)
        self.shape.fix(last, end)

    def _field(
        self, field: ProtobufField, wire: int, first: int, stop: int, path: str, depth: int
    ) -> None:
        if wire == 2 and field.type == _MESSAGE:
            place = f"{path}[{self._next(path)}]" if field.repeated else path
            self.there.add(place)
            self.message(first, stop, field.message, f"{place}.", depth + 1)
        elif wire == 2 and field.type == _STRING:
            if field.repeated:
                self.shape.fix(first, stop)
                self.texts.setdefault(path, []).append(
                    self.data[first:stop].decode("utf-8", errors="replace")
                )
        elif wire == 2 and field.type != _BYTES:
            self._packed(first, stop, field, path)
        elif field.repeated:
            self._single(path)
            self._number(first, stop, wire, field, f"{path}[{self._next(path)}]")
        else:
            self._number(first, stop, wire, field, path)

    def _next(self, path: str, more: int = 1) -> int:
        """The place of the next of a repeated field, and of `more` - 1 behind it."""
        before = self.counts.get(path, 0)
        self.counts[path] = before + more
        return before

    def _unset(self, path: str) -> None:
        """Forget what was found of a field."""
        for known in (self.shape.numbers, self.texts, self.counts):
            for one in list(known):
                if one == path or one.startswith((f"{path}.", f"{path}[")):
                    del known[one]
        self.there = {one for one in self.there if one != path and not one.startswith(f"{path}.")}

    def _single(self, path: str) -> None:
        """Note the numbers of a list so far one by one, since more of it stand elsewhere."""
        block = self.shape.numbers.pop(path, None)
        if block is not None:
            self.shape.count(block.count)
            width = int(block.kind[-1])
            for index in range(block.count):
                self.shape.numbers[f"{path}[{index}]"] = Numbers(
                    block.offset + index * width, block.kind
                )

    def _number(self, first: int, stop: int, wire: int, field: ProtobufField, path: str) -> None:
        if wire == 0 and field.type in _VARINTS:
            self.shape.flags.extend(range(first, stop))
            kind = (
                "zigzag"
                if field.type in _ZIGZAG
                else "unsigned"
                if field.type == _UINT64
                else "varint"
            )
            self.shape.numbers[path] = Numbers(first, kind, 1, stop - first)
        elif (
            wire in (1, 5) and field.type in _FIXED and int(_FIXED[field.type][-1]) == stop - first
        ):
            self.shape.numbers[path] = Numbers(first, _FIXED[field.type])
        elif wire != 2:
            raise MisfitError(f"the field {field.name!r} is not encoded as its type says")

    def _packed(self, first: int, stop: int, field: ProtobufField, path: str) -> None:
        """Take in numbers side by side; a list may stand in several such runs."""
        if not field.repeated or not _is_number(field):
            raise MisfitError(f"the field {field.name!r} is not encoded as its type says")
        if field.type in _FIXED:
            self._block(first, stop, field, path)
            return
        while first < stop:
            self.shape.count()
            _, after = _varint(self.data, first, stop)
            self._number(first, after, 0, field, f"{path}[{self._next(path)}]")
            first = after
            self.shape.fix(after, after)

    def _block(self, first: int, stop: int, field: ProtobufField, path: str) -> None:
        kind = _FIXED[field.type]
        width = int(kind[-1])
        size = (stop - first) // width
        if size * width != stop - first:
            raise MisfitError(f"the list {field.name!r} has a broken length")
        before = self._next(path, size)
        if not before:
            self.shape.numbers[path] = Numbers(first, kind, size)
            return
        self._single(path)
        self.shape.count(size)
        for index in range(size):
            self.shape.numbers[f"{path}[{before + index}]"] = Numbers(first + index * width, kind)


def _is_number(field: ProtobufField) -> bool:
    return field.type in _FIXED or field.type in _VARINTS
