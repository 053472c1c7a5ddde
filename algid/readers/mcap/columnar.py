"""The shape of one message: where its numbers stand, which bytes fix that, and what its strings say.

Messages of one size whose fixing bytes are equal have the same shape, so what one walk over one message
found holds for all of them: that is what makes reading by columns possible.

Columns out of messages: one scalar walk for each layout, NumPy for every message that has it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from algid.log import IntArray
from algid.readers.mcap.messages import Messages

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


MOST_LAYOUTS = 256
"""Past so many layouts of one size messages are walked one by one."""

Walk = Callable[[bytes], Shape]
Fields = dict[str, NDArray[np.generic]]


@dataclass(frozen=True, eq=False)
class Layout:
    """Which words fix the shape, their values there, and where each wanted number stands.

    Messages are gathered with `lead` bytes before them so that their size is whole words (8 bytes).
    """

    lead: int
    words: NDArray[np.intp]
    masks: NDArray[np.uint64]
    values: NDArray[np.uint64]
    fields: Mapping[str, Numbers] | None

    def matches(self, table: NDArray[np.uint64]) -> NDArray[np.bool_]:
        """Which of the messages (N, words) have this layout."""
        fits = np.ones(table.shape[0], np.bool_)
        for word, mask, value in zip(self.words, self.masks, self.values, strict=True):
            fits &= (table[:, word] & mask) == value
        return fits

    def read(self, table: NDArray[np.uint64]) -> Fields:
        """The wanted numbers of messages (N, words), each (N,)."""
        octets = table.view(np.uint8)
        return {name: _column(octets, self.lead, at) for name, at in (self.fields or {}).items()}


def layout(payload: bytes, shape: Shape, wanted: Mapping[str, str], needed: frozenset[str]) -> Layout:
    """The layout of a message; its fields are None where it lacks one of `needed`."""
    lead = _lead(len(payload))
    mask = np.zeros(lead + len(payload), np.uint8)
    for start, end in shape.fixed:
        mask[lead + start : lead + end] = 0xFF
    mask[[lead + place for place in shape.flags]] |= 0x80
    masks = mask.view(np.uint64)
    words = np.flatnonzero(masks)
    whole = np.frombuffer(bytes(lead) + payload, np.uint64)
    found = {name: at for name, path in wanted.items() if (at := shape.find(path)) is not None}
    complete = needed <= found.keys()
    return Layout(lead, words, masks[words], whole[words] & masks[words], found if complete else None)


@dataclass
class Decoder:
    """Reads the wanted numbers out of batches of messages; remembers the layouts it met.

    Parameters
    ----------
    walk : callable
        The shape of one payload; raises `MisfitError`.
    wanted : mapping
        By name the path of a number.
    needed : frozenset of str
        A message without one of these is skipped and counted.
    """

    walk: Walk
    wanted: Mapping[str, str]
    needed: frozenset[str]
    skipped: int = 0
    _known: dict[int, list[Layout]] = field(default_factory=dict)

    def columns(self, messages: Messages) -> tuple[NDArray[np.bool_], Fields]:
        """Which messages hold what is needed (N,), and the numbers of those, by name.

        Raises
        ------
        MisfitError
            If a message does not fit its schema.
        """
        held = np.zeros(len(messages), np.bool_)
        parts: list[tuple[NDArray[np.intp], Fields]] = []
        sizes = _distinct(messages.sizes)
        for size in sizes:
            rows = np.arange(len(messages)) if len(sizes) == 1 else np.flatnonzero(messages.sizes == size)
            for chosen, fields in self._of_one_size(messages, size, rows):
                held[chosen] = True
                parts.append((chosen, fields))
        self.skipped += int(held.size - np.count_nonzero(held))
        return held, _in_order(held, parts)

    def _of_one_size(
        self, messages: Messages, size: int, rows: NDArray[np.intp]
    ) -> list[tuple[NDArray[np.intp], Fields]]:
        lead = _lead(size)
        table = _gathered(messages, size + lead, messages.starts[rows] - lead)
        known = self._known.setdefault(size, [])
        parts, tried = [], 0
        while rows.size:
            if tried == len(known):
                known.append(self._new(messages, int(rows[0])))
            fits = known[tried].matches(table)
            if fits.any():
                if known[tried].fields is not None:
                    chosen = slice(None) if fits.all() else fits
                    parts.append((rows[chosen], known[tried].read(table[chosen])))
                rows, table = rows[~fits], table[~fits]
            tried += 1
            if tried > MOST_LAYOUTS:
                known.pop()  # one by one from here: the list must not grow with the file
                tried -= 1
        return parts

    def _new(self, messages: Messages, row: int) -> Layout:
        start = int(messages.starts[row])
        payload = messages.content[start : start + int(messages.sizes[row])].tobytes()
        return layout(payload, self.walk(payload), self.wanted, self.needed)


def _distinct(sizes: IntArray) -> list[int]:
    """The sizes that there are; mostly one."""
    if sizes.size and np.all(sizes == sizes[0]):
        return [int(sizes[0])]
    return np.unique(sizes).tolist()


def _lead(size: int) -> int:
    """Bytes to gather before a payload of `size` bytes: whole words, one at least."""
    return -size % 8 if size else 8


def _gathered(messages: Messages, width: int, starts: NDArray[np.int64]) -> NDArray[np.uint64]:
    """Bytes of messages of one size as rows of words; every row lies within the records, behind a head."""
    content = messages.content
    window: NDArray[np.void] = np.ndarray(
        content.size - width + 1, np.dtype((np.void, width)), content.data, strides=(1,)
    )
    return window[starts].view(np.uint64).reshape(starts.size, width // 8)


def _column(octets: NDArray[np.uint8], lead: int, at: Numbers) -> NDArray[np.generic]:
    start = lead + at.offset
    if at.kind == "varint":
        return _varint(octets[:, start : start + at.width], at.zigzag)
    if at.kind == "zero":  # a number that protobuf leaves out because it is nought
        return np.zeros(octets.shape[0])
    return np.ndarray(octets.shape[0], np.dtype(at.kind), octets.data, start, (octets.strides[0],))


def _varint(octets: NDArray[np.uint8], zigzag: bool) -> NDArray[np.generic]:
    total = np.zeros(octets.shape[0], np.uint64)
    for place in range(octets.shape[1]):
        total |= (octets[:, place] & 0x7F).astype(np.uint64) << np.uint64(7 * place)
    if zigzag:
        return (total >> np.uint64(1)).view(np.int64) ^ -(total & np.uint64(1)).view(np.int64)
    return total.view(np.int64)


def _in_order(held: NDArray[np.bool_], parts: list[tuple[NDArray[np.intp], Fields]]) -> Fields:
    """Columns of all held messages in file order; NaN where a message lacks a number that others hold."""
    if not parts:
        return {}
    if len(parts) == 1:
        return parts[0][1]
    names = list(dict.fromkeys(name for _, fields in parts for name in fields))
    place = np.cumsum(held) - 1
    columns: Fields = {}
    for name in names:
        kinds = [fields[name].dtype for _, fields in parts if name in fields]
        full = len(kinds) == len(parts)
        column = np.full(place[-1] + 1, 0 if full else np.nan, np.result_type(*kinds) if full else np.float64)
        for chosen, fields in parts:
            if name in fields:
                column[place[chosen]] = fields[name]
        columns[name] = column
    return columns
