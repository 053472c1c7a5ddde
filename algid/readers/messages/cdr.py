"""CDR, the encoding of ROS 2 messages (XCDR version 1, either byte order): a message's shape.

Numbers are aligned to their own size, counted from behind the four bytes of the encapsulation.
Messages of ROS 1 have neither: their numbers, little endian, stand one behind the other.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from algid.base.words import counted
from algid.readers.messages.columnar import MisfitError, Numbers, Shape
from algid.readers.messages.definitions import PRIMITIVES, TEXTS, Field, Types
from algid.readers.stated import GROUPS

_ENDINGS = {0: ">", 1: "<"}
_HEAD = 4
_PADDING = 7
"""Bytes that a middleware may append to a message so that the next one is aligned."""


@dataclass
class _Walk:
    payload: bytes
    types: Types
    shape: Shape
    order: str = "<"
    head: int = _HEAD
    aligned: bool = True

    def __post_init__(self) -> None:
        self.place = self.head

    def structure(self, name: str, prefix: str) -> None:
        self.shape.count(1 + len(self.types[name]))
        for field in self.types[name]:
            self.field(field, f"{prefix}{field.name}")

    def field(self, field: Field, path: str) -> None:
        if field.count is None:
            self.one(field.type, path)
            return
        count = self.length() if field.count < 0 else field.count
        if field.type in PRIMITIVES:
            self.numbers(field.type, path, count)
        elif field.type in TEXTS:
            self.shape.count(self.possible(count, 4))
            self.shape.texts[path] = tuple(self.text(field.type) for _ in range(count))
        else:
            for index in range(self.possible(count, 1)):
                self.one(field.type, f"{path}[{index}]")

    def one(self, kind: str, path: str) -> None:
        if kind in PRIMITIVES:
            self.numbers(kind, path, 1)
        elif kind in TEXTS and path.rpartition(".")[2] in GROUPS:
            self.shape.labels[path] = self.text(kind)
        elif kind in TEXTS:
            self.skipped_text(kind)
        else:
            self.structure(kind, f"{path}.")

    def numbers(self, kind: str, path: str, count: int) -> None:
        code = PRIMITIVES[kind]
        width = int(code[1])
        if count:
            self.align(width)
        self.shape.numbers[path] = Numbers(
            self.place, f"{self.order}{code}" if width > 1 else f"|{code}", count
        )
        self.advance(count * width)

    def length(self) -> int:
        self.align(4)
        start = self.place
        self.advance(4)
        self.shape.fix(start, self.place)
        return int(struct.unpack_from(f"{self.order}I", self.payload, start)[0])

    def text(self, kind: str) -> str:
        size = self.length() * (4 if kind == "wstring" else 1)
        start = self.place
        self.advance(size)
        self.shape.fix(start, self.place)
        return self.payload[start : self.place].rstrip(b"\0").decode("utf-8", errors="replace")

    def skipped_text(self, kind: str) -> None:
        self.advance(self.length() * (4 if kind == "wstring" else 1))

    def align(self, width: int) -> None:
        if self.aligned:
            self.place += -(self.place - self.head) % width

    def advance(self, size: int) -> None:
        self.place += size
        if self.place > len(self.payload):
            raise MisfitError(
                f"a message of {counted(len(self.payload), 'byte')} where its schema needs "
                f"{self.place} at least"
            )

    def possible(self, count: int, least: int) -> int:
        if count * least > len(self.payload) - self.place:
            raise MisfitError(
                f"a message of {counted(len(self.payload), 'byte')} that claims a list of {count}"
            )
        return count


def walk(payload: bytes, root: str, types: Types) -> Shape:
    """The shape of one message.

    Raises
    ------
    MisfitError
        If its representation is not plain CDR, or its bytes do not fit the schema.
    """
    if len(payload) < _HEAD:
        raise MisfitError(f"a message of {counted(len(payload), 'byte')}; CDR has four at least")
    representation = int.from_bytes(payload[:2], "big")
    if representation not in _ENDINGS:
        raise MisfitError(
            "the representation "
            f"0x{representation:04x}{' (XCDR2)' if 6 <= representation <= 11 else ''}; "
            "expected plain CDR, 0x0000 or 0x0001"
        )
    shape = Shape()
    shape.fix(0, _HEAD)
    walk = _Walk(payload, types, shape, _ENDINGS[representation])
    walk.structure(root, "")
    if len(payload) - walk.place > _PADDING:
        raise MisfitError(
            f"a message of {counted(len(payload), 'byte')} where its schema ends at {walk.place}"
        )
    return shape


def walk_ros1(payload: bytes, root: str, types: Types) -> Shape:
    """The shape of one message of ROS 1.

    Raises
    ------
    MisfitError
        If its bytes do not fit the schema.
    """
    walk = _Walk(payload, types, Shape(), head=0, aligned=False)
    walk.structure(root, "")
    if len(payload) != walk.place:
        raise MisfitError(
            f"a message of {counted(len(payload), 'byte')} where its schema ends at {walk.place}"
        )
    return walk.shape
