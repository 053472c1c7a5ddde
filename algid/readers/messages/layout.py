"""Columns out of messages: one scalar parse for each layout, NumPy for every message that has it.

A layout has the places of a message's numbers, the bytes that fix them, and its strings. Messages
of one size whose fixing bytes are equal have the same layout: what was found in one message holds
for all of them.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from algid.base.blocks import concatenated, rows_of
from algid.base.limits import LIMITS
from algid.base.words import counted
from algid.log import IntArray
from algid.readers.messages.message_file import Messages, gather


class MisfitError(Exception):
    """A message that is not what its schema says."""


@dataclass(frozen=True)
class Numbers:
    """`count` numbers side by side at byte `offset`: a NumPy type, or a varint in `width` bytes.

    That is "varint" in two's complement, "unsigned", or "zigzag" with the sign in its lowest bit.
    """

    offset: int
    kind: str
    count: int = 1
    width: int = 0


@dataclass
class MessageLayout:
    """What a parse of one message found. Ranges in `fixed` are [start, end)."""

    numbers: dict[str, Numbers] = field(default_factory=dict)
    texts: dict[str, tuple[str, ...]] = field(default_factory=dict)
    fixed: list[tuple[int, int]] = field(default_factory=list)
    labels: dict[str, str] = field(default_factory=dict)
    """Single texts: all of a JSON message, elsewhere those that name an arm or a recording."""
    flags: list[int] = field(default_factory=list)
    """Bytes of which only the highest bit is fixed: those of a varint."""
    absent: Callable[[str], bool] = lambda _: False
    """True for the path of a number which the message leaves out because it is zero."""

    def pin(self, start: int, end: int) -> None:
        """Note that the bytes [start, end) fix the layout."""
        if self.fixed and self.fixed[-1][1] == start:
            self.fixed[-1] = (self.fixed[-1][0], end)
        else:
            self.fixed.append((start, end))

    def find(self, path: str) -> Numbers | None:
        """The number at a path (``wrench.torque.z``, ``data[1]``, ``position[elbow]``), or None.

        A name in brackets stands for its place in a list of strings beside the indexed one.
        """
        place = ""
        for part in re.split(r"(\[[^\]]*\])", path):
            name, parent = part[1:-1], place.rpartition(".")[0]
            if not part.startswith("["):
                place += part
                continue
            names = self._list_with(name, parent)  # a name first: joints may be called "1" and "2"
            if names.count(name) > 1:
                return None
            if not (names or name.isdigit()):
                return self.numbers.get(path)  # of JSON, ``q1 [deg]``
            place += f"[{names.index(name)}]" if names else part
        if place in self.numbers:
            numbers = self.numbers[place]
            return numbers if numbers.count == 1 else None
        array = re.fullmatch(r"(.*)\[(\d{1,9})\]", place)
        if array is None or array[1] not in self.numbers:
            return Numbers(0, "zero") if self.absent(place) else None
        numbers, index = self.numbers[array[1]], int(array[2])
        if index >= numbers.count or numbers.kind[0] not in "<>|":
            return None
        return Numbers(numbers.offset + index * int(numbers.kind[-1]), numbers.kind)

    def _list_with(self, name: str, parent: str) -> Sequence[str]:
        """The first list of strings within `parent` that holds a name; empty where none does."""
        for path, texts in self.texts.items():
            if path.rpartition(".")[0] == parent and name in texts:
                return texts
        return ()

    def missing(self, wanted: Mapping[str, str]) -> tuple[str, ...]:
        """Names of the `wanted` numbers that the message lacks; none where it is of other joints.

        It is if it names joints, and none of those of the paths such as ``effort[elbow]``, or if it
        is empty.
        """
        joints, lists = set(), set()
        for path in wanted.values():
            place, bracket, rest = path.partition("[")
            if bracket:
                lists.add(place)
            if bracket and not rest.partition("]")[0].isdigit():
                joints.add(rest.partition("]")[0])
        named = set().union(*self.texts.values())
        held = (path.partition("[")[0] for path, one in self.numbers.items() if one.count)
        if joints and joints.isdisjoint(named) and (named or lists.isdisjoint(held)):
            return ()
        return tuple(name for name, path in wanted.items() if self.find(path) is None)


Parser = Callable[[bytes], MessageLayout]
"""Gives the layout of one payload, or raises `MisfitError`."""
Columns = dict[str, NDArray[np.generic]]


@dataclass(frozen=True, eq=False)
class _Pattern:
    """Which words fix a layout, their values there, and where each wanted number stands.

    Messages are rows of whole words (8 bytes): see `_words`. `places` is None where a message lacks
    one of the wanted numbers, `lacks` names those.
    """

    words: NDArray[np.intp]
    masks: NDArray[np.uint64]
    values: NDArray[np.uint64]
    places: Mapping[str, Numbers] | None
    lacks: tuple[str, ...] = ()

    def matches(self, table: NDArray[np.uint64], rows: NDArray[np.intp]) -> NDArray[np.bool_]:
        """True for those of the rows (R,) of messages (N, words) that have this layout."""
        fits = np.ones(rows.size, np.bool_)
        whole = rows.size == table.shape[0]
        for word, mask, value in zip(self.words, self.masks, self.values, strict=True):
            fits &= ((table[:, word] if whole else table[rows, word]) & mask) == value
            if not fits.any():
                break
        return fits

    def read(self, table: NDArray[np.uint64], lead: int) -> Columns:
        """The wanted numbers of messages (N, words), each (N,), behind `lead` bytes."""
        octets, columns = table.view(np.uint8), Columns()
        for name, at in (self.places or {}).items():
            start, rows = lead + at.offset, octets.shape[0]
            if at.kind in ("varint", "unsigned", "zigzag"):
                # in base 128, the lowest seven bits first
                digits = (octets[:, start : start + at.width] & 0x7F).astype(np.uint64)
                total = np.bitwise_or.reduce(
                    digits << (7 * np.arange(at.width, dtype=np.uint64)), axis=1
                )
                if at.kind == "zigzag":
                    total = (total >> np.uint64(1)) ^ (np.uint64(0) - (total & np.uint64(1)))
                columns[name] = total if at.kind == "unsigned" else total.view(np.int64)
            elif at.kind == "zero":
                columns[name] = np.zeros(rows)
            else:
                # a copy: the messages are not kept for the sake of some numbers of theirs
                columns[name] = np.ndarray(
                    rows, np.dtype(at.kind), octets.data, start, (octets.strides[0],)
                ).copy()
        return columns


@dataclass
class Decoder(ABC):
    """Reads the wanted numbers out of batches of messages.

    Parameters
    ----------
    wanted : mapping
        By name the path of a number; a message without one of them is left out.

    Attributes
    ----------
    skipped, lacking, misfits : int
        Messages left out so far: those of other joints, those that lack a number wanted, and those
        that do not fit their schema.
    lacks : tuple of str
        Names of the numbers that one of those messages lacks.
    misfit : str
        Why the first of the last does not; empty where all fit.
    labels : mapping
        By path what a text names that says whose a message is.
    """

    wanted: Mapping[str, str]
    skipped: int = 0
    lacking: int = 0
    lacks: tuple[str, ...] = ()
    misfits: int = 0
    misfit: str = ""
    labels: dict[str, set[str]] = field(default_factory=dict)

    @abstractmethod
    def columns(self, messages: Messages) -> tuple[NDArray[np.bool_], Columns]:
        """True for the messages (N,) that hold what is wanted; their numbers in file order."""

    def label(self, path: str, text: str) -> None:
        """Note whose a message is; of very many names a few are enough."""
        known = self.labels.setdefault(path, set())
        if len(known) < LIMITS.joints:
            known.add(text)

    def misfitting(self, why: str, messages: int = 1) -> None:
        """Count messages that do not fit their schema."""
        self.misfits += messages
        self.misfit = self.misfit or why

    def without(self, lacks: tuple[str, ...], messages: int = 1) -> None:
        """Count messages that lack numbers, by name; none named where they are of other joints."""
        if lacks:
            self.lacking += messages
            self.lacks = self.lacks or lacks
        else:
            self.skipped += messages


@dataclass
class ColumnDecoder(Decoder):
    """The decoder of encodings in which a number's place is known by its message's layout.

    Remembers the layouts it met by their messages' size.
    """

    parse: Parser = field(kw_only=True)
    _known: dict[int, list[_Pattern]] = field(default_factory=dict)

    def columns(self, messages: Messages) -> tuple[NDArray[np.bool_], Columns]:
        """True for the messages (N,) that hold what is wanted; their numbers in file order."""
        held = np.zeros(len(messages), np.bool_)
        chosen: list[NDArray[np.intp]] = []
        parts: list[Columns] = []
        for rows in _by_size(messages.sizes):
            size = int(messages.sizes[rows[0]])
            if size > LIMITS.message_bytes:
                self.misfitting(f"messages of {counted(size, 'byte')}", rows.size)
                continue
            for own, columns in self._of_one_size(messages, size, rows):
                held[own] = True
                chosen.append(own)
                parts.append(columns)
        if not parts:
            return held, dict.fromkeys(self.wanted, np.empty(0))
        if len(parts) == 1:
            return held, parts[0]
        return held, rows_of(concatenated(parts), np.argsort(np.concatenate(chosen)))

    def _of_one_size(
        self, messages: Messages, size: int, rows: NDArray[np.intp]
    ) -> Iterator[tuple[NDArray[np.intp], Columns]]:
        """Numbers of messages of one size by layout, each with the messages that have it."""
        table = _words(messages.content, messages.starts[rows], size)
        known = self._known.setdefault(size, [])
        left, tried = np.arange(rows.size), 0
        while left.size:
            if tried == len(known):
                start = int(messages.starts[rows[left[0]]])
                pattern = self._new(messages.content[start : start + size].tobytes())
                if pattern is None:
                    left = left[1:]
                    continue
                if tried == LIMITS.layouts:  # what is remembered must not grow with the file
                    known.clear()
                    tried = 0
                known.append(pattern)
            pattern = known[tried]
            fits = pattern.matches(table, left)
            tried += 1
            if pattern.places is None:
                self.without(pattern.lacks, int(np.count_nonzero(fits)))
            elif fits.all() and left.size == rows.size:
                yield rows, pattern.read(table, _padding(size))
            elif fits.any():
                yield rows[left[fits]], pattern.read(table[left[fits]], _padding(size))
            left = left[~fits]

    def _new(self, payload: bytes) -> _Pattern | None:
        """The pattern of a message's layout, None where it does not fit its schema."""
        try:
            layout = self.parse(payload)
        except MisfitError as error:
            self.misfitting(str(error))
            return None
        for path, text in layout.labels.items():
            self.label(path, text)
        lead = _padding(len(payload))
        mask = np.zeros(lead + len(payload), np.uint8)
        for start, end in layout.fixed:
            mask[lead + start : lead + end] = 0xFF
        mask[lead + np.array(layout.flags, np.intp)] |= 0x80
        masks = mask.view(np.uint64)
        words = np.flatnonzero(masks)
        masks = masks[words]
        values = np.frombuffer(bytes(lead) + payload, np.uint64)[words] & masks
        places = {}
        for name, path in self.wanted.items():
            at = layout.find(path)
            if at is None:
                return _Pattern(words, masks, values, None, layout.missing(self.wanted))
            places[name] = at
        return _Pattern(words, masks, values, places)


def _by_size(sizes: IntArray) -> Iterator[NDArray[np.intp]]:
    """The places of the messages of each size, in file order."""
    if sizes.size and not np.any(sizes != sizes[0]):
        yield np.arange(sizes.size)
        return
    order = np.argsort(sizes, kind="stable")
    yield from filter(len, np.split(order, np.flatnonzero(np.diff(sizes[order])) + 1))


def _padding(size: int) -> int:
    """Bytes to take before a payload of `size` bytes: whole words (8 bytes), one at least."""
    return -size % 8 if size else 8


def _words(octets: NDArray[np.uint8], starts: IntArray, size: int) -> NDArray[np.uint64]:
    """Messages of one size as rows (N, words): whole words (8 bytes), the first ones padded."""
    lead = _padding(size)  # it lies within the records, behind a head
    rows = gather(octets, starts - lead, f"V{lead + size}")
    return rows.view(np.uint64).reshape(starts.size, -1)


def has(layout: MessageLayout, paths: Iterable[str]) -> bool:
    """True if the message has the numbers at all of the paths."""
    return all(layout.find(path) is not None for path in paths)
