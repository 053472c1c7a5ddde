"""The guide: its topics and their text."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from enum import StrEnum
from importlib import resources

from algid.api.choices import with_lists
from algid.options import PROFILE, SETTINGS, flag, options_of


class GuideTopic(StrEnum):
    """The pages of the guide."""

    START = "start"
    ARM = "arm"
    LAB = "lab"
    CAMPAIGN = "campaign"
    LOGS = "logs"
    MOTION = "motion"
    EXPORT = "export"
    REPORT = "report"
    WARNINGS = "warnings"
    ESTIMATORS = "estimators"
    PAPER = "paper"
    PAYLOAD = "payload"
    BATCH = "batch"
    CI = "ci"
    PYTHON = "python"
    MEASURED = "measured"
    CONTRIBUTING = "contributing"


SUMMARIES = {
    GuideTopic.START: "a first result from a real log",
    GuideTopic.ARM: "the drawing, the equation of motion, what each constant is",
    GuideTopic.LAB: "a real arm, from its logs to what it carries, to be typed along",
    GuideTopic.CAMPAIGN: "from a design over the recording to the export, to be typed along",
    GuideTopic.LOGS: "formats, names, units, signs: a recipe for each awkward log",
    GuideTopic.MOTION: "which motion to record",
    GuideTopic.EXPORT: "the arm as URDF, SDF, MJCF, Python, C; the payload as YAML",
    GuideTopic.REPORT: "the report, figure by figure",
    GuideTopic.WARNINGS: "every warning and status: meaning, cause, what to do",
    GuideTopic.ESTIMATORS: "the estimators, the torque's terms, and what they assume",
    GuideTopic.PAPER: "the paper's method, its misprints, and how special its torque is",
    GuideTopic.PAYLOAD: "payloads, lengths, payload in time",
    GuideTopic.BATCH: "thousands of logs, fleets, clusters",
    GuideTopic.CI: "an arm and its logs checked by a forge at every change",
    GuideTopic.PYTHON: "the Python API",
    GuideTopic.MEASURED: "accuracy, robustness and speed, each figure with its command",
    GuideTopic.CONTRIBUTING: "the house and its rules",
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
}
"""Rows of a table by the mark in whose place it stands."""
