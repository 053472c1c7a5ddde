"""ROS messages: their definitions as recorded, .msg or IDL, and a message's layout.

A definition is one text, read by rosbags. In CDR, the encoding of ROS 2 (XCDR version 1, either
byte order), numbers are aligned to their own size, counted from behind the four bytes of the
encapsulation. Messages of ROS 1 have neither: their numbers, little endian, stand one behind the
other.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from algid.base.limits import LIMITS
from algid.base.text import counted
from algid.readers.messages.layout import MessageLayout, MisfitError, tells

PRIMITIVES = {
    "bool": "u1", "byte": "u1", "char": "u1", "int8": "i1", "uint8": "u1",
    "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
TEXTS = ("string", "wstring")
SEQUENCE = -1


@dataclass(frozen=True)
class Field:
    """A field: the name of its type and how often it stands there (None: once, or `SEQUENCE`)."""

    name: str
    type: str
    count: int | None


Types = dict[str, tuple[Field, ...]]
_NOTHING = Field("structure_needs_at_least_one_member", "uint8", None)
"""An empty structure takes one byte in ROS 2, since IDL has none."""
_TIMES_OF_ROS1: Types = {
    "builtin_interfaces/msg/Time": (Field("secs", "uint32", None), Field("nsecs", "uint32", None)),
    "builtin_interfaces/msg/Duration": (
        Field("secs", "int32", None), Field("nsecs", "int32", None)
    ),
}  # fmt: skip
_LINE = re.compile(r"^=+[ \t]*\n\s*MSG:\s*", re.MULTILINE)
"""Between the types of one text."""
_WIDE = re.compile(r"^([ \t]*wstring)<=\d+", re.MULTILINE)
"""Texts of a bounded length, whose kind rosbags does not know in .msg."""
_CONSTANT = re.compile(r"^[ \t]*\w+(?:<=\d+)?[ \t]+\w+[ \t]*=.*$", re.MULTILINE)
"""No field; rosbags reads those in capitals alone."""
_SECTION = re.compile(r"^=+[ \t]*\nIDL:[^\n]*\n", re.MULTILINE)
_INCLUDE = re.compile(r"^[ \t]*#[^\n]*$", re.MULTILINE)
"""What rosidl begins every file with, and rosbags does not read."""
_MISREAD = re.compile(r"sequence\s*<\s*sequence|@optional")
"""What rosbags takes for something else, and rosidl never writes."""


@lru_cache(maxsize=64)
def parse(root: str, text: str, *, idl: bool = False, ros1: bool = False) -> tuple[str, Types]:
    """The full name of `root` (``package/msg/Type``), and fields by type name.

    In ROS 1 times are primitive.

    Raises
    ------
    MisfitError
        If the text cannot be read, or a type is missing.
    """
    from rosbags.typesys import get_types_from_idl
    from rosbags.typesys.base import make_typesdict
    from rosbags.typesys.msg import MSGParser, normalize_msgtype

    text, root = text.replace("\r\n", "\n"), normalize_msgtype(root)
    if idl and (odd := _MISREAD.search(text)):
        raise MisfitError(f"{root}: {odd[0]!r} is not what ROS 2 writes")
    types: Types = dict(_TIMES_OF_ROS1) if ros1 else {}
    found: dict[str, Any] = {}
    try:
        if idl:
            for section in filter(str.strip, _SECTION.split(_INCLUDE.sub("", text))):
                found |= get_types_from_idl(section)
        else:
            plain = _WIDE.sub(r"\1", _LINE.sub(f"{'=' * 80}\nMSG: ", text))
            parser = MSGParser(f"MSG: {root}\n{_CONSTANT.sub('', plain)}")
            parser.PackageName = parser.MixedSnake  # capitals, which ROS 1 allows
            found |= make_typesdict(parser.specification())
        for owner, (_, members) in found.items():
            fields = tuple(_member(name, *kind) for name, kind in members)
            types[owner] = fields or (() if ros1 else (_NOTHING,))
    except Exception as error:  # what the parser raises, a RecursionError too
        said = str(error).split("\n")  # what, the text, how far it was read, what follows
        reason = " ".join((said[0][:100], *said[3:4])).strip()[:200]
        raise MisfitError(f"{root}: its text cannot be read ({reason})") from error
    known = {*types, *PRIMITIVES, *TEXTS}
    used = {field.type for fields in types.values() for field in fields}
    for missing in sorted((used | {root}) - known):
        raise MisfitError(f"{root}: the type {missing!r} is not defined")
    return root, types


def _member(name: str, form: Any, what: Any) -> Field:
    """A member of a structure out of rosbags' description of its type."""
    from rosbags.interfaces import Nodetype

    if form == Nodetype.BASE:
        return Field(name, what[0], None)
    if form == Nodetype.NAME:
        plain = what.rpartition("/")[2]  # of .msg rosbags knows no wstring
        return Field(name, plain if plain in TEXTS else what, None)
    inner, size = what
    one = _member(name, *inner)
    return Field(name, one.type, size if form == Nodetype.ARRAY else SEQUENCE)


_ENDINGS = {0: ">", 1: "<"}
_HEAD = 4
_PADDING = 7
"""Bytes that a middleware may append to a message so that the next one is aligned."""


def parse_layout(payload: bytes, root: str, types: Types, *, ros1: bool = False) -> MessageLayout:
    """The layout of one message, of ROS 1 on request.

    Raises
    ------
    MisfitError
        If its representation is not plain CDR, or its bytes do not fit the schema.
    """
    walk = _Walk(payload, types, MessageLayout(), "<", aligned=not ros1)
    if not ros1:
        head = int.from_bytes(payload[:2], "big")
        if len(payload) < _HEAD or head not in _ENDINGS:
            raise MisfitError(
                f"the representation 0x{head:04x}; expected plain CDR, 0x0000 or 0x0001, not XCDR2"
            )
        walk.order, walk.place = _ENDINGS[head], _HEAD
        walk.layout.pin(0, _HEAD)
    walk.structure(root, "")
    if len(payload) - walk.place > (0 if ros1 else _PADDING):
        raise MisfitError(
            f"a message of {counted(len(payload), 'byte')} where its schema ends at {walk.place}"
        )
    return walk.layout


@dataclass
class _Walk:
    payload: bytes
    types: Types
    layout: MessageLayout
    order: str
    aligned: bool
    place: int = 0

    def structure(self, name: str, prefix: str) -> None:
        """Take in the fields of a structure that begins at `place`."""
        if prefix.count(".") > LIMITS.definition_depth:  # a type that holds itself has no end
            raise MisfitError(f"{name}: types nested more than {LIMITS.definition_depth} deep")
        for field in self.types[name]:
            path = f"{prefix}{field.name}"
            count = self.length() if field.count == SEQUENCE else field.count
            if count is not None and count > len(self.payload):
                raise MisfitError(
                    f"a message of {counted(len(self.payload), 'byte')} that claims a list of "
                    f"{count}"
                )
            if code := PRIMITIVES.get(field.type):
                size = int(code[1])
                if count != 0:
                    self.align(size)
                self.layout.add(path, self.place, f"{self.order if size > 1 else '|'}{code}", count)
                self.take(size if count is None else count * size)
            elif field.type in TEXTS and count is not None:
                self.layout.texts[path] = tuple(self.text(field.type) for _ in range(count))
            elif field.type in TEXTS and tells(path):
                self.layout.label(path, self.text(field.type))
            elif field.type in TEXTS:
                self.text(field.type, pinned=False)
            else:
                for index in [""] if count is None else map("[{}]".format, range(count)):
                    self.structure(field.type, f"{path}{index}.")

    def length(self) -> int:
        """The next length, which fixes the layout."""
        self.align(4)
        start = self.place
        self.layout.pin(start, start + 4)
        return int(struct.unpack(f"{self.order}I", self.take(4))[0])

    def text(self, kind: str, *, pinned: bool = True) -> str:
        """The next text; what it says fixes the layout where it is `pinned`."""
        width, form = 1, "utf-8"
        if kind == "wstring":
            width, form = 4, "utf-32-le" if self.order == "<" else "utf-32-be"
        content = self.take(self.length() * width)
        if pinned:
            self.layout.pin(self.place - len(content), self.place)
        return content.decode(form, errors="replace").rstrip("\0")

    def align(self, size: int) -> None:
        """Pass over the bytes before a number of that size."""
        if self.aligned:
            self.place += -(self.place - _HEAD) % size

    def take(self, size: int) -> bytes:
        """The next bytes."""
        start = self.place
        self.place += size
        if self.place > len(self.payload):
            raise MisfitError(
                f"a message of {counted(len(self.payload), 'byte')} where its schema needs "
                f"{self.place} at least"
            )
        return self.payload[start : self.place]
