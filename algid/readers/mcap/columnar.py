"""The shape of one message: where its numbers stand, which bytes fix that, and what its strings say.

Messages of one size whose fixing bytes are equal have the same shape, so what one walk over one message
found holds for all of them: that is what makes reading by columns possible.

Columns out of messages: one scalar walk for each layout, NumPy for every message that has it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from algid.log import IntArray
from algid.readers.mcap.messages import Messages
from algid.words import counted

MOST_PARTS = 100_000
"""Fields, structures and strings a message may be made of; a list of numbers is one."""
LARGEST_MESSAGE = 1 << 24
"""Bytes; a joint state has some hundred."""
_REPEATED = -1
"""The place of a name that stands in a list twice."""
_WORK_A_WALK, _WORK_A_SIZE = 200, 20
_MOST_WORDS = 1 << 22
"""Words that all remembered layouts may fix together."""


class MisfitError(Exception):
    """A message that is not what its schema says."""


class ExcessError(Exception):
    """Messages that ask for more work than any recorder's."""


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
    """What a walk over a message found. Ranges in `fixed` are [start, end)."""

    numbers: dict[str, Numbers] = field(default_factory=dict)
    texts: dict[str, tuple[str, ...]] = field(default_factory=dict)
    fixed: list[tuple[int, int]] = field(default_factory=list)
    flags: list[int] = field(default_factory=list)
    """Bytes of which only the highest bit is fixed: those of a varint."""
    absent: Callable[[str], bool] = lambda _: False
    """Whether a path is that of a number which the message leaves out because it is zero."""
    parts: int = 0

    def count(self, parts: int = 1) -> None:
        """Note so many parts more: fields, structures, strings.

        Raises
        ------
        MisfitError
            If they are more than `MOST_PARTS`.
        """
        self.parts += parts
        if self.parts > MOST_PARTS:
            raise MisfitError(f"a message of more than {MOST_PARTS} parts")

    def fix(self, start: int, end: int) -> None:
        """Note that the bytes [start, end) fix the shape."""
        if self.fixed and self.fixed[-1][1] == start:
            self.fixed[-1] = (self.fixed[-1][0], end)
        else:
            self.fixed.append((start, end))

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
        array = re.fullmatch(r"(.*)\[(\d{1,9})\]", place)
        if array is None or array[1] not in self.numbers:
            return Numbers(0, "zero") if self.absent(place) else None
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
            if index == _REPEATED or (index is None and not part[1:-1].isdigit()):
                return None
            done += part if index is None else f"[{index}]"
        return done

    def _index(self, array: str, name: str) -> int | None:
        parent = array.rpartition(".")[0]
        for path, texts in self.texts.items():
            if path.rpartition(".")[0] == parent and name in texts:
                return texts.index(name) if texts.count(name) == 1 else _REPEATED
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

    def matches(self, table: NDArray[np.uint64], rows: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Which of the rows (R,) of messages (N, words) have this layout."""
        fits = np.ones(rows.size, np.bool_)
        whole = rows.size == table.shape[0]
        for word, mask, value in zip(self.words, self.masks, self.values, strict=True):
            fits &= ((table[:, word] if whole else table[rows, word]) & mask) == value
            if not fits.any():
                break
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
    works : callable
        Counts steps of some microsecond; False where these are too many.
    """

    walk: Walk
    wanted: Mapping[str, str]
    needed: frozenset[str]
    works: Callable[[int], bool]
    skipped: int = 0
    misfits: int = 0
    misfit: str = ""
    _known: dict[int, list[Layout]] = field(default_factory=dict)
    _words: int = 0

    def columns(self, messages: Messages) -> tuple[NDArray[np.bool_], Fields]:
        """Which messages hold what is needed (N,), and the numbers of those, by name.

        Messages that do not fit their schema are left out and counted.

        Raises
        ------
        ExcessError
            If the messages ask for more work than any honest ones.
        """
        held = np.zeros(len(messages), np.bool_)
        misfits = self.misfits
        parts: list[tuple[NDArray[np.intp], Fields]] = []
        for size, rows in _by_size(messages.sizes):
            self._spend(_WORK_A_SIZE)
            for chosen, fields in self._of_one_size(messages, size, rows):
                held[chosen] = True
                parts.append((chosen, fields))
        self.skipped += int(held.size - np.count_nonzero(held)) - (self.misfits - misfits)
        return held, _in_order(held, parts)

    def _of_one_size(
        self, messages: Messages, size: int, rows: NDArray[np.intp]
    ) -> Iterator[tuple[NDArray[np.intp], Fields]]:
        if size > LARGEST_MESSAGE:
            self.misfits += rows.size
            self.misfit = self.misfit or f"messages of {counted(size, 'byte')}"
            return
        lead = _lead(size)
        table = _gathered(messages, size + lead, messages.starts[rows] - lead)
        known = self._known.setdefault(size, [])
        left, tried = np.arange(rows.size), 0
        while left.size:
            one = known[tried] if tried < len(known) else self._new(messages, int(rows[left[0]]))
            if one is None:
                left = left[1:]
                continue
            if tried == len(known) and not self._remembers(one, known):
                if one.fields is not None:
                    yield rows[left[:1]], one.read(table[left[:1]])
                left = left[1:]  # one by one from here: what is remembered must not grow with the file
                continue
            fits = one.matches(table, left)
            tried += 1
            if one.fields is not None and fits.any():
                whole = fits.all() and left.size == rows.size
                yield (rows, one.read(table)) if whole else (rows[left[fits]], one.read(table[left[fits]]))
            left = left[~fits]

    def _remembers(self, one: Layout, known: list[Layout]) -> bool:
        """Take a layout in among the `known` ones of its size, where there is room."""
        if len(known) == MOST_LAYOUTS or self._words > _MOST_WORDS:
            return False
        known.append(one)
        self._words += one.words.size
        return True

    def _new(self, messages: Messages, row: int) -> Layout | None:
        """The layout of a message, None where it does not fit its schema."""
        start = int(messages.starts[row])
        payload = messages.content[start : start + int(messages.sizes[row])].tobytes()
        try:
            shape = self.walk(payload)
        except MisfitError as error:
            self.misfits += 1
            self.misfit = self.misfit or str(error)
            self._spend(_WORK_A_WALK)
            return None
        self._spend(_WORK_A_WALK + shape.parts)
        return layout(payload, shape, self.wanted, self.needed)

    def _spend(self, steps: int) -> None:
        if not self.works(steps):
            raise ExcessError("messages of so many layouts that no recorder writes them")


def _by_size(sizes: IntArray) -> Iterator[tuple[int, NDArray[np.intp]]]:
    """Each size that there is, mostly one, and the messages that have it."""
    if sizes.size and np.all(sizes == sizes[0]):
        yield int(sizes[0]), np.arange(sizes.size)
        return
    order = np.argsort(sizes, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(sizes[order])) + 1):
        if rows.size:
            yield int(sizes[rows[0]]), rows


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
    if at.kind == "zero":  # a number that protobuf leaves out because it is zero
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
