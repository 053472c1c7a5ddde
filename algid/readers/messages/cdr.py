"""CDR, the encoding of ROS 2 messages (XCDR version 1, either byte order): a message's layout.

Numbers are aligned to their own size, counted from behind the four bytes of the encapsulation.
Messages of ROS 1 have neither: their numbers, little endian, stand one behind the other.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from algid.base.limits import LIMITS
from algid.base.words import counted
from algid.readers.messages.definitions import PRIMITIVES, SEQUENCE, TEXTS, Types
from algid.readers.messages.layout import MessageLayout, MisfitError, Numbers
from algid.readers.stated import GROUPS

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
            xcdr2 = " (XCDR2)" if 6 <= head <= 11 else ""
            raise MisfitError(
                f"the representation 0x{head:04x}{xcdr2}; expected plain CDR, 0x0000 or 0x0001"
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
                many = 1 if count is None else count
                kind = f"{self.order if size > 1 else '|'}{code}"
                self.layout.numbers[path] = Numbers(self.place, kind, many)
                self.take(many * size)
            elif field.type in TEXTS and count is not None:
                self.layout.texts[path] = tuple(self.text(field.type) for _ in range(count))
            elif field.type in TEXTS and field.name in GROUPS:
                self.layout.labels[path] = self.text(field.type)
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
        content = self.take(self.length() * (4 if kind == "wstring" else 1))
        if pinned:
            self.layout.pin(self.place - len(content), self.place)
        return content.rstrip(b"\0").decode("utf-8", errors="replace")

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
