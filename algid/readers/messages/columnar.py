"""The shape of a message: the places of its numbers, the bytes that fix them, its strings.

Messages of one size whose fixing bytes are equal have the same shape, so what one walk over one
message found holds for all of them: that is what makes reading by columns possible.

Columns out of messages: one scalar walk for each layout, NumPy for every message that has it.
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
from algid.readers.messages.batch import Messages, gather, padding

_NAMED = re.compile(r"[^\[\]]*\[([^\]]*)\]")


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
class Shape:
    """What a walk over a message found. Ranges in `fixed` are [start, end)."""

    numbers: dict[str, Numbers] = field(default_factory=dict)
    texts: dict[str, tuple[str, ...]] = field(default_factory=dict)
    fixed: list[tuple[int, int]] = field(default_factory=list)
    labels: dict[str, str] = field(default_factory=dict)
    """Single texts: all of a JSON message, elsewhere those that name an arm or a recording."""
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
            If they are more than `FileLimits.message_parts`.
        """
        self.parts += parts
        if self.parts > LIMITS.message_parts:
            raise MisfitError(f"a message of more than {LIMITS.message_parts} parts")

    def fix(self, start: int, end: int) -> None:
        """Note that the bytes [start, end) fix the shape."""
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

    def has(self, paths: Iterable[str]) -> bool:
        """Whether the message has the numbers at all of the paths."""
        return all(self.find(path) is not None for path in paths)

    def _list_with(self, name: str, parent: str) -> Sequence[str]:
        """The first list of strings within `parent` that holds a name; empty where none does."""
        for path, texts in self.texts.items():
            if path.rpartition(".")[0] == parent and name in texts:
                return texts
        return ()

    def of_others(self, paths: Iterable[str]) -> bool:
        """Whether the message is of other joints than those of `paths` such as ``effort[elbow]``.

        A message that names one of them, or numbers without any name, is no other publisher's: it
        lacks something.
        """
        joints, listed = set(), set()
        for path in paths:
            place, bracket, _ = path.partition("[")
            if bracket:
                listed.add(place)
            named = _NAMED.match(path)
            if named and not named[1].isdigit():
                joints.add(named[1])
        lists = list(filter(None, self.texts.values()))
        if not joints or any(map(joints.intersection, lists)):
            return False
        return bool(lists) or not any(
            one.count and path.partition("[")[0] in listed for path, one in self.numbers.items()
        )


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
    lacks: tuple[str, ...] = ()
    """Without fields: the missing ones; empty if the message is of other joints."""

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
        octets, columns = table.view(np.uint8), Fields()
        for name, at in (self.fields or {}).items():
            start, rows = self.lead + at.offset, octets.shape[0]
            # in base 128, the lowest seven bits first
            if at.kind in (
                "varint",
                "unsigned",
                "zigzag",
            ):
                digits = (octets[:, start : start + at.width] & 0x7F).astype(np.uint64)
                total = np.bitwise_or.reduce(
                    digits << (7 * np.arange(at.width, dtype=np.uint64)), axis=1
                )
                if at.kind == "zigzag":
                    total = (total >> np.uint64(1)) ^ (np.uint64(0) - (total & np.uint64(1)))
                columns[name] = total if at.kind == "unsigned" else total.view(np.int64)
            elif at.kind == "zero":  # a number that protobuf leaves out because it is zero
                columns[name] = np.zeros(rows)
            else:
                # a copy: the messages are not kept for the sake of some numbers of theirs
                columns[name] = np.ndarray(
                    rows, np.dtype(at.kind), octets.data, start, (octets.strides[0],)
                ).copy()
        return columns


def layout(payload: bytes, shape: Shape, wanted: Mapping[str, str]) -> Layout:
    """The layout of a message; its fields are None where it lacks one of those `wanted`."""
    lead = padding(len(payload))
    mask = np.zeros(lead + len(payload), np.uint8)
    for start, end in shape.fixed:
        mask[lead + start : lead + end] = 0xFF
    mask[lead + np.array(shape.flags, np.intp)] |= 0x80
    masks = mask.view(np.uint64)
    words = np.flatnonzero(masks)
    whole = np.frombuffer(bytes(lead) + payload, np.uint64)
    places = {}
    for name, path in wanted.items():
        at = shape.find(path)
        if at is not None:
            places[name] = at
    if len(places) == len(wanted):
        return Layout(lead, words, masks[words], whole[words] & masks[words], places)
    return Layout(
        lead, words, masks[words], whole[words] & masks[words], None, missing(shape, wanted)
    )


def missing(shape: Shape, wanted: Mapping[str, str]) -> tuple[str, ...]:
    """Names of the `wanted` numbers that a message lacks; none where it is of other joints."""
    if shape.of_others(wanted.values()):
        return ()
    return tuple(name for name, path in wanted.items() if shape.find(path) is None)


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

    def label(self, path: str, text: str) -> None:
        """Note whose a message is; of very many names a few are enough."""
        known = self.labels.setdefault(path, set())
        if len(known) < LIMITS.joints:
            known.add(text)

    def columns(self, messages: Messages) -> tuple[NDArray[np.bool_], Fields]:
        """Which messages (N,) hold the wanted fields, and their numbers by name, in file order."""
        before = self.misfits + self.lacking
        held = np.zeros(len(messages), np.bool_)
        fields = self.read(messages, held)
        self.skipped += int(held.size - np.count_nonzero(held)) - (
            self.misfits + self.lacking - before
        )
        return held, fields

    @abstractmethod
    def read(self, messages: Messages, held: NDArray[np.bool_]) -> Fields:
        """The numbers of the messages that hold what is wanted, by name.

        Notes in `held` (N,) which do.
        """

    def misfitting(self, why: str, messages: int = 1) -> None:
        """Count messages that do not fit their schema."""
        self.misfits += messages
        self.misfit = self.misfit or why

    def without(self, lacks: tuple[str, ...], messages: int = 1) -> None:
        """Count messages that lack numbers, by name; none named where they are of other joints."""
        if lacks:
            self.lacking += messages
            self.lacks = self.lacks or lacks


@dataclass
class ColumnDecoder(Decoder):
    """The decoder of encodings in which a number's place is known by its message's layout.

    Remembers those it met.

    `walk` gives the shape of one payload, or raises `MisfitError`.
    """

    walk: Walk = field(kw_only=True)
    _known: dict[int, list[Layout]] = field(default_factory=dict)
    _words: int = 0

    def read(self, messages: Messages, held: NDArray[np.bool_]) -> Fields:
        """The numbers of the messages that hold what is wanted, by name.

        Notes in `held` (N,) which do.
        """
        parts: list[tuple[NDArray[np.intp], Fields]] = []
        for rows in _by_size(messages.sizes):
            size = int(messages.sizes[rows[0]])
            if size > LIMITS.message_bytes:
                self.misfitting(f"messages of {counted(size, 'byte')}", rows.size)
                continue
            for chosen, fields in self._of_one_size(messages, size, rows):
                held[chosen] = True
                parts.append((chosen, fields))
        if not parts:
            return dict.fromkeys(self.wanted, np.empty(0))
        if len(parts) == 1:
            return parts[0][1]
        chosen_rows, several = zip(*parts, strict=True)
        return rows_of(concatenated(several), np.argsort(np.concatenate(chosen_rows)))

    def _of_one_size(
        self, messages: Messages, size: int, rows: NDArray[np.intp]
    ) -> Iterator[tuple[NDArray[np.intp], Fields]]:
        """Numbers of messages of one size by layout, each with the messages that have it."""
        table = _words(messages.content, messages.starts[rows], size)
        known = self._known.setdefault(size, [])
        left, tried = np.arange(rows.size), 0
        while left.size:
            one = known[tried] if tried < len(known) else self._new(messages, int(rows[left[0]]))
            if one is None:
                left = left[1:]
                continue
            if tried == len(known):
                if len(known) == LIMITS.layouts or self._words > LIMITS.layout_words:
                    if one.fields is None:
                        self.without(one.lacks)
                    else:
                        yield rows[left[:1]], one.read(table[left[:1]])
                    # one by one from here: what is remembered must not grow with the file
                    left = left[1:]
                    continue
                known.append(one)
                self._words += one.words.size
            fits = one.matches(table, left)
            tried += 1
            if one.fields is None:
                self.without(one.lacks, int(np.count_nonzero(fits)))
            elif fits.any():
                whole = fits.all() and left.size == rows.size
                yield (
                    (rows, one.read(table))
                    if whole
                    else (rows[left[fits]], one.read(table[left[fits]]))
                )
            left = left[~fits]

    def _new(self, messages: Messages, row: int) -> Layout | None:
        """The layout of a message, None where it does not fit its schema."""
        start = int(messages.starts[row])
        payload = messages.content[start : start + int(messages.sizes[row])].tobytes()
        try:
            shape = self.walk(payload)
        except MisfitError as error:
            self.misfitting(str(error))
            return None
        for path, text in shape.labels.items():
            self.label(path, text)
        return layout(payload, shape, self.wanted)


def _by_size(sizes: IntArray) -> Iterator[NDArray[np.intp]]:
    """The places of the messages of each size, in file order."""
    if sizes.size and not np.any(sizes != sizes[0]):
        yield np.arange(sizes.size)
        return
    order = np.argsort(sizes, kind="stable")
    yield from filter(len, np.split(order, np.flatnonzero(np.diff(sizes[order])) + 1))


def _words(octets: NDArray[np.uint8], starts: IntArray, size: int) -> NDArray[np.uint64]:
    """Messages of one size as rows (N, words), each behind its lead: see `Messages.compacted`."""
    firsts = starts - padding(size)  # every row lies within the records, behind a head
    width = size + padding(size)
    if np.any(np.diff(firsts) != width):
        rows = gather(octets, firsts, f"V{width}")
    else:
        rows = octets[firsts[0] : firsts[-1] + width]
    return rows.view(np.uint64).reshape(starts.size, -1)
