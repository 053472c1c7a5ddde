"""The commands of `algid`, gathered."""

from __future__ import annotations

from typing import Annotated

import typer

from algid import __version__
from algid.cli.batch import batch
from algid.cli.check import check
from algid.cli.compare import compare
from algid.cli.convert import convert
from algid.cli.design import design
from algid.cli.export import export
from algid.cli.fleet import fleet
from algid.cli.guide import guide
from algid.cli.identify import identify
from algid.cli.inspect import inspect
from algid.cli.profile import new
from algid.cli.report import report
from algid.cli.synth import synth
from algid.cli.track import track
from algid.cli.validate import validate

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


profiles = typer.Typer(help="Profiles tell what a log's names, units and signs mean.", no_args_is_help=True)
profiles.command("new")(new)

for command in (
    inspect,
    design,
    identify,
    validate,
    export,
    batch,
    fleet,
    track,
    check,
    report,
    compare,
    synth,
    convert,
    guide,
):
    app.command()(command)
app.add_typer(profiles, name="profile")
