"""What of a Parquet file's structures no library tells without harm: Thrift's compact protocol, passed over.

Whether its footer (FileMetaData) names encrypted columns, and whether a page's header holds a checksum.

By hand: pyarrow ends the process when it is asked for an encrypted column (`std::terminate` in pyarrow 26), and has
no way to ask beforehand. The footer of a million rows of 7 columns takes a millisecond.
"""

from __future__ import annotations

from dataclasses import dataclass

_STOP, _TRUE, _FALSE, _BYTE, _DOUBLE, _BINARY, _LIST, _SET, _MAP, _STRUCT = 0, 1, 2, 3, 7, 8, 9, 10, 11, 12
_NEXT_NUMBER = 0x15
"""The head of a field of 32 bits whose number is that of the last one and 1."""
_ENCRYPTION = {(8,), (4, 1, 8), (4, 1, 9)}
"""Fields: the file's encryption; of each row group's columns how they are encrypted, and their metadata so."""
_DEEPEST = 16
_MOST_VALUES = 5_000_000


class FooterError(Exception):
    """A footer that is no FileMetaData."""


def is_encrypted(footer: bytes) -> bool:
    """Whether a Parquet footer names an encryption of the file or of a column.

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
    return reader.encrypted


def page_has_checksum(head: bytes) -> bool:
    """Whether a page whose header (PageHeader) begins so carries a checksum: its field 4, behind three numbers."""
    reader = _Reader(head)
    try:
        for _ in range(3):
            if reader.byte() != _NEXT_NUMBER:
                return False
            reader.varint()
        return reader.byte() == _NEXT_NUMBER
    except (IndexError, FooterError):
        return False


@dataclass
class _Reader:
    data: bytes
    place: int = 0
    values: int = 0
    encrypted: bool = False

    def struct(self, path: tuple[int, ...], depth: int) -> None:
        """Pass over a structure that stands in the field `path`."""
        number = 0
        while kind := self.byte():
            number = number + (kind >> 4) if kind >> 4 else self.varint() >> 1
            self.encrypted |= (*path, number) in _ENCRYPTION
            if kind & 15 not in (_TRUE, _FALSE):
                self.value(kind & 15, (*path, number), depth + 1)

    def value(self, kind: int, path: tuple[int, ...], depth: int) -> None:
        """Pass over a value."""
        self.values += 1
        if depth > _DEEPEST or self.values > _MOST_VALUES:
            raise FooterError("it holds more values than any real one")
        if kind == _STRUCT:
            self.struct(path, depth)
        elif kind in (_LIST, _SET):
            self.list(path, depth)
        elif kind == _BINARY:
            size = self.varint()  # which moves on by itself
            self.place += size
        elif kind == _DOUBLE:
            self.place += 8
        elif kind == _MAP:
            raise FooterError("it holds a map, as no footer does")
        elif kind in (_TRUE, _FALSE, _BYTE):
            self.place += 1
        else:
            self.varint()

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
        value = shift = 0
        while (byte := self.byte()) & 0x80:
            value |= (byte & 0x7F) << shift
            shift += 7
            if shift > 63:
                raise FooterError("it holds a number without an end")
        return value | byte << shift
