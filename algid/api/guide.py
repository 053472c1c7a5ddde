"""The guide: its topics and their text."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from importlib import resources
from typing import Annotated, Any

from algid.api.answer import Answer, Manual
from algid.base.errors import SettingError
from algid.base.exits import rows
from algid.notices import Message, code_of_now, message, messages
from algid.options import BY_SET, Option, flag

FIRST = (
    *("start", "arm", "lab", "logs", "motion", "report", "warnings", "payload", "export", "batch"),
    *("python", "estimators", "measured", "contributing"),
)
"""The order of the pages; one that is not named here comes behind them."""


def topics() -> dict[str, str]:
    """The pages of the guide by name, with their titles."""
    folder = resources.files("algid") / "guide"
    names = sorted(one.name.removesuffix(".md") for one in folder.iterdir())
    found = {}
    for name in sorted(names, key=lambda name: (*FIRST, name).index(name)):
        with (folder / f"{name}.md").open(encoding="utf-8") as lines:
            found[name] = next(lines).removeprefix("# ").rstrip()
    return found


def guide(topic: Annotated[str, Option(words=lambda: [*topics()])] | None = None) -> str:
    """Read the guide in the terminal.

    Parameters
    ----------
    topic : str
        One of the topics, or the code of a message; the list of topics without.

    Returns
    -------
    str
        Its Markdown.

    Raises
    ------
    SettingError
        If it is neither.

    Examples
    --------
    $ algid guide start
    """
    if topic is None:
        table = "".join(f"| `algid guide {name}` | {words} |\n" for name, words in topics().items())
        return f"# The guide\n\n| | |\n|---|---|\n{table}"
    if topic in topics():
        return text_of(topic)
    try:
        return _entry(message(code_of_now(topic.upper())), "#")
    except KeyError:
        known = ", ".join(topics())
        raise SettingError(
            f"guide: expected one of {known}, or a message's code; found {topic!r:.60}"
        ) from None


def answer(text: str, _given: Mapping[str, Any]) -> Answer:
    """The page."""
    return Answer(lambda: [Manual(text)])


def text_of(topic: str) -> str:
    """A topic's Markdown; what the registries hold stands in place of their marks."""
    text = (resources.files("algid") / "guide" / f"{topic}.md").read_text(encoding="utf-8")
    for mark, table in TABLES.items():
        if mark in text:
            text = text.replace(mark, _markdown(*table()))
    return text.replace("<!-- messages -->", "\n".join(_messages()))


def _messages() -> Iterator[str]:
    """The entries of all codes, under the headings of their groups."""
    for one in messages():
        if one.group:
            yield f"## {one.group}\n"
        yield _entry(one, "###")


def _entry(one: Message, mark: str) -> str:
    """Markdown of what `messages.toml` says of a code."""
    lossy = "*Lossy.* " if one.lossy is True and "*Lossy.*" not in one.cause else ""
    text = f"{mark} {one.code}\n\n{lossy}{one.cause}\n"
    if one.do:
        text += f"\n**Do:** {one.do}\n"
    if one.was:
        text += f"\nBefore 0.3: {', '.join(one.was)}.\n"
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
    from algid.base.units import UNITS

    yield "unit", "of", "also written"
    for unit in UNITS:
        yield f"`{unit.name}`", ", ".join(unit.quantities), unit.spellings.replace(" ", ", ")


def _settings() -> Iterator[Sequence[str]]:
    from algid.settings import Settings

    yield from _fields(Settings)


def _profile() -> Iterator[Sequence[str]]:
    from algid.profile import Profile

    yield from _fields(Profile)


def _fields(model: Any) -> Iterator[Sequence[str]]:
    """Fields: as they are typed, and what they are."""
    from algid.profile import ALL_CHANNELS

    yield "option", "what it says"
    for name, field in model.model_fields.items():
        typed = f"{flag(name)}=…" if name in BY_SET else flag(name)
        if name in ALL_CHANNELS or field.default is True:  # a profile's velocity
            typed = f"{flag('set')} {name}{'.unit' if name in ALL_CHANNELS else ''}=…"
        yield f"`{typed}`", field.description.replace("|", "\\|")


def _moved() -> Iterator[Sequence[str]]:
    from algid.moved import MOVED

    yield "in 0.2", "now"
    for old, new in MOVED.items():
        yield f"`{old}`", new


TABLES: Mapping[str, Callable[[], Iterable[Sequence[str]]]] = {
    "<!-- terms -->": _terms,
    "<!-- estimators -->": _estimators,
    "<!-- formats -->": _formats,
    "<!-- units -->": _units,
    "<!-- settings -->": _settings,
    "<!-- profile -->": _profile,
    "<!-- moved -->": _moved,
    "<!-- exits -->": rows,
}
"""Rows of a table by the mark in whose place it stands."""
