"""The application: its commands are made when they are called, or listed."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import click
from click.shell_completion import get_completion_class

from algid import __version__
from algid.base.errors import SettingError
from algid.base.exits import Exit
from algid.cli.derive import COMMANDS, command, listed
from algid.cli.output import say

COMPLETE = "_ALGID_COMPLETE"
STARTS = {"bash": ".bashrc", "zsh": ".zshrc", "fish": ".config/fish/config.fish"}
"""By shell the file that it reads as it starts, below the home folder."""


def _completion(ctx: click.Context, option: click.Parameter, wanted: bool) -> None:
    if not wanted:
        return
    shell = Path(os.environ.get("SHELL", "")).name
    if shell not in STARTS:
        raise SettingError(f"{option.opts[0]}: expected bash, zsh or fish, found {shell!r:.60}")
    script = get_completion_class(shell)(app, {}, "algid", COMPLETE).source()  # type: ignore[misc]
    if option.name == "install_completion":
        start, script = Path.home() / STARTS[shell], f'eval "$({COMPLETE}={shell}_source algid)"'
        if shell == "fish":
            script = f"{COMPLETE}=fish_source algid | source"
        start.parent.mkdir(parents=True, exist_ok=True)
        with start.open("a", encoding="utf-8") as file:
            file.write(f"{script}\n")
        script = f"added to {start}: {script}"
    say(script)
    ctx.exit()


class Algid(click.Group):
    """The commands by name."""

    def list_commands(self, _ctx: click.Context) -> list[str]:
        """Their names, in the order of help."""
        return list(COMMANDS)

    def get_command(self, _ctx: click.Context, name: str) -> click.Command | None:
        """The command of that name, with all its options."""
        return command(name) if name in COMMANDS else None

    def format_commands(self, _ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write what each does, without loading what it needs."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, listed(name)) for name in COMMANDS])


app = Algid(
    "algid",
    help="Parameters and payload of a two-link arm, with honest error bars, from its torque and "
    "angle logs.",
    context_settings={"help_option_names": ["-h", "--help"]},
)
click.version_option(__version__, message="%(prog)s %(version)s", help="Print the version.")(app)
for name, text in (
    ("--install-completion", "Install completion for the current shell."),
    ("--show-completion", "Print the script of that."),
):
    eager = {"is_flag": True, "is_eager": True, "expose_value": False}
    app.params.append(click.Option([name], help=text, callback=_completion, **eager))


def called(arguments: Sequence[str]) -> int:
    """Run a command and return its exit code."""
    if COMPLETE in os.environ:
        app.main(prog_name="algid")
    if not arguments:
        called(["--help"])
        return Exit.USAGE
    try:
        with app.make_context("algid", list(arguments)) as context:
            app.invoke(context)
    except click.exceptions.Exit as ended:
        return ended.exit_code
    return 0
