"""How names, numbers and counts are written: the one place, so that every format shows the same.

Names out of logs are foreign text, which may not reach a terminal or a page as it is.
"""

from __future__ import annotations

import json
import math
import re
import string
import textwrap
import unicodedata
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

from algid.base.errors import without_credentials

LONGEST = 300
# Controls drive a terminal, format characters reorder what is read, separators break lines.
_HIDDEN = {"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"}


def visible(text: str, longest: int = LONGEST) -> str:
    """`text` with every invisible character escaped, cut to a length of `longest`."""
    return printable(text[:longest], kept="") + ("…" if len(text) > longest else "")


def printable(text: str, kept: str = "\n\t") -> str:
    """`text` with every invisible character, but those `kept`, as JSON's strings escape it.

    Credentials are left out.
    """

    def shown(odd: re.Match[str]) -> str:
        hidden = odd[0] not in kept and unicodedata.category(odd[0]) in _HIDDEN
        return json.dumps(odd[0])[1:-1] if hidden else odd[0]

    return _ODD.sub(shown, without_credentials(text))


_ODD = re.compile(r"[^ -~]")


def file_name(path: str) -> str:
    """Last part of a path of any system, made visible."""
    return visible(path.replace("\\", "/").rstrip("/").rpartition("/")[2] or path)


def joined(words: Sequence[str], most: int | None = None) -> str:
    """The words as a list in a sentence, at most so many of them: a, b and 3 more."""
    words = list(words)
    if most is not None and len(words) > most:
        words[most:] = [f"{len(words) - most} more"]
    return " and ".join(filter(None, (", ".join(words[:-1]), *words[-1:])))


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
    return f"{count:,} {one if count == 1 else many or one + 's'}"


def repeated(names: Iterable[str]) -> list[str]:
    """The names that stand there more than once, in the order of their first places."""
    return [name for name, count in Counter(names).items() if count > 1]


def unit_text(unit: str) -> str:
    """A unit with its power as it is printed: kg m²."""
    return visible(unit).replace("^2", "²")


_UNIT = re.compile(r"(?<=\d) (?=(?:%|(?:kg|N|rad|ms|m|s|Hz)\b))|(?<=±) (?=\d)")
_FLAG = re.compile(r"(--[a-z][\w-]*) (?=[^\s-])")


def lines_of(text: str, width: int, first: str = "", rest: str = "") -> list[str]:
    """A text in lines of `width` at most that begin as given.

    No number parts from its unit, no flag from its value; what is longer than a line, like a path,
    stays whole.
    """
    glued = _FLAG.sub("\\1\u00a0", _UNIT.sub("\u00a0", text))
    wrapped = textwrap.wrap(
        glued,
        width,
        initial_indent=first,
        subsequent_indent=rest,
        break_on_hyphens=False,
        break_long_words=False,
    )
    return [line.replace("\u00a0", " ") for line in wrapped]


ABSENT = "–"
SMALLEST_FIXED = 1e-3
LARGEST_FIXED = 1e6
MOST_DIGITS = 8


class _Form(string.Formatter):
    """Python's formats, and what `filled` says of them."""

    def format_field(self, value: Any, spec: str) -> str:
        """One value as `spec` has it."""
        several, optional, form = isinstance(value, list | tuple), spec[:1] == "~", spec.lstrip("~")
        if optional and form.isdigit():
            return significant(value, int(form))
        if optional and not value:
            return ""
        if "|" in form:
            count = len(value) if several else value
            return form.split("|")[count != 1].replace("#", f"{count:,}")
        if optional:
            return form.replace("#", str(value))
        if value is None or value != value:
            return ABSENT
        if isinstance(value, bool):
            return "yes" if value else "no"
        return joined(list(map(str, value))) if several else str(format(value, form))


def filled(form: str, *values: Any, **named: Any) -> str:
    """A form such as `str.format` takes, filled in.

    ``{:~3}`` has three significant digits. Of ``{count:# sample has|# samples have}`` one is taken.
    Behind ``~``, # is the value; nothing stands there for 0, None or empty. Lists are joined. True
    is yes; None and NaN are a dash.
    """
    return _Form().vformat(form, values, named)


def cells(form: str, *values: Any, **named: Any) -> tuple[str, ...]:
    """A row of a table: each cell as its part of `form` has it, with " | " between the parts."""
    return tuple(filled(part, *values, **named) for part in form.split(" | "))


def significant(value: float | None, digits: int = 5) -> str:
    """`value` with that many significant digits.

    a dash where there is none, ∞ where it is unbounded.
    """
    if value is None or math.isnan(value):
        return ABSENT
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if value == 0:
        return "0"
    mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")  # once rounded
    if SMALLEST_FIXED <= abs(value) < LARGEST_FIXED:
        return f"{value:.{max(digits - 1 - int(power), 0)}f}"
    return f"{mantissa}e{int(power)}"


def resolved(value: float | None, std: float | None) -> str:
    """`value` down to the second significant digit of its standard deviation.

    Five digits where there is none.
    """
    return significant(value, digits_of(value, std))


def digits_of(value: float | None, std: float | None) -> int:
    """Significant digits of `value` that its standard deviation supports: two to eight."""
    if not (value and std and std > 0 and math.isfinite(value) and math.isfinite(std)):
        return 5
    leading = math.floor(math.log10(abs(value))) - math.floor(math.log10(std))
    return min(max(leading + 2, 2), MOST_DIGITS)


def percent(part: float | None, whole: float | None, digits: int = 2) -> str:
    """`part` in percent of the size of `whole`."""
    if part is None or not whole:
        return ABSENT
    return significant(100 * part / abs(whole), digits)


def as_toml(value: Any) -> str:
    """Text, or a list of it, as TOML has it: as JSON, but for one control character."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
