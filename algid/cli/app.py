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
from algid.api.choices import with_lists
from algid.cli.output import say
from algid.errors import SettingError, without_credentials
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

SUMMARIES: dict[str, str] = {
    "example": "Write four runs of an arm, one with a payload, and their profile, for the "
    "guide's examples.",
    "inspect": "Show what a log holds, which channels would be used, and what is wrong with it.",
    "design": "Plan the motion that tells most about an arm within its limits; write PRIOR.design.",
    "identify": "Identify an arm's constants k1 … k7 and, with loaded logs, its payload; write "
    "LOG.algid.",
    "validate": "Print RMSE, normalised RMSE and R² of the predicted torque; exit code 1 past "
    "--max-nrmse.",
    "export": "Write the arm of RESULT as a model.",
    "batch": "Identify many logs: a result folder a job and OUT/jobs.parquet.",
    "fleet": "Tell which robots' parameters drift, and which logs stand out.",
    "track": "Find when the payload changed and what each stretch weighs; write LOG.track.",
    "check": "Compare a result's errors with their limits, row by row; exit code 1 when one "
    "is over.",
    "report": "Write report.html and report.md into each RESULT and print its table.",
    "compare": "Lay results side by side: differences in σ from the first one, and which "
    "settings differ.",
    "synth": "Write CASE-unloaded and CASE-loaded logs of a simulated arm; the truth travels "
    "with them.",
    "convert": "Write a log in another format, in SI units, with canonical names.",
    "guide": "Read the guide in the terminal.",
}
"""The first sentence of each command's help: a list of them loads none."""


class FiniteCommand(TyperCommand):
    """A command whose numbers are finite: no flag of any has a meaning for nan or inf.

    Its help holds the names of registries.
    """

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Show its help."""
        for option in self.params:
            text = with_lists(getattr(option, "help", None) or "")
            option.help = text  # type: ignore[attr-defined]
        super().format_help(ctx, formatter)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the arguments; typer prints those that it refuses."""
        try:
            return super().parse_args(ctx, args)
        except typer.BadParameter.__base__ as error:  # type: ignore[misc]
            error.message = without_credentials(error.message)
            raise

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
    """Help text from a command's docstring, a line a paragraph: the terminal breaks them.

    Exceptions are left out: these become line and exit code.
    """
    text = inspect.cleandoc(command.__doc__ or "").partition("\n\nRaises\n")[0]
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in text.split("\n\n"))


def gathered(names: Iterable[str], *, listed: bool = False) -> typer.Typer:
    """The application with the commands `names`, and with the profiles' where there are several.

    Commands that are only `listed` have the first sentence of their help and none of their options.
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
        command = _nothing if listed else COMMANDS[name]()
        text = SUMMARIES[name] if listed else _help(command)
        made.command(name, cls=FiniteCommand, help=text, epilog=epilog(name))(command)
    if len(wanted) != 1:
        profiles = typer.Typer(
            help="Profiles tell what a log's names, units and signs mean.", no_args_is_help=True
        )
        new = _nothing if listed else import_module("algid.cli.profile").new
        profiles.command("new", help=_help(new))(new)
        made.add_typer(profiles, name="profile")
    return made


def _nothing() -> None:
    """What stands for a command that is only listed."""


def called(arguments: Sequence[str]) -> typer.Typer:
    """The application with the called command only: typer takes 0.2 s to read all options."""
    first = arguments[0] if arguments else ""
    completing = any(name.startswith("_ALGID_COMPLETE") for name in os.environ)
    if completing:
        return gathered(COMMANDS)
    return (
        gathered([first])
        if first in COMMANDS
        else gathered(COMMANDS, listed=first in ("", "-h", "--help"))
    )
