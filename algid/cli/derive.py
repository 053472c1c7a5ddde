"""Each command out of its verb: what a function takes, its command takes.

A positional parameter is an argument, a keyword an option; its help is what the docstring says of
it, and a verb that reads logs has an option for each field of `Settings` and `Profile`. A verb's
module says by `answer` what is printed, and how the command ends.
"""

from __future__ import annotations

import inspect
import shlex
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import click
from click.shell_completion import CompletionItem

from algid.api.signature import (
    EMPTY,
    Keyword,
    fields,
    head,
    keywords,
    refuse,
    refuse_unknown,
    summary,
    words_of,
)
from algid.base.exits import epilog
from algid.base.text import lines_of
from algid.cli.output import complain, shown
from algid.options import ADVANCED, EVERYDAY, VALUES, Option

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
ARGUMENTS = "Arguments"


class Command(click.Command):
    """A command whose help has a line an option, by panel."""

    def __init__(self, name: str, taken: list[Keyword], **options: Any) -> None:
        super().__init__(name, params=[_parameter(one) for one in taken], **options)
        self.taken = {one.name: one for one in taken}

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write arguments and options."""
        rows: dict[str, list[tuple[str, str]]] = {ARGUMENTS: [], EVERYDAY: [], ADVANCED: []}
        for one in self.get_params(ctx):
            known = self.taken.get(one.name or "")
            if isinstance(one, click.Argument) and known is not None:
                rows[ARGUMENTS].append((str(one.metavar), known.help))
            else:
                panel = ADVANCED if known is None else known.option.panel  # help is none of ours
                rows[panel].append(one.get_help_record(ctx) or ("", ""))
        for panel, entries in rows.items():
            if entries:
                with formatter.section(panel):
                    formatter.write_dl(entries)


def listed(name: str) -> str:
    """The first sentence of a command's help, without loading what it needs."""
    spec = find_spec(f"algid.api.{name}")
    text = spec.loader.get_source(spec.name) if spec is not None else ""  # type: ignore[union-attr]
    return summary(text, COMMANDS[name])


def command(name: str) -> Command:
    """The command that calls a verb."""
    module = import_module(f"algid.api.{name}")
    verb = getattr(module, COMMANDS[name])
    of_logs = _of_logs(verb)
    every = [*keywords(verb).values(), *of_logs]
    by_set = [one for one in every if one.by_set]
    taken = list({one.name: one for one in every if not one.by_set}.values())
    if by_set:
        text = f"NAME=VALUE of {', '.join(one.name for one in by_set)}."
        if of_logs:
            text = "Any other setting, as tau1.sign=-1; may be repeated."
        words = Option(list[str], panel=ADVANCED, words=lambda: _lines(by_set))
        taken.append(Keyword("set", str, None, text, words))
    if name in PRINTED:
        taken.append(_of_command("format", Literal["table", "json"], "table", "What to print."))
    if name == "identify":
        taken.append(_of_command("verbose", bool, False, "All tables, logs, settings."))
    taken.append(_of_command("quiet", bool, False, "Print nothing but errors."))

    def run(**typed: Any) -> None:
        for one in taken:
            if one.name == "format" and name in PRINTED:
                refuse(one, typed["format"])
        known = None if of_logs else [one.name for one in by_set]
        click.get_current_context().exit(_run(module, verb, typed, known))

    *above, example = head(verb)
    text = "\n\n".join((*above, "\b\n" + "\n".join(lines_of(example, 76, rest="  "))))
    return Command(name, taken, help=text, epilog=epilog(name), callback=run)


def _run(module: Any, verb: Callable[..., Any], typed: dict[str, Any], known: Any) -> int:
    """Call a verb with what is typed, print its answer, and return the exit code.

    `known` are the names that ``--set`` takes; None where it takes every setting of a log.
    """
    from algid.base.runtime import keep_freed
    from algid.report.progress import progress

    keep_freed()
    quiet, verbose = typed.pop("quiet"), typed.pop("verbose", False)
    given = {key: value for key, value in typed.items() if value not in (None, ())}
    for line in given.pop("set", ()):
        take(given, line, known)
    as_json = module.__name__.rpartition(".")[2] in PRINTED and given.pop("format") == "json"
    given = getattr(module, "typed", dict)(given)
    parameters = inspect.signature(verb).parameters
    several = [one.name for one in parameters.values() if one.kind is one.VAR_POSITIONAL]
    callers = {"command": shlex.join(["algid", *sys.argv[1:]]), "complain": complain}
    with progress(getattr(module, "UNIT", "samples"), quiet) as bar:
        callers["progress"] = bar
        called = {key: value for key, value in given.items() if key not in several}
        called |= {key: value for key, value in callers.items() if key in parameters}
        value = verb(*(one for key in several for one in given[key]), **called)
    made = module.answer(value, given)
    answers = made if isinstance(made, list) else [made]
    for one in answers:
        shown(one, as_json, quiet, verbose)
    return max(one.exit for one in answers)


def take(given: dict[str, Any], line: str, known: list[str] | None) -> None:
    """Put one ``NAME=VALUE`` among what is given."""
    from algid.api.options import setting_of

    setting = setting_of(line)
    if known is not None:
        refuse_unknown(setting, known)
    for name, value in setting.items():
        if isinstance(value, Mapping) and isinstance(given.get(name), Mapping):
            value = {**given[name], **value}
        given[name] = value


def _parameter(one: Keyword) -> click.Parameter:
    """A keyword as click takes it."""
    many = get_origin(one.kind) is list
    kind = get_args(one.kind)[0] if many else one.kind
    text: dict[str, Any] = {
        "type": click.Path(path_type=Path) if kind is Path else kind,
        "required": one.default is EMPTY,
        "shell_complete": _completion(one) if one.option.words or words_of(one.hint) else None,
    }
    if not many and one.default not in (EMPTY, None, False):
        text["default"] = one.default
    if one.place is not inspect.Parameter.KEYWORD_ONLY and one.option.flag is None:
        name = one.name.upper()
        metavar = f"{name.removesuffix('S')}..." if many else name
        return click.Argument([one.name], metavar=metavar, nargs=-1 if many else 1, **text)
    names = [LETTERS[one.name]] if one.name in LETTERS else []
    names += [one.flag if one.flag.startswith("--") else f"--{one.name}", one.name]
    if kind is bool:
        off = one.default is True  # what is given switches it off
        return click.Option(names, help=one.help, flag_value=not off, default=off, is_flag=True)
    metavar = _metavar(one, kind)
    return click.Option(names, help=one.help, metavar=metavar, multiple=many, **text)


def _completion(one: Keyword) -> Callable[..., list[CompletionItem]]:
    """Completes the last of several words, separated by commas and each used once."""

    def complete(_ctx: object, _parameter: object, incomplete: str) -> list[CompletionItem]:
        before, comma, last = incomplete.rpartition(",")
        used = before.split(",")
        found = [word for word in one.words if word.startswith(last) and word not in used]
        files = [CompletionItem(incomplete, type="file")] if one.or_file else []
        return files + [CompletionItem(before + comma + word) for word in found]

    return complete


def _metavar(one: Keyword, kind: Any) -> str:
    """What stands for a value in help."""
    if one.name in VALUES:
        value = VALUES[one.name]
        return value if isinstance(value, str) else ",".join(value)
    if words_of(one.hint):
        return "WORD"
    return {Path: "PATH", float: "X", int: "N"}.get(kind, "TEXT")


def _of_command(name: str, hint: Any, default: Any, text: str) -> Keyword:
    return Keyword(name, hint, default, text, Option(panel=ADVANCED))


def _of_logs(verb: Callable[..., Any]) -> list[Keyword]:
    """The fields of `Profile`, and of `Settings`, of a verb that takes them as ``**options``."""
    *_, last = inspect.signature(verb).parameters.values()
    if "Options" not in str(last.annotation):
        return []
    from algid.profile import Profile
    from algid.settings import OF_PRIOR, Settings

    found = []
    for one in fields(Profile, str):
        # what an arm is said to be is no log's, and its velocity is true or false here
        behind = one.by_set or one.hint is bool or one.name in OF_PRIOR
        found.append(replace(one, by_set=behind))
    if "Unpack[Options]" in str(last.annotation):
        found += fields(Settings)
    return found


def _lines(by_set: list[Keyword]) -> list[str]:
    """What ``--set`` takes: a line a word, or ``NAME=``."""
    lines = []
    for one in by_set:
        words = ["true", "false"] if one.hint is bool else words_of(one.hint)
        lines += [f"{one.name}={word}" for word in words] or [f"{one.name}="]
    return lines
