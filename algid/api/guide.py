"""The guide: its topics and their text."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from enum import StrEnum
from importlib import resources

from algid.api.choices import with_lists
from algid.exits import rows
from algid.options import PROFILE, SETTINGS, flag, options_of


class GuideTopic(StrEnum):
    """The pages of the guide."""

    START = "start"
    ARM = "arm"
    LAB = "lab"
    LOGS = "logs"
    MOTION = "motion"
    REPORT = "report"
    WARNINGS = "warnings"
    PAYLOAD = "payload"
    EXPORT = "export"
    BATCH = "batch"
    PYTHON = "python"
    ESTIMATORS = "estimators"
    MEASURED = "measured"
    CONTRIBUTING = "contributing"


SUMMARIES = {
    GuideTopic.START: "a first result from a real log, in five minutes",
    GuideTopic.ARM: "drawing, equation of motion, meaning of each constant",
    GuideTopic.LAB: "a real arm, from its logs to its payload, to type along",
    GuideTopic.LOGS: "formats, names, units, signs: a recipe for each awkward log",
    GuideTopic.MOTION: "which motion to record: design, recording, comparison with the plan",
    GuideTopic.REPORT: "the report, figure by figure",
    GuideTopic.WARNINGS: "every warning and status: meaning, cause, what to do",
    GuideTopic.PAYLOAD: "payload mass, lengths, payload in time",
    GuideTopic.EXPORT: "the arm as URDF, SDF, MJCF, Python, C, and draws of it; the payload "
    "as YAML",
    GuideTopic.BATCH: "many logs, fleets, exit codes, CI, clusters",
    GuideTopic.PYTHON: "the Python API",
    GuideTopic.ESTIMATORS: "the estimators, the torque's terms, assumptions, the paper's method",
    GuideTopic.MEASURED: "accuracy, robustness and speed, each figure with its command",
    GuideTopic.CONTRIBUTING: "architecture and conventions",
}


def text_of(topic: str) -> str:
    """A topic's Markdown; what the registries hold stands in place of their marks."""
    text = (resources.files("algid") / "guide" / f"{topic}.md").read_text(encoding="utf-8")
    for mark, table in TABLES.items():
        if mark in text:
            text = text.replace(mark, _markdown(*table()))
    return text


def _markdown(*rows: Sequence[str]) -> str:
    """A table; the first row is its head."""
    lines = [f"| {' | '.join(cells)} |" for cells in rows]
    lines.insert(1, "|---" * len(rows[0]) + "|")
    return "\n".join(lines)


def _terms() -> Iterator[Sequence[str]]:
    from algid.physics.terms import OPTIONAL

    yield "term", "what it is", "what it adds to the torque", "its parameters"
    for term in OPTIONAL:
        meanings = "; ".join(f"{one.name}, {one.unit}: {one.meaning}" for one in term.parameters)
        title = term.title
        if term.needs:
            title += f", beside `{term.needs}`"
        yield f"`{term.name}`", title, term.equation.replace("|", "\\|"), meanings


def _estimators() -> Iterator[Sequence[str]]:
    from algid.methods import ESTIMATORS

    yield f"`{flag('estimator')}`", "what it does", "when"
    for one in ESTIMATORS:
        name = f"`{one.name}`"
        if one is ESTIMATORS[0]:
            name += " (default)"
        yield name, one.does, one.when


def _formats() -> Iterator[Sequence[str]]:
    from algid.readers.formats import FORMATS

    yield "format", "names end in"
    for form in FORMATS:
        yield form.title, ", ".join(f"`{suffix}`" for suffix in form.suffixes) or "a folder"


def _units() -> Iterator[Sequence[str]]:
    from algid.units import UNITS

    yield "unit", "of", "also written"
    for unit in UNITS:
        yield f"`{unit.name}`", ", ".join(unit.quantities), unit.spellings.replace(" ", ", ")


def _options(taker: str) -> Iterator[Sequence[str]]:
    yield "option", "what it says"
    for one in options_of(taker):
        yield f"`{flag(one.name)}`", with_lists(one.help).replace("|", "\\|")


TABLES: Mapping[str, Callable[[], Iterable[Sequence[str]]]] = {
    "<!-- terms -->": _terms,
    "<!-- estimators -->": _estimators,
    "<!-- formats -->": _formats,
    "<!-- units -->": _units,
    "<!-- settings -->": lambda: _options(SETTINGS),
    "<!-- profile -->": lambda: _options(PROFILE),
    "<!-- exits -->": rows,
}
"""Rows of a table by the mark in whose place it stands."""
