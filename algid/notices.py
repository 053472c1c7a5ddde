"""What algid has noticed, a code with its numbers and what mends it; and verdicts made of that.

Whoever shows it writes the words.

A `Notice` is data: nobody searches, cuts or compares its text. A `Remedy` holds settings by name
and value, which are written as flags for the command that was typed, or as Python's keywords.
"""

from __future__ import annotations

import re
import shlex
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import resources
from itertools import groupby
from typing import Any, Literal

from algid.base.text import as_toml, filled, joined
from algid.options import FLAGS, SET, VALUES, flag


@dataclass(frozen=True)
class Remedy:
    """Settings that mend what a notice is of, by name: ``zero``, ``tau1.sign``.

    None stands for the user's own value.

    `when` is the case that it is meant for, in words.
    """

    settings: Mapping[str, Any] = field(hash=False)
    when: str = ""

    @property
    def complete(self) -> bool:
        """Whether every value is known, so that a command with it can be run."""
        return all(value is not None for value in self.settings.values())

    @property
    def flags(self) -> tuple[str, ...]:
        """As words of a command line."""
        words: list[str] = []
        for name, value in self.settings.items():
            shown = VALUES.get(name.rpartition(".")[2], "VALUE") if value is None else value
            typed, behind, _ = flag(name).partition(SET)
            if behind and value is not None and not (isinstance(value, str) and value.isalpha()):
                shown = as_toml(value)
            elif isinstance(shown, list | tuple):
                shown = ",".join(map(str, shown))
            words += [SET.strip(), f"{name}={shown}"] if behind else [typed, str(shown)]
        return tuple(words)

    @property
    def words(self) -> str:
        """Its flags as a shell takes them."""
        return shlex.join(self.flags)

    def __str__(self) -> str:
        """As messages name it."""
        return f"{self.when}: {self.words}" if self.when else self.words


@cache
def _entries() -> Mapping[str, str]:
    """Each code's lines of `messages.toml`: most runs need few, and parsing all takes 20 ms."""
    text = (resources.files("algid") / "messages.toml").read_text(encoding="utf-8")
    _, *parts = re.split(r"^\[(\w+)\]$", text, flags=re.MULTILINE)
    return dict(zip(parts[::2], parts[1::2], strict=True))


@cache
def message(code: str) -> Mapping[str, Any]:
    """What stands in `messages.toml` under a code, with its `code`.

    Raises
    ------
    KeyError
        If no such code stands there.
    """
    entry = tomllib.loads(f"[{code}]{_entries()[code]}")[code]
    usual = {"code": code, "group": "", "was": [], "note": False, "lossy": False, "do": ""}
    return usual | entry


def code_of_now(code: str) -> str:
    """The code that stands for one of an earlier version; any other as it is."""
    if code in _entries():
        return code
    return next((one["code"] for one in messages() if code in one["was"]), code)


def messages() -> list[Mapping[str, Any]]:
    """All that algid can say, in the order of the guide."""
    return [message(code) for code in _entries()]


_ANYWHERE = "{accepted:~ (accepted by {flag[accept]})}{looked_at:~ (in its first # s)}"
"""What may stand behind the text of every code."""


def nevertheless(code: str) -> Remedy:
    """What has a log used although a check refuses it."""
    return Remedy({"accept": code}, "to use it nevertheless")


@dataclass(frozen=True)
class Notice:
    """Something that a user should know of a log or of a result.

    Parameters
    ----------
    code : a fixed word such as ``UNEVEN_STAMPS``
    text : what was seen, in a clause; made of the numbers where it is not given
    lossy : whether samples are missing from the log; True where `messages.toml` says so
    note : whether it says how things were done, and is no reason to doubt a result; True likewise
    refuse : whether the log is not used for it
    numbers : what the text is made of
    remedies : what mends it, the likeliest first
    logs : names of the logs that it is of
    """

    code: str
    text: str = ""
    lossy: bool = False
    note: bool = False
    refuse: bool = False
    numbers: Mapping[str, Any] = field(default_factory=dict, hash=False)
    remedies: tuple[Remedy, ...] = ()
    logs: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.text:
            return
        values = {"flag": FLAGS, "accepted": False, "looked_at": 0, "record": "", **self.numbers}
        try:
            entry = message(self.code)
            form = (
                entry["text"] if isinstance(entry["text"], str) else entry["text"][values["case"]]
            )
            made: dict[str, Any] = {"text": filled(form + _ANYWHERE, **values)}
        except (LookupError, TypeError, ValueError) as error:
            raise ValueError(
                f"code {self.code!r:.60}: it has no text for the numbers {sorted(self.numbers)}"
            ) from error
        for kind in ("note", "lossy"):  # True, or the cases in which it holds
            cases = entry[kind]
            made[kind] = getattr(self, kind) or cases is True or self.case in (cases or ())
        for name, value in made.items():
            object.__setattr__(self, name, value)

    @property
    def case(self) -> str:
        """Which of its code's sentences it is; empty where there is one."""
        return str(self.numbers.get("case", ""))

    @property
    def key(self) -> str:
        """Code and case: ``REFUTED:motion``."""
        return f"{self.code}:{self.case}"

    @property
    def remedy(self) -> Remedy | None:
        """The first remedy that can be applied as it stands."""
        return next((one for one in self.remedies if one.complete), None)

    @property
    def advice(self) -> str:
        """What mends it, in flags, those of one case side by side; empty where nothing is known."""
        return "; ".join(
            (f"{when}: " if when else "") + " or ".join(one.words for one in several)
            for when, several in groupby(self.remedies, key=lambda one: one.when)
        )

    @property
    def sentence(self) -> str:
        """Logs, text and advice in one clause."""
        return ": ".join(filter(None, (joined(self.logs, NAMED), self.clause)))

    @property
    def clause(self) -> str:
        """Text and advice."""
        if not self.remedies:
            return self.text
        return f"{self.text}: {self.advice}"

    def __str__(self) -> str:
        """Code and words."""
        return f"{self.code}: {self.sentence}"

    def of(self, *logs: str) -> Notice:
        """The same of those logs."""
        return replace(self, logs=logs)


NAMED = 3
"""Logs of a notice that are named, before how many more there are."""


def merged(notices: Iterable[Notice]) -> list[Notice]:
    """Of each code the first notice, with the logs of all of them.

    Each notice of lost samples stays.
    """
    together: dict[object, Notice] = {}
    for place, one in enumerate(notices):
        key = place if one.lossy else (one.key, one.note)
        first = together.get(key, one)
        together[key] = replace(first, logs=tuple(dict.fromkeys(first.logs + one.logs)))
    return list(together.values())


def flat(settings: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """Settings by their names with dots, as a `Remedy` has them; without those that are None."""
    by_name: dict[str, Any] = {}
    for name, value in settings.items():
        if isinstance(value, Mapping):
            by_name |= flat(value, f"{above}{name}.")
        elif value is not None:
            by_name[above + name] = value
    return by_name


def codes_of(notices: Iterable[Notice]) -> list[str]:
    """Their codes, each once."""
    return list(dict.fromkeys(one.code for one in notices))


def of_codes(notices: Iterable[Notice], *codes: str) -> list[Notice]:
    """Those of the notices that have one of the codes, or codes with case: ``REFUTED:motion``."""
    return [one for one in notices if one.code in codes or one.key in codes]


def has_code(notices: Iterable[Notice], *codes: str) -> bool:
    """Whether a notice has one of the codes."""
    return bool(of_codes(notices, *codes))


def lossy(notices: Iterable[Notice]) -> bool:
    """Whether a notice says that data were lost."""
    return any(one.lossy for one in notices)


def warnings_of(notices: Iterable[Notice]) -> list[Notice]:
    """Those of the notices that make a result doubtful."""
    return [one for one in notices if not one.note]


def notes_of(notices: Iterable[Notice]) -> list[Notice]:
    """Those of the notices that say how things were read and done."""
    return [one for one in notices if one.note]


Grade = Literal["good", "reservations", "failed"]
GRADE_WORDS: dict[Grade, str] = {
    "good": "Good",
    "reservations": "With reservations",
    "failed": "Failed",
}
MOST_REASONS = 3
"""Reasons that a terminal or a page shows at first."""


@dataclass(frozen=True)
class Verdict:
    """A judgement.

    Parameters
    ----------
    grade : 'good', 'reservations' or 'failed'
    headline : what there is to say in one clause
    reasons : what makes it doubtful, the weightiest first
    notes : what was seen of the data and is no reason to doubt it
    command : what to run first, to mend it or to find out
    """

    grade: Grade
    headline: str
    reasons: tuple[Notice, ...] = ()
    notes: tuple[Notice, ...] = ()
    command: str | None = None

    @property
    def word(self) -> str:
        """The word of its grade."""
        return GRADE_WORDS[self.grade]

    @property
    def sentence(self) -> str:
        """Grade and headline, and where it is usable with reservations the first of them."""
        if self.grade == "reservations" and self.reasons:
            return f"{self.word}: {self.headline}, but {self.reasons[0].text}."
        return f"{self.word}: {self.headline}."

    @property
    def failed(self) -> bool:
        """Whether what it is about must not be used."""
        return self.grade == "failed"


def graded(
    headline: str,
    reasons: Sequence[Notice] = (),
    notes: Sequence[Notice] = (),
    *,
    failure: str | None = None,
    things: str = "numbers",
    command: str | None = None,
) -> Verdict:
    """The verdict on `headline`: failed on a `failure`, after which `things` must not be used."""
    grade: Grade = "good"
    if failure is not None:
        grade, headline = "failed", f"{failure}; do not use these {things}"
    elif reasons:
        grade = "reservations"
    return Verdict(grade, headline, tuple(reasons), tuple(notes), command)
