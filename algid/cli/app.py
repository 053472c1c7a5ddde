"""The application: each command out of its verb, made when it is called; errors become one line.

A positional parameter is an argument, a keyword an option; its help is what the docstring says of
it, and a verb that reads logs has an option for each field of `Settings` and `Profile`. A verb's
module says by `answer` what is printed, and how the command ends.
"""

from __future__ import annotations

import inspect
import os
import shlex
import sys
import traceback
from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, get_args, get_origin

import click
from click.shell_completion import CompletionItem

from algid import __version__, api
from algid.base.errors import AlgidError, Exit, epilog
from algid.base.faults import fault
from algid.base.text import lines_of
from algid.cli.output import complain, progress, remark, shown
from algid.guard import TRACEBACK
from algid.options import ADVANCED, ARGUMENTS, VALUES, Option, refuse_moved

COMMANDS: Mapping[str, str] = {
    "inspect": "inspect",
    "design": "design",
    "identify": "identify",
    "validate": "validate",
    "export": "export",
    "batch": "batch",
    "track": "track",
    "report": "report",
    "compare": "compare",
    "synth": "synthesise",
    "convert": "convert",
    "guide": "guide",
}
"""The function of each command, whose module has the command's name, in the order of help."""
PRINTED = ("inspect", "design", "identify", "validate", "track", "report", "compare")
"""Commands that print tables, or JSON."""
LETTERS = {"out": ["--out"], "quiet": ["-q"], "verbose": ["-v"]}
KINDS = {Path: "PATH", float: "X", int: "N"}
"""By the type of a value what stands for it."""


class Command(click.Command):
    """A command whose help has a line an option, by panel."""

    taken: Mapping[str, Option]

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write arguments and options."""
        panels = defaultdict[str, list[tuple[str, str]]](list)
        for one in self.get_params(ctx):  # arguments, everyday, advanced, and click's own --help
            known = self.taken.get(str(one.name), Option(panel=ADVANCED))
            label, text = one.get_help_record(ctx) or (str(one.metavar), "")
            panels[known.panel].append((label, text or known.help))
        for panel, rows in panels.items():
            with formatter.section(panel):
                formatter.write_dl(rows)


def listed(name: str) -> str:
    """The first sentence of a command's docstring, without loading what it needs."""
    text = (Path(api.__path__[0]) / f"{name}.py").read_text(encoding="utf-8")
    docstring = text.partition(f"\ndef {COMMANDS[name]}(")[2].split('"""')[1]
    return " ".join(docstring.partition("\n\n")[0].split())


def command(name: str) -> Command:
    """The command that calls a verb."""
    from algid.api.options import described, options_of

    module = import_module(f"algid.api.{name}")
    verb = getattr(module, COMMANDS[name])
    parameters = inspect.signature(verb).parameters
    every, text = options_of(verb).values(), "Any other setting, as tau1.sign=-1; may be repeated."
    by_set = [one for one in every if one.by_set]
    taken = [one for one in every if not one.by_set]
    tops = [one.name.partition(".")[0] for one in every if one.by_set or one.name not in parameters]
    settable = dict.fromkeys(tops)
    arguments = [one.name for one in taken if one.panel == ARGUMENTS]
    if by_set:
        lines = [f"{one.name}={word}" for one in by_set for word in one.words or [""]]
        if "options" not in parameters:
            text = f"NAME=VALUE of {', '.join(one.name for one in by_set)}."
        taken.append(Option(list[str], ADVANCED, "set", text, suggested=lambda: lines))
    if name in PRINTED:
        words, text = ["table", "json"], "What to print."
        either = click.Choice(words)
        taken.append(Option(either, ADVANCED, "format", text, default="table", words=words))
    if name == "identify":
        taken.append(Option(bool, ADVANCED, "verbose", "All tables, logs, settings."))
    taken.append(Option(bool, ADVANCED, "quiet", "Print nothing but errors."))

    def run(quiet: bool, verbose: bool = False, set: Sequence[str] = (), **typed: Any) -> None:  # noqa: A002
        """Call the verb with what is typed, print its answer, and end with its exit code."""
        from algid.api.options import set_by
        from algid.base.runtime import keep_freed

        keep_freed()
        as_json = name in PRINTED and typed.pop("format") == "json"
        given = {key: value for key, value in typed.items() if value not in (None, ())}
        given = getattr(module, "typed", dict)(given | set_by(set, settable))
        with progress(quiet) as bar:
            line = shlex.join(["algid", *sys.argv[1:]])
            callers = {"command": line, "complain": complain, "progress": bar}
            called = {key: value for key, value in callers.items() if key in parameters}
            called |= {key: value for key, value in given.items() if key not in arguments}
            value = verb(*map(given.get, arguments), **called)
        answers = value  # of a report
        if hasattr(module, "answer"):
            answers = [module.answer(value, given | {"verbose": verbose})]
        for one in answers:
            shown(one, as_json, quiet)
        click.get_current_context().exit(max(one.exit for one in answers))

    *above, example = described(verb)[0]
    text = "\n\n".join((*above, "\b\n" + "\n".join(lines_of(example, 76, rest="  "))))
    made = Command(name, params=list(map(_parameter, taken)), help=text, callback=run)
    made.epilog, made.taken = epilog(name), {one.name: one for one in taken}
    return made


def _parameter(one: Option) -> click.Parameter:
    """An option as click takes it."""
    many, name = get_origin(one.kind) is list, one.name.upper()
    kind = get_args(one.kind)[0] if many else one.kind
    required = one.default is inspect.Parameter.empty
    said: dict[str, Any] = {
        "type": click.Path(path_type=Path) if kind is Path else kind,
        "metavar": "WORD" if one.words else VALUES.get(one.name, KINDS.get(kind, "TEXT")),
        "required": required,
        "shell_complete": partial(_completed, one),
    }
    if one.default and not required:
        said["default"] = one.default
    if one.panel == ARGUMENTS:
        said["metavar"] = f"{name.removesuffix('S')}..." if many else name
        return click.Argument([one.name], nargs=-1 if many else 1, **said)
    if kind is bool:  # what is given switches off what is on
        said = {"flag_value": not one.default, "default": one.default, "is_flag": True}
    names = [*LETTERS.get(one.name, ()), one.flag, one.name]
    return click.Option(names, help=one.help, multiple=many, **said)


def _completed(one: Option, _ctx: object, _parameter: object, begun: str) -> list[CompletionItem]:
    """Completes the last of several words, separated by commas and each used once; else a file."""
    before, comma, last = begun.rpartition(",")
    found = [
        CompletionItem(before + comma + word)
        for word in (one.suggested() if one.suggested else one.words)
        if word.startswith(last) and word not in before.split(",")
    ]
    return found or [CompletionItem(begun, type="file")]


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


def run(arguments: Sequence[str]) -> int:
    """Run a command and return its exit code: the outermost place, where errors become lines.

    Raises
    ------
    SystemExit
        As the command ends by itself with an exit code of its own.
    """
    try:
        try:
            refuse_moved(shlex.join(["algid", *arguments]))
            code = app.main(list(arguments) or ["--help"], "algid", standalone_mode=False)
            return code if arguments else Exit.USAGE
        finally:
            sys.stdout.flush()  # else a full disk is told by the interpreter, in its words
    except SystemExit:
        raise
    except BaseException as error:  # whatever a library raises, a panic too
        cause, (line, code) = error, fault(error)
        if isinstance(error, AlgidError):
            line, code = str(error), Exit.USAGE
        elif isinstance(error, click.UsageError):
            more = "" if error.ctx is None else f"; {error.ctx.command_path} --help lists all"
            line, code = error.format_message().rstrip(".?") + more, Exit.USAGE
    if os.environ.get(TRACEBACK) == "1":
        remark("".join(traceback.format_exception(cause)))
    complain(line)
    return code
