"""The commands of `algid`, gathered."""

from __future__ import annotations

from typing import Annotated

import typer

from algid import __version__
from algid.cli.check import check
from algid.cli.identify import identify
from algid.cli.synth import synth

app = typer.Typer(
    help="Parameters and payload of a two-link arm, with honest error bars, straight from its torque and angle logs.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"algid {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    _version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


app.command()(synth)
app.command()(identify)
app.command()(check)
