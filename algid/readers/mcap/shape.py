"""The shape of one message: where its numbers stand, which bytes fix that, and what its strings say.

Messages of one size whose fixing bytes are equal have the same shape, so what one walk over one message
found holds for all of them: that is what makes reading by columns possible.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

MOST_PARTS = 20_000
"""Structures a message may be made of; an image is one."""


class MisfitError(Exception):
    """A message that is not what its schema says."""


@dataclass(frozen=True)
class Numbers:
    """`count` numbers side by side at byte `offset`: a NumPy type, or "varint" in `width` bytes."""

    offset: int
    kind: str
    count: int = 1
    width: int = 0
    zigzag: bool = False


@dataclass
class Shape:
    """What a walk over a message found. Ranges in `fixed` are [start, end); `joints` are bits to mask."""

    numbers: dict[str, Numbers] = field(default_factory=dict)
    texts: dict[str, tuple[str, ...]] = field(default_factory=dict)
    fixed: list[tuple[int, int]] = field(default_factory=list)
    flags: list[int] = field(default_factory=list)
    """Bytes of which only the highest bit is fixed: those of a varint."""

    def fix(self, start: int, end: int) -> None:
        """Note that the bytes [start, end) fix the shape."""
        if self.fixed and self.fixed[-1][1] == start:
            self.fixed[-1] = (self.fixed[-1][0], end)
        else:
            self.fixed.append((start, end))
        if len(self.fixed) + len(self.numbers) > MOST_PARTS:
            raise MisfitError(f"a message of more than {MOST_PARTS} parts")

    def find(self, path: str) -> Numbers | None:
        """The number at a path such as ``wrench.torque.z``, ``data[1]`` or ``position[elbow]``, or None.

        A name in brackets stands for its place in a list of strings beside the indexed one.
        """
        place = self._numbered(path)
        if place is None:
            return None
        if place in self.numbers:
            found = self.numbers[place]
            return found if found.count == 1 else None
        array = re.fullmatch(r"(.*)\[(\d+)\]", place)
        if array is None or array[1] not in self.numbers:
            return None
        found, index = self.numbers[array[1]], int(array[2])
        if index >= found.count or found.kind[0] not in "<>|":
            return None
        width = int(found.kind[-1])
        return Numbers(found.offset + index * width, found.kind, 1, found.width, found.zigzag)

    def _numbered(self, path: str) -> str | None:
        done = ""
        for part in re.split(r"(\[[^\]]*\])", path):
            if not part.startswith("["):
                done += part
                continue
            index = self._index(done, part[1:-1])  # a name first: joints may be called "1" and "2"
            if index is None and not part[1:-1].isdigit():
                return None
            done += part if index is None else f"[{index}]"
        return done

    def _index(self, array: str, name: str) -> int | None:
        parent = array.rpartition(".")[0]
        for path, texts in self.texts.items():
            if path.rpartition(".")[0] == parent and name in texts:
                return texts.index(name)
        return None
