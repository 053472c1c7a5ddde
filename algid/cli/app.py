"""The commands of `algid`, gathered: all of them, or the one that is called."""

from __future__ import annotations

import inspect
import math
import os
from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from algid import __version__
from algid.cli.completion import with_lists
from algid.cli.output import say
from algid.errors import SettingError
from algid.exits import epilog

COMMANDS: dict[str, Callable[[], Callable[..., Any]]] = {
    "example": lambda: import_module("algid.cli.example").example,
    "inspect": lambda: import_module("algid.cli.inspect").inspect,
    "design": lambda: import_module("algid.cli.design").design,
    "identify": lambda: import_module("algid.cli.identify").identify,
    "validate": lambda: import_module("algid.cli.validate").validate,
    "export": lambda: import_module("algid.cli.export").export,
    "batch": lambda: import_module("algid.cli.batch").batch,
    "fleet": lambda: import_module("algid.cli.fleet").fleet,
    "track": lambda: import_module("algid.cli.track").track,
    "check": lambda: import_module("algid.cli.check").check,
    "report": lambda: import_module("algid.cli.report").report,
    "compare": lambda: import_module("algid.cli.compare").compare,
    "synth": lambda: import_module("algid.cli.synth").synth,
    "convert": lambda: import_module("algid.cli.convert").convert,
    "guide": lambda: import_module("algid.cli.guide").guide,
}
"""What loads each command, in the order of `algid --help`."""


class FiniteCommand(TyperCommand):
    """A command whose numbers are finite: no flag of any has a meaning for nan or inf.

    Its help holds the names of registries.
    """

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Show its help."""
        for option in self.params:
            option.help = with_lists(getattr(option, "help", None) or "")  # type: ignore[attr-defined]
        super().format_help(ctx, formatter)

    def invoke(self, ctx: Any) -> Any:
        """Run it.

        Raises
        ------
        SettingError
            If a number is not finite.
        """
        for option in self.params:
            value = ctx.params.get(option.name or "")
            if isinstance(value, float) and not math.isfinite(value):
                raise SettingError(f"{option.opts[0]}: expected a finite number, found {value:g}")
        return super().invoke(ctx)


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


def _help(command: Callable[..., Any]) -> str:
    """What users read of a command's docstring: all but what it raises, which reaches them as a line and exit code."""
    return inspect.cleandoc(command.__doc__ or "").partition("\n\nRaises\n")[0]


def gathered(names: Iterable[str], *, listed: bool = False) -> typer.Typer:
    """The application with the commands `names`, and with the profiles' where none of them is alone.

    Commands that are only `listed` have their help and none of their options.
    """
    made = typer.Typer(
        help="Parameters and payload of a two-link arm, with honest error bars, from its torque "
        "and angle logs.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    made.callback()(_root)
    wanted = list(names)
    for name in wanted:
        command = COMMANDS[name]()
        made.command(name, cls=FiniteCommand, help=_help(command), epilog=epilog(name))(
            (lambda: None) if listed else command
        )
    if len(wanted) != 1:
        profiles = typer.Typer(
            help="Profiles tell what a log's names, units and signs mean.", no_args_is_help=True
        )
        new = import_module("algid.cli.profile").new
        profiles.command("new", help=_help(new))(new)
        made.add_typer(profiles, name="profile")
    return made


def called(arguments: Sequence[str]) -> typer.Typer:
    """The application with what a command line calls: typer takes a fifth of a second to read all commands' options."""
    first = arguments[0] if arguments else ""
    completing = any(name.startswith("_ALGID_COMPLETE") for name in os.environ)
    if completing:
        return gathered(COMMANDS)
    return (
        gathered([first])
        if first in COMMANDS
        else gathered(COMMANDS, listed=first in ("", "-h", "--help"))
    )
