"""The guide: its topics and their text."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

from algid.api import Answer, Manual
from algid.base.errors import SettingError
from algid.notices import code_of_now, message
from algid.options import Option

FOLDER = Path(str(resources.files("algid"))) / "guide"
TOPICS = (
    *("start", "arm", "lab", "logs", "motion", "report", "warnings", "payload", "export", "batch"),
    *("python", "estimators", "measured", "contributing"),
)
"""The pages, in their order."""


def guide(topic: Annotated[str, Option(suggested=lambda: TOPICS)] | None = None) -> str:
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
        titles = {name: text_of(name).partition("\n")[0].removeprefix("# ") for name in TOPICS}
        return str(_tables().contents(titles))
    if topic in TOPICS:
        return text_of(topic)
    try:
        return str(_tables().entry(message(code_of_now(topic.upper())), "#"))
    except KeyError:
        known = f"{', '.join(TOPICS)}, or a message's code"
        raise SettingError(f"guide: expected one of {known}; found {topic!r:.60}") from None


def answer(text: str, _given: Mapping[str, Any]) -> Answer:
    """The page."""
    return Answer([Manual(text)])


def text_of(topic: str) -> str:
    """A topic's Markdown; what the registries hold stands in place of ``<!-- terms -->``."""
    text = (FOLDER / f"{topic}.md").read_text(encoding="utf-8")

    def table(mark: re.Match[str]) -> str:
        from algid.api.options import options_of
        from algid.base.errors import Exit
        from algid.base.units import UNITS
        from algid.methods import ESTIMATORS
        from algid.notices import messages
        from algid.options import MOVED
        from algid.physics.terms import OPTIONAL
        from algid.profile import Profile
        from algid.readers.formats import FORMATS
        from algid.settings import Settings

        registries: Mapping[str, Any] = {
            "estimators": ESTIMATORS,
            "exits": Exit,
            "formats": FORMATS,
            "messages": messages(),
            "moved": MOVED,
            "profile": options_of(Profile),
            "settings": options_of(Settings),
            "terms": OPTIONAL,
            "units": UNITS,
        }
        return str(getattr(_tables(), mark[1])(registries[mark[1]]))

    return re.sub(r"<!-- (\w+) -->\n", table, text)


def _tables() -> Any:
    """The macros of ``tables.md.j2``, which write what the registries hold."""
    from algid.exports import template

    return template(FOLDER / "tables.md.j2").module
