"""CDR, the encoding of ROS 2 messages (XCDR version 1, either byte order): a message's layout.

Numbers are aligned to their own size, counted from behind the four bytes of the encapsulation.
Messages of ROS 1 have neither: their numbers, little endian, stand one behind the other.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from algid.base.limits import LIMITS
from algid.base.words import counted
from algid.readers.messages.definitions import PRIMITIVES, SEQUENCE, TEXTS, Field, Types
from algid.readers.messages.layout import MessageLayout, MisfitError, Numbers
from algid.readers.stated import GROUPS

_ENDINGS = {0: ">", 1: "<"}
_HEAD = 4
_PADDING = 7
"""Bytes that a middleware may append to a message so that the next one is aligned."""


@dataclass
class _Walk:
    payload: bytes
    types: Types
    layout: MessageLayout
    order: str
    head: int
    aligned: bool
    depth: int = 0

    def __post_init__(self) -> None:
        self.place = self.head

    def structure(self, name: str, prefix: str) -> None:
        self.depth += 1
        if self.depth > LIMITS.definition_depth:  # a type that holds itself has no end
            raise MisfitError(f"{name}: types nested more than {LIMITS.definition_depth} deep")
        for field in self.types[name]:
            path = f"{prefix}{field.name}"
            if field.count is None:
                self.one(field.type, path)
            else:
                self.several(field, path)
        self.depth -= 1

    def several(self, field: Field, path: str) -> None:
        count = self.length() if field.count == SEQUENCE else field.count or 0
        if field.count == SEQUENCE and count > len(self.payload):
            raise MisfitError(
                f"a message of {counted(len(self.payload), 'byte')} that claims a list of {count}"
            )
        if field.type in PRIMITIVES:
            self.numbers(field.type, path, count)
        elif field.type in TEXTS:
            self.layout.texts[path] = tuple(self.text(field.type) for _ in range(count))
        else:
            for index in range(count):
                self.one(field.type, f"{path}[{index}]")

    def one(self, kind: str, path: str) -> None:
        if kind in PRIMITIVES:
            self.numbers(kind, path, 1)
        elif kind in TEXTS and path.rpartition(".")[2] in GROUPS:
            self.layout.labels[path] = self.text(kind)
        elif kind in TEXTS:
            self.advance(self.text_bytes(kind))
        else:
            self.structure(kind, f"{path}.")

    def numbers(self, kind: str, path: str, count: int) -> None:
        code = PRIMITIVES[kind]
        width = int(code[1])
        if count:
            self.align(width)
        self.layout.numbers[path] = Numbers(
            self.place, f"{self.order}{code}" if width > 1 else f"|{code}", count
        )
        self.advance(count * width)

    def length(self) -> int:
        self.align(4)
        start = self.place
        self.advance(4)
        self.layout.pin(start, self.place)
        return int(struct.unpack_from(f"{self.order}I", self.payload, start)[0])

    def text_bytes(self, kind: str) -> int:
        return self.length() * (4 if kind == "wstring" else 1)

    def text(self, kind: str) -> str:
        size = self.text_bytes(kind)
        start = self.place
        self.advance(size)
        self.layout.pin(start, self.place)
        return self.payload[start : self.place].rstrip(b"\0").decode("utf-8", errors="replace")

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


def parse_layout(payload: bytes, root: str, types: Types, *, ros1: bool = False) -> MessageLayout:
    """The layout of one message, of ROS 1 on request.

    Raises
    ------
    MisfitError
        If its representation is not plain CDR, or its bytes do not fit the schema.
    """
    layout, order, head = MessageLayout(), "<", 0
    if not ros1:
        head = int.from_bytes(payload[:2], "big")
        if len(payload) < _HEAD or head not in _ENDINGS:
            xcdr2 = " (XCDR2)" if 6 <= head <= 11 else ""
            raise MisfitError(
                f"the representation 0x{head:04x}{xcdr2}; expected plain CDR, 0x0000 or 0x0001"
            )
        order, head = _ENDINGS[head], _HEAD
        layout.pin(0, _HEAD)
    walk = _Walk(payload, types, layout, order, head, aligned=not ros1)
    walk.structure(root, "")
    if len(payload) - walk.place > (0 if ros1 else _PADDING):
        raise MisfitError(
            f"a message of {counted(len(payload), 'byte')} where its schema ends at {walk.place}"
        )
    return layout
