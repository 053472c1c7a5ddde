"""Every fact that a log can state, in every way that takes one: honoured, refused, told or misread.

The table `facts.txt` has a letter a cell: H honoured, h honoured with a notice, R refused in one
line, N told by a notice, I read on without harm, S silently misread, X another exception than a
user's; "." where a way has no place for a fact. A new way or a new fact fills its row:
``python -m tests.readers.test_facts`` writes the table anew.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import algid
from tests.readers.facts import EVERY, TA, TH, Fact, N, base, messages
from tests.readers.ways import FLAT, WAYS, CannotSayError, Flat, States, written

TABLE = Path(__file__).with_name("facts.txt")
_LABEL = 64
UNTOLD = {
    "sentinel -9999": "a number like another: the guide lists it",
    "sentinel 0 in torque alone": "a torque like another: the guide lists it",
    "torque at a quarter of the rate: held": "identify and inspect name it: HELD_EFFORT",
}
"""Facts that reading alone cannot tell."""


def _codes(log: algid.Log) -> frozenset[str]:
    return frozenset(notice.code for notice in log.notices)


@cache
def _usual(way: str) -> frozenset[str]:
    """The notices of a plain log in one way."""
    with tempfile.TemporaryDirectory() as folder:
        given = written(way, Path(folder), Flat(base()) if way in FLAT else States(messages()))
        log = given() if callable(given) else algid.read_log(given)
    assert np.allclose(log.theta, TH)
    assert np.allclose(log.tau, TA)
    return _codes(log)


def _agrees(log: algid.Log, fact: Fact) -> bool:
    """Whether a log has every sample of the truth, or those of them that are to be kept."""
    t, theta, tau = fact.truth
    for kept in (np.ones(N, bool), fact.keep):
        if kept is None or len(log) != np.count_nonzero(kept):
            continue
        same = (
            np.allclose(log.t, t[kept] - t[kept][0], atol=max(fact.within, 2e-6))
            and np.allclose(log.theta, theta[:, kept], atol=fact.within)
            and np.allclose(log.tau, tau[:, kept], atol=fact.within)
        )
        if fact.omega is not None:
            same = same and log.omega is not None and np.allclose(log.omega, fact.omega, atol=1e-6)
        if same and fact.fits(log):
            return True
    return False


def judged(fact: Fact, way: str, folder: Path) -> tuple[str, str]:
    """The letter of a cell, and what was said."""
    try:
        given = fact.given(way, folder)
    except CannotSayError:
        return ".", ""
    try:
        log = given() if callable(given) else algid.read_log(given, **fact.options)
    except algid.AlgidError as error:
        return "R", str(error)
    except Exception as error:
        return "X", repr(error)
    told = _codes(log) - _usual(way)
    words = f"{sorted(told)} {log.origin.mapping}"
    if fact.says_other:
        return ("N" if told else "I" if _agrees(log, fact) else "S"), words
    if _agrees(log, fact):
        return ("h" if told else "H"), words
    return ("N" if told else "S"), words


def rows(facts: tuple[Fact, ...] = EVERY) -> Iterator[tuple[Fact, list[tuple[str, str]]]]:
    """Each fact's cells."""
    for fact in facts:
        cells = []
        for way in WAYS:
            with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
                warnings.simplefilter("ignore")
                cells.append(judged(fact, way, Path(folder)))
        yield fact, cells


def _expected() -> dict[str, list[str]]:
    table = {}
    for line in TABLE.read_text().splitlines()[1:]:
        table[line[:_LABEL].strip()] = line[_LABEL:].split()
    return table


@pytest.mark.parametrize("fact", EVERY, ids=lambda fact: fact.label)
def test_every_way_makes_of_a_fact_what_the_table_says(fact: Fact) -> None:
    ((_, cells),) = rows((fact,))
    found = dict(zip(WAYS, cells, strict=True))
    expected = dict(zip(WAYS, _expected()[fact.label], strict=True))
    changed = {way: cell for way, cell in found.items() if cell[0] != expected[way]}
    assert not changed, f"{fact.label}: expected {expected}"


def test_table_has_no_fact_of_old() -> None:
    assert list(_expected()) == [fact.label for fact in EVERY]


def test_nothing_else_is_silently_misread() -> None:
    assert {label for label, cells in _expected().items() if "S" in cells} == UNTOLD.keys()
    assert not [label for label, cells in _expected().items() if "X" in cells]


def main() -> None:
    """Write the table, and print what is silently misread."""
    lines = ["".ljust(_LABEL) + "".join(f"{way:>10s}" for way in WAYS)]
    tally: dict[str, int] = {}
    for fact, cells in rows():
        lines.append(fact.label.ljust(_LABEL) + "".join(f"{cell:>10s}" for cell, _ in cells))
        for way, (cell, said) in zip(WAYS, cells, strict=True):
            tally[cell] = tally.get(cell, 0) + 1
            if cell in "SX":
                print(cell, fact.label, way, said[:200], sep=" | ")
    TABLE.write_text("\n".join(lines) + "\n")
    print(tally)


if __name__ == "__main__":
    main()
