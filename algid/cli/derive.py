"""Each command out of its verb: what a function takes, its command takes.

A positional parameter is an argument, a keyword an option; its help is what the docstring says of
it, and a verb that reads logs has an option for each field of `Settings` and `Profile`. A verb's
module says by `answer` what is printed, and how the command ends.
"""

from __future__ import annotations

import inspect
import re
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin

import click
from click.shell_completion import CompletionItem

from algid import api
from algid.api.signature import EMPTY, described, options_of
from algid.base.exits import epilog
from algid.base.text import lines_of
from algid.cli.output import complain, progress, shown
from algid.options import ADVANCED, ARGUMENTS, EVERYDAY, VALUES, Option

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
LETTERS = {"out": "-o", "quiet": "-q", "verbose": "-v"}
HELP = Option(panel=ADVANCED)
"""Of the option that click adds."""


class Command(click.Command):
    """A command whose help has a line an option, by panel."""

    taken: Mapping[str, Option]

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write arguments and options."""
        panels: dict[str, list[tuple[str, str]]] = {ARGUMENTS: [], EVERYDAY: [], ADVANCED: []}
        for one in self.get_params(ctx):
            known = self.taken.get(str(one.name), HELP)
            label, text = one.get_help_record(ctx) or (str(one.metavar), "")
            panels[known.panel].append((label, text or known.help))
        for panel, rows in panels.items():
            if rows:
                with formatter.section(panel):
                    formatter.write_dl(rows)


def listed(name: str) -> str:
    """The first sentence of a command's docstring, without loading what it needs."""
    text = (Path(api.__path__[0]) / f"{name}.py").read_text(encoding="utf-8")
    found = re.search(rf'^def {COMMANDS[name]}\(.*?"""(.+?)(?:\n\n|""")', text, re.M | re.S)
    return " ".join(found[1].split()) if found else ""


def every_command(
    *,
    format: Annotated[Any, Option(click.Choice(["table", "json"]))] = "table",  # noqa: A002
    verbose: bool = False,
    quiet: bool = False,
) -> None:
    """Take what a command takes beside its verb's keywords.

    Parameters
    ----------
    format : str
        What to print.
    verbose : bool
        All tables, logs, settings.
    quiet : bool
        Print nothing but errors.
    """


def command(name: str) -> Command:
    """The command that calls a verb."""
    module = import_module(f"algid.api.{name}")
    verb = getattr(module, COMMANDS[name])
    parameters, of_logs = inspect.signature(verb).parameters, _of_logs(verb)
    every = [*options_of(verb).values(), *of_logs.values()]
    by_set = [one for one in every if one.by_set]
    taken = [one for one in every if not one.by_set]
    if by_set:
        lines = [f"{one.name}={word}" for one in by_set for word in one.words or [""]]
        text = f"NAME=VALUE of {', '.join(one.name for one in by_set)}."
        if of_logs:
            text = "Any other setting, as tau1.sign=-1; may be repeated."
        several = Option(list[str], panel=ADVANCED, suggested=lambda: lines, name="set", help=text)
        taken.append(several)
    own = dict(options_of(every_command))
    if name not in PRINTED:
        del own["format"]
    if name != "identify":
        del own["verbose"]
    taken += (replace(one, panel=ADVANCED) for one in own.values())
    settable = [one.name.partition(".")[0] for one in (*of_logs.values(), *by_set)]

    def run(
        quiet: bool,
        verbose: bool = False,
        set: Sequence[str] = (),  # noqa: A002
        **typed: Any,
    ) -> None:
        """Call the verb with what is typed, print its answer, and end with its exit code."""
        from algid.api.options import set_by
        from algid.base.runtime import keep_freed

        keep_freed()
        as_json = name in PRINTED and typed.pop("format") == "json"
        given = {key: value for key, value in typed.items() if value not in (None, ())}
        given = getattr(module, "typed", dict)(given | set_by(set, settable))
        arguments = [one.name for one in taken if one.argument]
        callers = {"command": shlex.join(["algid", *sys.argv[1:]]), "complain": complain}
        with progress(getattr(module, "UNIT", "samples"), quiet) as bar:
            callers["progress"] = bar
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
    many, off = get_origin(one.kind) is list, one.default is True
    kind, name = get_args(one.kind)[0] if many else one.kind, one.name.upper()
    value = VALUES.get(one.name, {Path: "PATH", float: "X", int: "N"}.get(kind, "TEXT"))
    value = "WORD" if one.words or isinstance(kind, click.Choice) else value
    said: dict[str, Any] = {
        "type": click.Path(path_type=Path) if kind is Path else kind,
        "metavar": value if isinstance(value, str) else ",".join(value),
        "required": one.default is EMPTY,
        "shell_complete": _completion(one) if one.suggested or one.words else None,
    }
    if not many and one.default not in (EMPTY, None, False):
        said["default"] = one.default
    if one.argument:
        said["metavar"] = f"{name.removesuffix('S')}..." if many else name
        return click.Argument([one.name], nargs=-1 if many else 1, **said)
    if kind is bool:  # what is given switches it off
        said = {"flag_value": not off, "default": off, "is_flag": True}
    names = [one.flag if one.flag.startswith("--") else f"--{one.name}", one.name]
    if one.name in LETTERS:
        names.insert(0, LETTERS[one.name])
    return click.Option(names, help=one.help, multiple=many, **said)


def _completion(one: Option) -> Callable[..., list[CompletionItem]]:
    """Completes the last of several words, separated by commas and each used once; else a file."""

    def complete(_ctx: object, _parameter: object, incomplete: str) -> list[CompletionItem]:
        before, comma, last = incomplete.rpartition(",")
        found = [
            CompletionItem(before + comma + word)
            for word in (one.suggested() if one.suggested else one.words)
            if word.startswith(last) and word not in before.split(",")
        ]
        return found or [CompletionItem(incomplete, type="file")]

    return complete


def _of_logs(verb: Callable[..., Any]) -> dict[str, Option]:
    """The fields of `Profile`, and of `Settings`, of a verb that takes them as ``**options``."""
    *_, last = inspect.signature(verb).parameters.values()
    if last.kind is not last.VAR_KEYWORD:
        return {}
    from algid.api import options
    from algid.profile import Profile
    from algid.settings import Settings

    taken = vars(options)[last.annotation.removeprefix("Unpack[")[:-1]].__annotations__
    every = {**options_of(Profile), **options_of(Settings)}
    return {name: one for name, one in every.items() if name.partition(".")[0] in taken}
