"""`algid guide`: the manual, in the terminal."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from algid.api.guide import SUMMARIES, GuideTopic, text_of
from algid.cli.output import console, say


def guide(
    topic: Annotated[
        GuideTopic | None, typer.Argument(help="One of the topics; the list of them without.")
    ] = None,
) -> None:
    """Read the guide in the terminal.

    Example: algid guide start
    """
    if topic is None:
        rows = "".join(f"| `algid guide {name}` | {words} |\n" for name, words in SUMMARIES.items())
        text = f"# The guide\n\n| | |\n|---|---|\n{rows}"
    else:
        text = text_of(topic)
    if not sys.stdout.isatty():
        say(text, end="")
        return
    from rich.markdown import Markdown

    console(width=min(console().width, 120)).print(Markdown(text))
