"""How many there are of something, in words."""

from __future__ import annotations


def counted(count: int, one: str, many: str = "") -> str:
    """A number and its noun, with what follows where that changes with it: 1 log, 2 logs.

    1 row lacks, 2 rows lack.

    Parameters
    ----------
    count : int
    one : str
        The words for one of them.
    many : str
        The words for none or several; without them, those for one with an s.
    """
    if count == 1:
        return f"{count:,} {one}"
    return f"{count:,} {many or one + 's'}"
