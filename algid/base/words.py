"""How many there are of something, in words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable


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


def repeated(names: Iterable[str]) -> list[str]:
    """The names that stand there more than once, in the order of their first places."""
    return [name for name, count in Counter(names).items() if count > 1]
