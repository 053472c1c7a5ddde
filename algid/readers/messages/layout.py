"""Columns out of messages: one scalar parse for each layout, NumPy for every message that has it.

A layout has the places of a message's numbers, the bytes that fix them, and its strings. Messages
of one size whose fixing bytes are equal have the same layout: what was found in one message holds
for all of them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from algid.base.limits import LIMITS
from algid.base.names import concatenated, rows_of
from algid.base.text import counted
from algid.readers.annotations import BAD, GOOD, GROUPS
from algid.readers.messages.message_file import Messages, gather
from algid.readers.table_cells import LABELS

NAMES = (*LABELS, "key")
"""What a list of the joints' names is called, and a structure's or a map's entry's own name."""
_NAMED = re.compile(rf"(.*)\[(\d{{1,9}})\]\.({'|'.join(NAMES)})")
_PLACE = r"\[(\d{1,9})\](.*)"
"""The place of one of a list's numbers, and where that number lies there."""


class MisfitError(Exception):
    """A message that is not what its schema says, or a schema that cannot be read."""


@dataclass(frozen=True)
class Number:
    """A number at byte `offset`: a NumPy type, or a varint in `width` bytes.

    That is "varint" in two's complement, "unsigned", or "zigzag" with the sign in its lowest bit.
    "zero" stands nowhere.
    """

    offset: int
    kind: str
    width: int


class Named(NamedTuple):
    """A number by a name: its place, what the names and the list are called, what is behind it."""

    place: str
    label: str
    list: str
    name: str
    behind: str


@dataclass
class MessageLayout:
    """What a parse of one message found. Ranges in `fixed` are [start, end)."""

    numbers: dict[str, Number] = field(default_factory=dict)
    """By path: ``wrench.torque.z``, ``data[1]``."""
    texts: dict[str, tuple[str, ...]] = field(default_factory=dict)
    fixed: list[tuple[int, int]] = field(default_factory=list)
    labels: dict[str, str] = field(default_factory=dict)
    """Single texts of which `tells` is true, of a JSON message all, and its nulls in lists."""
    empty: list[str] = field(default_factory=list)
    """Lists of no numbers."""
    flags: list[int] = field(default_factory=list)
    """Bytes of which only the highest bit is fixed: those of a varint."""

    def pin(self, start: int, end: int) -> None:
        """Note that the bytes [start, end) fix the layout."""
        if self.fixed and self.fixed[-1][1] == start:
            start = self.fixed.pop()[0]
        self.fixed.append((start, end))

    def add(self, path: str, offset: int, kind: str, count: int | None = None) -> None:
        """Note a number at byte `offset`, or `count` side by side."""
        width = int(kind[-1])
        if count is None:
            self.numbers[path] = Number(offset, kind, width)
            return
        self.empty += [] if count else [path]
        for place in range(min(count, LIMITS.columns)):
            self.numbers[f"{path}[{place}]"] = Number(offset + place * width, kind, width)

    def label(self, path: str, text: str) -> None:
        """Note a single text; what the structures of a list are called is a list of names, too."""
        self.labels[path] = text
        if text and (own := _NAMED.fullmatch(path)):
            names = self.texts.get(at := f"{own[1]}[].{own[3]}", ())
            if len(names) == int(own[2]) < LIMITS.joints:
                self.texts[at] = (*names, text)

    @cached_property
    def named(self) -> dict[str, Named]:
        """By path in which names stand for places (``position[elbow]``) the number's own.

        The names are those of a list of texts beside the list and as long as that, or of the
        list's structures (``joints[elbow].position``).
        """
        named = dict[str, Named]()
        # what lies within a list has names of its own first: interface_values[elbow].values[effort]
        for at, texts in sorted(self.texts.items(), key=lambda one: -one[0].count(".")):
            own, sizes = re.escape(at[: at.rfind(".") + 1]) + r"[^.\[\]]+", dict[str, int]()
            if at.rpartition(".")[0].endswith("[]"):
                own = re.escape(at.rpartition("[].")[0])
            beside = re.compile(f"({own}){_PLACE}")
            for one in filter(None, map(beside.fullmatch, [*self.numbers, *self.labels])):
                if not one[3]:
                    sizes[one[1]] = max(sizes.get(one[1], 0), int(one[2]) + 1)
            places = dict(zip(self.numbers, self.numbers, strict=True))
            for path, place in (places | {path: one.place for path, one in named.items()}).items():
                match = beside.fullmatch(path)
                name = texts[int(match[2])] if match and int(match[2]) < len(texts) else ""
                if match and texts.count(name) == 1 and sizes.get(match[1]) in (None, len(texts)):
                    full = f"{path[: match.start(2)]}{name}{path[match.end(2) :]}"
                    parts = (at.rpartition(".")[2], match[1].rpartition(".")[2], name, match[3])
                    named[full] = Named(place, *parts)
        return named

    @property
    def paths(self) -> list[str]:
        """The paths of its numbers as a profile writes them, and its empty lists."""
        called = {one.place: path for path, one in self.named.items()}
        numbers = [called.get(place, place) for place in self.numbers]
        return [*numbers, *(f"{path} (empty)" for path in self.empty)]

    def find(self, path: str) -> Number | None:
        """The number at a path, or None; a joint may be called "1", and is meant then."""
        return self.numbers.get(self.named[path].place if path in self.named else path)

    def missing(self, wanted: Iterable[str]) -> list[str]:
        """Those of the `wanted` paths that the message lacks; none where it is of other joints.

        It is if it names joints, and none of those of the paths such as ``effort[elbow]``, or if it
        is empty.
        """
        indexed = [path.partition("]")[0].partition("[") for path in wanted]
        joints = {name for _, _, name in indexed if name and not name.isdigit()}
        lists = {place for place, bracket, _ in indexed if bracket}
        named = set().union(*self.texts.values())
        held = (path.partition("[")[0] for path in self.numbers)
        if joints and joints.isdisjoint(named) and (named or lists.isdisjoint(held)):
            return []
        return [path for path in wanted if self.find(path) is None]


@lru_cache(maxsize=1 << 12)
def tells(path: str) -> bool:
    """True for the place of a text that names an arm, a recording, or a structure of a list."""
    return path.rpartition(".")[2] in GROUPS or bool(_NAMED.fullmatch(path))


@dataclass(frozen=True)
class Codec:
    """How a channel's messages are read: as what `records`, of which `parse` gives the layout.

    That raises `MisfitError`.
    """

    parse: Callable[[bytes], MessageLayout]
    records: Callable[[Messages], Messages] = lambda messages: messages


Columns = dict[str, NDArray[np.generic]]


@dataclass(frozen=True, eq=False)
class _Pattern:
    """Which words fix a layout, their values there, and where each wanted number stands.

    Messages are rows of whole words (8 bytes), the first ones padded. `places` is None where a
    message lacks one of the wanted numbers; `left_out` says why.
    """

    words: NDArray[np.intp]
    masks: NDArray[np.uint64]
    values: NDArray[np.uint64]
    places: Mapping[str, Number] | None
    left_out: Mapping[str, str]

    def matches(self, table: NDArray[np.uint64], rows: NDArray[np.intp]) -> NDArray[np.bool_]:
        """True for those of the rows (R,) of messages (N, words) that have this layout."""
        fits = np.ones(rows.size, np.bool_)
        whole = rows.size == len(table)
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
class Decoder:
    """Reads the wanted numbers out of batches of messages.

    Parameters
    ----------
    wanted : mapping
        By name the path of a number; a message without one of them is left out.
    codec : Codec

    Attributes
    ----------
    left_out : mapping
        Messages left out so far, as their notice tells: by case ("fields" that they lack, of other
        "joints", not of their "schema") their count, and what the first one lacks.
    layouts : list of MessageLayout
        The first ones found, each unlike those before of its size.
    labels : mapping
        By path what a text names that says whose a message is.
    """

    wanted: Mapping[str, str]
    codec: Codec
    left_out: dict[str, dict[str, Any]] = field(default_factory=dict)
    layouts: list[MessageLayout] = field(default_factory=list)
    labels: dict[str, set[str]] = field(default_factory=dict)
    _known: dict[int, list[_Pattern]] = field(default_factory=dict)

    def columns(self, messages: Messages) -> tuple[NDArray[np.bool_], Columns]:
        """True for the messages (N,) that hold what is wanted; their numbers in file order."""
        held = np.zeros(len(messages), np.bool_)
        chosen: list[NDArray[np.intp]] = []
        parts: list[Columns] = []
        records = self.codec.records(messages)
        order = np.argsort(records.sizes, kind="stable")
        for rows in np.split(order, np.flatnonzero(np.diff(records.sizes[order])) + 1):
            for own, columns in self._of_one_size(records.take(rows)) if rows.size else ():
                held[rows[own]] = True
                chosen.append(rows[own])
                parts.append(columns)
        if not parts:
            return held, dict.fromkeys(self.wanted, np.empty(0))
        if len(parts) == 1:
            return held, parts[0]
        return held, rows_of(concatenated(parts), np.argsort(np.concatenate(chosen)))

    def leave(self, case: str, count: int, **why: str) -> None:
        """Count messages that are left out; of the first ones it is told why."""
        known = self.left_out.setdefault(case, {"count": 0, **why})
        known["count"] += count

    def _of_one_size(self, messages: Messages) -> Iterator[tuple[NDArray[np.intp], Columns]]:
        """Numbers of messages of one size by layout, each with the places of the messages."""
        size = int(messages.sizes[0])
        if size > LIMITS.message_bytes:
            self.leave("schema", len(messages), first=f"messages of {counted(size, 'byte')}")
            return
        lead = -size % 8 if size else 8  # it lies within the records, behind a head
        table = gather(messages.content, messages.starts - lead, f"V{lead + size}").view(np.uint64)
        table = table.reshape(len(messages), -1)
        known = self._known.setdefault(size, [])
        left, tried = np.arange(len(messages)), 0
        while left.size:
            if tried == len(known):
                pattern = self._new(table[left[0]].tobytes(), lead)
                if pattern is None:
                    left = left[1:]
                    continue
                if tried == LIMITS.layouts:  # what is remembered must not grow with the file
                    known.clear()
                    tried = 0
                known.append(pattern)
            pattern = known[tried]
            tried += 1
            fits = pattern.matches(table, left)
            if not fits.any():
                continue
            if pattern.places is None:
                self.leave(count=int(np.count_nonzero(fits)), **pattern.left_out)
            else:
                own = left[fits]
                yield own, pattern.read(table if own.size == len(table) else table[own], lead)
            left = left[~fits]

    def _new(self, row: bytes, lead: int) -> _Pattern | None:
        """The pattern of a message's layout, None where it does not fit its schema."""
        try:
            layout = self.codec.parse(row[lead:])
        except MisfitError as error:
            self.leave("schema", 1, first=str(error))
            return None
        self.layouts += [layout] if len(self.layouts) < LIMITS.layouts else []
        for path, text in layout.labels.items():
            known = self.labels.setdefault(path, set())
            if path.rpartition(".")[2] in GROUPS and len(known) < LIMITS.joints:
                known.add(text)
        mask = np.zeros(len(row), np.uint8)
        for start, end in layout.fixed:
            mask[lead + start : lead + end] = 0xFF
        mask[lead + np.array(layout.flags, np.intp)] |= 0x80
        lacks = list[str]()  # by what a message says itself that it is no measurement
        for name in sorted(GOOD | BAD):  # another value of a flag is another pattern
            if (flag := layout.find(name)) is not None:
                own = slice(lead + flag.offset, lead + flag.offset + flag.width)
                mask[own] = 0xFF
                lacks += [name] * ((name in GOOD) != any(row[own]))
        masks = mask.view(np.uint64)
        words = np.flatnonzero(masks)
        values = np.frombuffer(row, np.uint64)[words] & masks[words]
        places = {name: layout.find(path) for name, path in self.wanted.items()}
        why = {"case": "joints"}
        found = {name: at for name, at in places.items() if at is not None}
        whole = len(found) == len(places) and not lacks
        if lacks := lacks or layout.missing(self.wanted.values()):
            why = {"case": "fields", "fields": ", ".join(lacks)}
        return _Pattern(words, masks[words], values, found if whole else None, why)
