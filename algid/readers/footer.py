"""Parquet structures that no library reads without harm: Thrift's compact protocol, by hand.

Its footer (FileMetaData): whether it names encrypted columns, its row groups and where their pages
lie. And a page's header (PageHeader): its size, and its checksum, which polars does not look at.

By hand: pyarrow ends the process (`std::terminate` in pyarrow 26) when it is asked for a column
that is encrypted, or whose statistics contradict its type, and has no way to ask beforehand. The
footer of a million rows of 7 columns takes a millisecond.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from algid.limits import LIMITS

_STOP, _TRUE, _FALSE, _BYTE, _SHORT, _INT, _LONG, _DOUBLE, _BINARY, _LIST, _SET, _MAP, _STRUCT = (
    range(13)
)
_ENCRYPTION = {(8,), (4, 1, 8), (4, 1, 9)}
"""Fields: encryption of the file, of each row group's columns, and of their metadata."""
_GROUP, _PAGES = (4,), (4, 1, 3)
"""Structures: a row group (RowGroup), and what it says of one of its columns (ColumnMetaData)."""
_ROWS, _GROUP_ROWS, _PATH = (3,), (4, 3), (4, 1, 3, 3)
_VALUES, _SIZE, _DATA, _DICTIONARY = 5, 7, 9, 11
_DICTIONARY_VALUES = (7, 1)
_PAGE_VALUES = ((5, 1), _DICTIONARY_VALUES, (8, 1))
"""Values of a page, in the header of its kind."""


class FooterError(Exception):
    """A footer that is no FileMetaData."""


@dataclass
class Pages:
    """The pages of a column in a row group: its path, values, bytes, and the first page's place."""

    path: list[str] = field(default_factory=list)
    numbers: dict[int, int] = field(default_factory=dict, repr=False)

    @property
    def values(self) -> int:
        """How many values they hold, -1 where that is not stated."""
        return self.numbers.get(_VALUES, -1)

    @property
    def first(self) -> int:
        """Where the first of them stands; 0 where that is not stated."""
        offsets = (self.numbers.get(number, 0) for number in (_DICTIONARY, _DATA))
        return min(filter(None, offsets), default=0)

    @property
    def end(self) -> int:
        """Where the last of them ends."""
        return self.first + self.numbers.get(_SIZE, 0)


@dataclass
class Group:
    """A row group: its rows, -1 where they are not stated, and its columns."""

    rows: int = -1
    columns: list[Pages] = field(default_factory=list)


@dataclass
class Footer:
    """What a footer says: whether anything is encrypted, rows, row groups."""

    encrypted: bool = False
    rows: int = -1
    groups: list[Group] = field(default_factory=list)


def parsed(footer: bytes) -> Footer:
    """A Parquet file's footer.

    Raises
    ------
    FooterError
        If it breaks off, or holds more values than any real one.
    """
    reader = _Reader(footer)
    try:
        reader.struct((), 0)
    except IndexError as error:
        raise FooterError("it breaks off") from error
    return reader.found


@dataclass(frozen=True)
class PageHeader:
    """A page's header: bytes of the header, page size packed and unpacked, values, checksum."""

    length: int
    packed: int
    unpacked: int
    values: int
    dictionary: bool
    crc: int | None


def page_header(head: bytes) -> PageHeader:
    """The header (PageHeader) that `head` begins with.

    A loop of its own: there is a header for every 20,000 values, and a reader as general as the
    footer's takes a third of the time in which polars decodes them.

    Raises
    ------
    FooterError
        If it breaks off, or is none.
    """
    kept: dict[tuple[int, int], int] = {}
    outer: list[tuple[int, int]] = []
    inside = number = place = 0  # `inside` the field of the structure that the place lies in
    try:
        while True:
            byte = head[place]
            place += 1
            if byte == _STOP:
                if not outer:
                    break
                inside, number = outer.pop()
                continue
            kind = byte & 15
            if byte >> 4:
                number += byte >> 4
            else:
                value, place = _varint(head, place)
                number = value >> 1
            if kind in (_SHORT, _INT, _LONG):
                value, place = _varint(head, place)
                kept[inside, number] = value >> 1 ^ -(value & 1)
            elif kind == _STRUCT and len(outer) < LIMITS.parquet_footer_depth:
                outer.append((inside, number))
                inside, number = number if len(outer) == 1 else -1, 0
            elif kind == _BINARY:
                size, place = _varint(head, place)
                place += size
            elif kind == _BYTE:
                place += 1
            elif kind not in (_TRUE, _FALSE):
                raise FooterError("what should be a page's header is none")
    except IndexError as error:
        raise FooterError("a page's header breaks off") from error
    values = next((kept[name] for name in _PAGE_VALUES if name in kept), 0)
    crc = kept.get((0, 4))
    return PageHeader(
        length=place,
        packed=kept.get((0, 3), -1),
        unpacked=kept.get((0, 2), -1),
        values=values,
        dictionary=_DICTIONARY_VALUES in kept,
        crc=None if crc is None else crc & 0xFFFFFFFF,
    )


def _varint(data: bytes, place: int) -> tuple[int, int]:
    """The number that stands at a place, and the place behind it."""
    value = shift = 0
    while (byte := data[place]) & 0x80:
        value |= (byte & 0x7F) << shift
        shift += 7
        place += 1
        if shift > 63:
            raise FooterError("it holds a number without an end")
    return value | byte << shift, place + 1


@dataclass
class _Reader:
    data: bytes
    place: int = 0
    values: int = 0
    found: Footer = field(default_factory=Footer)

    def struct(self, path: tuple[int, ...], depth: int) -> None:
        """Pass over a structure that stands in the field `path`."""
        number = 0
        if path == _GROUP:
            self.found.groups.append(Group())
        elif path == _PAGES and self.found.groups:
            self.found.groups[-1].columns.append(Pages())
        while kind := self.byte():
            number = number + (kind >> 4) if kind >> 4 else self.varint() >> 1
            self.found.encrypted |= (*path, number) in _ENCRYPTION
            if kind & 15 not in (_TRUE, _FALSE):
                self.value(kind & 15, (*path, number), depth + 1)

    def value(self, kind: int, path: tuple[int, ...], depth: int) -> None:
        """Pass over a value."""
        self.values += 1
        if depth > LIMITS.parquet_footer_depth or self.values > LIMITS.parquet_footer_values:
            raise FooterError("it holds more values than any real one")
        if kind == _STRUCT:
            self.struct(path, depth)
        elif kind in (_LIST, _SET):
            self.list(path, depth)
        elif kind == _BINARY:
            size = self.varint()  # which moves on by itself
            if path == _PATH:
                self._columns().path.append(
                    self.data[self.place : self.place + size].decode(errors="replace")
                )
            self.place += size
        elif kind == _DOUBLE:
            self.place += 8
        elif kind == _MAP:
            raise FooterError("it holds a map, as no footer does")
        elif kind in (_TRUE, _FALSE, _BYTE):
            self.place += 1
        else:
            self._keep(path, self.varint())

    def _keep(self, path: tuple[int, ...], value: int) -> None:
        """Note a whole number that is asked for."""
        number = value >> 1 ^ -(value & 1)
        if path[:-1] == _PAGES:
            self._columns().numbers[path[-1]] = number
        elif path == _GROUP_ROWS and self.found.groups:
            self.found.groups[-1].rows = number
        elif path == _ROWS:
            self.found.rows = number

    def _columns(self) -> Pages:
        if not (self.found.groups and self.found.groups[-1].columns):
            raise FooterError("it names pages outside of a row group")
        return self.found.groups[-1].columns[-1]

    def list(self, path: tuple[int, ...], depth: int) -> None:
        """Pass over a list."""
        head = self.byte()
        size = head >> 4 if head >> 4 < 15 else self.varint()
        for _ in range(size):
            self.value(head & 15, path, depth + 1)

    def byte(self) -> int:
        self.place += 1
        return self.data[self.place - 1]

    def varint(self) -> int:
        value, self.place = _varint(self.data, self.place)
        return value
