"""The commands of `algid`, gathered: all of them, or the one that is called."""

from __future__ import annotations

import os
from collections.abc import Iterable
from functools import cache
from typing import Annotated, Any

import typer
from typer.main import get_command

from algid import __version__
from algid.cli.derive import COMMANDS, Command, add, listed
from algid.cli.output import say


def _print_version(wanted: bool) -> None:
    if wanted:
        say(f"algid {__version__}")
        raise typer.Exit


def _root(
    _version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version."
        ),
    ] = False,
) -> None:
    pass


def gathered(names: Iterable[str], *, only_listed: bool = False) -> typer.Typer:
    """The application with the commands `names`.

    Commands that are only listed have the first sentence of their help and none of their options.
    """
    made = typer.Typer(
        help="Parameters and payload of a two-link arm, with honest error bars, from its torque "
        "and angle logs.",
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    made.callback()(_root)
    for name in names:
        if only_listed:
            text = listed(name)
            made.command(name, cls=Command, short_help=text)(_nothing)
        else:
            add(made, name)
    return made


def _nothing() -> None:
    """What stands for a command that is only listed."""


@cache
def called(first: str) -> Any:
    """What reads a call that begins with `first`: typer takes 0.2 s to read all options."""
    if any(name.startswith("_ALGID_COMPLETE") for name in os.environ):
        return get_command(gathered(COMMANDS))
    if first in COMMANDS:
        return get_command(gathered([first]))
    return get_command(gathered(COMMANDS, only_listed=True))
