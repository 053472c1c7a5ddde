"""The words of messages: numbers and their nouns agree, and a flag stands before the line of a
profile.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import algid
from algid.base.words import counted

ROOT = Path(algid.__file__).parent
VERBS = frozenset(
    re.findall(
        "[a-z]+",
        "as breaks claims comes counts depends does freezes gives has holds is jumps leads less "
        "lies ns stands states "
        "swaps takes unpacks was",
    )
)
"""What ends in an s behind a filled-in word, and is no noun."""
BETWEEN = frozenset(
    re.findall(
        "[a-z]+",
        "a an and are at by for from had have in into may never of on or the to was were where "
        "which with",
    )
)
"""What no adjective of a noun is."""
TEXTS = ("kind", "listed", "name", "times", "wider")
"""Names of what is text already."""


def test_a_noun_agrees_with_its_number() -> None:
    assert counted(1, "log") == "1 log"
    assert counted(2, "log") == "2 logs"
    assert counted(0, "log") == "0 logs"
    assert counted(1, "row lacks", "rows lack") == "1 row lacks"
    assert counted(12_345, "row lacks", "rows lack") == "12,345 rows lack"


def plural(text: str) -> str | None:
    """The noun in the plural with which a text goes on behind a number, if it does: ``samples``,
    ``moving joints``.
    """
    found = re.match(r" ([a-z]+)(?: ([a-z]+))?", text)
    if found is None:
        return None
    first, second = found[1], found[2] or ""
    if len(first) > 1 and first.endswith("s") and not first.endswith(("ss", "us")):
        return None if first in VERBS else first
    ends = len(second) > 1 and second.endswith("s") and not second.endswith(("ss", "us"))
    return f"{first} {second}" if ends and second not in VERBS and first not in BETWEEN else None


def fixed(value: ast.FormattedValue) -> bool:
    """Whether this is a constant of the house, a text, or a measured number with its digits: 1.3
    degrees.
    """
    inner = value.value
    if isinstance(inner, ast.Call):
        asked = (
            inner.func.id
            if isinstance(inner.func, ast.Name)
            else ast.unparse(inner.func).rpartition(".")[2]
        )
        if asked in ("counted", "significant", "join", "flag"):
            return True
    name = (
        inner.attr
        if isinstance(inner, ast.Attribute)
        else inner.id
        if isinstance(inner, ast.Name)
        else ""
    )
    if name in TEXTS:
        return True
    if isinstance(inner, ast.Attribute) and ast.unparse(inner.value) == "LIMITS":
        return True
    digits = ast.unparse(value.format_spec) if value.format_spec else ""
    return (
        value.conversion != -1
        or bool(name and name == name.upper())
        or bool(re.search(r"\.[1-9]\d*[efg]", digits))
    )


def unhelped(source: str) -> Iterator[str]:
    """Every formatted number with a noun in the plural behind it that does not ask how many there
    are.
    """
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.JoinedStr):
            continue
        for value, after in zip(node.values, node.values[1:], strict=False):
            if (
                isinstance(value, ast.FormattedValue)
                and isinstance(after, ast.Constant)
                and not fixed(value)
            ):
                noun = plural(str(after.value))
                if noun:
                    yield f"{value.lineno}: {{{ast.unparse(value.value)}}} {noun}"


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ('f"{n} samples"', ["1: {n} samples"]),
        ('f"{len(missing)} messages are missing"', ["1: {len(missing)} messages"]),
        ('f"{n:,} moving joints"', ["1: {n} moving joints"]),
        ('f"{n:.0f} degrees"', ["1: {n} degrees"]),
        ("f\"{counted(n, 'sample')} of it\"", []),
        ('f"{name} has no sample"', []),
        ('f"{MOST} rows"', []),
        ('f"{LIMITS.columns} columns"', []),
        ('f"{file.columns} columns"', ["1: {file.columns} columns"]),
        ('f"{far:.2g} standard deviations"', []),
    ],
)
def test_what_the_walk_finds(source: str, found: list[str]) -> None:
    assert list(unhelped(source)) == found


def test_no_number_stands_before_a_plural_of_its_own_making() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{one}"
        for path in sorted(ROOT.rglob("*.py"))
        for one in unhelped(path.read_text())
    ]
    assert found == []


def behind_a_profile(source: str) -> Iterator[str]:
    """Every text that gives the line of a profile, and no flag or filled-in word before it."""
    tree = ast.parse(source)
    within = {
        id(part)
        for node in ast.walk(tree)
        if isinstance(node, ast.JoinedStr)
        for part in ast.walk(node)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            text = "".join(
                str(part.value) if isinstance(part, ast.Constant) else "--x" for part in node.values
            )
        elif (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and id(node) not in within
        ):
            text = node.value
        else:
            continue
        place = text.find("(profile:")
        if place >= 0 and not re.search(r"--[a-z]", text[:place]):
            yield f"{node.lineno}: {text[:60]}"


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("'a (profile: start = 2)'", 1),
        ("'--start 2 (profile: start = 2)'", 0),
        ("f'{flag} (profile: {line})'", 0),
        ("f'set (profile: {line}) or {flag}'", 1),
    ],
)
def test_what_the_walk_finds_behind_a_profile(source: str, found: int) -> None:
    assert len(list(behind_a_profile(source))) == found


def test_a_message_names_the_flag_before_the_line_of_a_profile() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{one}"
        for path in sorted(ROOT.rglob("*.py"))
        for one in behind_a_profile(path.read_text())
    ]
    assert found == []
