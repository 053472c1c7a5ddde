"""Each command out of its verb: what a function takes, its command takes.

A positional parameter is an argument, a keyword an option; its help is what the docstring says of
it, and a verb that reads logs has an option for each field of `Settings` and `Profile`. A verb's
module says by `answer` what is printed, and how the command ends.
"""

from __future__ import annotations

import inspect
import math
import shlex
import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, Literal, get_origin

import typer
from typer.core import TyperCommand

from algid.api.signature import Keyword, head, keywords, kind_of, summary
from algid.base.errors import SettingError
from algid.base.exits import epilog
from algid.base.text import lines_of
from algid.cli.output import complain, shown
from algid.options import ADVANCED, BY_SET, EVERYDAY, VALUES, Option, flag

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
LETTERS = {"quiet": "-q", "verbose": "-v", "help": "-h"}


class Command(TyperCommand):
    """A command whose help has a line an option, and whose numbers are finite."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Show arguments and options by panel."""
        panels: dict[str, list[tuple[str, str]]] = {"Arguments": [], EVERYDAY: [], ADVANCED: []}
        for one in self.get_params(ctx):
            panel = getattr(one, "rich_help_panel", None) or EVERYDAY
            if one.param_type_name == "argument":
                dots = "..." if one.nargs == -1 else ""
                panels["Arguments"].append((f"{one.metavar}{dots}", getattr(one, "help", "")))
                continue
            names = sorted((*one.opts, *one.secondary_opts), key=len)
            metavar = getattr(one, "metavar", None)
            words = ", ".join(names) + (f" {metavar}" if metavar else "")
            if one.name == "help":
                panel = ADVANCED
            panels[panel].append((words, getattr(one, "help", "") or ""))
        for panel, rows in panels.items():
            if rows:
                with formatter.section(panel):
                    formatter.write_dl(rows)

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


def listed(name: str) -> str:
    """The first sentence of a command's help, without loading what it needs."""
    spec = find_spec(f"algid.api.{name}")
    text = spec.loader.get_source(spec.name) if spec is not None else ""  # type: ignore[union-attr]
    return summary(text, COMMANDS[name])


def add(app: typer.Typer, name: str) -> None:
    """Give the application a command."""
    module = import_module(f"algid.api.{name}")
    verb = getattr(module, COMMANDS[name])
    *told, example = head(verb)
    lines = lines_of(example, 76, rest="  ")
    text = "\n\n".join((*told, "\b\n" + "\n".join(lines)))
    app.command(name, cls=Command, help=text, epilog=epilog(name))(_command(name, module, verb))


def _command(name: str, module: Any, verb: Callable[..., Any]) -> Callable[..., None]:
    own = dict(keywords(verb))
    takes = inspect.signature(verb).parameters
    rest = [one for one in takes.values() if one.kind is one.VAR_KEYWORD]
    declared = [_declared(one) for one in own.values() if one.name not in BY_SET]
    if rest:
        declared += _of_models("Unpack[Options]" in str(rest[0].annotation))
    if rest or any(name in BY_SET for name in own):
        declared.append(_set(own, bool(rest)))
    if name in PRINTED:
        kind = Literal["table", "json"]
        declared.append(_option("format", kind, "table", "What to print.", ADVANCED))
    if name == "identify":
        declared.append(_option("verbose", bool, False, "All tables, logs, settings.", ADVANCED))
    declared.append(_option("quiet", bool, False, "Print nothing but errors.", ADVANCED))

    def run(**typed: Any) -> None:
        from algid.base.runtime import keep_freed
        from algid.report.progress import progress

        keep_freed()
        form, quiet = typed.pop("format", "table"), typed.pop("quiet")
        verbose = typed.pop("verbose", False)
        for one in own.values():
            if one.kind is bool and one.default is True:
                typed[one.name] = not typed[one.name]
        given = {key: value for key, value in typed.items() if value not in (None, [])}
        for line in given.pop("set", []):
            take(given, line, own, bool(rest))
        given = getattr(module, "typed", dict)(given)
        callers: dict[str, Any] = {"command": shlex.join(["algid", *sys.argv[1:]])}
        callers["complain"] = complain
        several = [one.name for one in takes.values() if one.kind is one.VAR_POSITIONAL]
        by_name = {key: value for key, value in given.items() if key not in several}
        inline = [value for name in several for value in given[name]]
        with progress(getattr(module, "UNIT", "samples"), quiet) as bar:
            callers["progress"] = bar
            called = {key: value for key, value in callers.items() if key in takes}
            value = verb(*inline, **by_name, **called)
        made = module.answer(value, given)
        answers = made if isinstance(made, list) else [made]
        for one in answers:
            shown(one, form == "json", quiet, verbose)
        ended = max(one.exit for one in answers)
        if ended:
            raise typer.Exit(ended)

    run.__signature__ = inspect.Signature(declared)  # type: ignore[attr-defined]
    run.__annotations__ = {one.name: one.annotation for one in declared}
    return run


def _declared(one: Keyword) -> inspect.Parameter:
    """A verb's parameter as typer takes it."""
    if (one.default is inspect.Parameter.empty and not one.option.flags) or (
        one.place is inspect.Parameter.VAR_POSITIONAL
    ):
        return _argument(one, ...)
    if one.place is inspect.Parameter.POSITIONAL_OR_KEYWORD and one.name in ("logs", "topic"):
        return _argument(one, None)
    default = ... if one.default is inspect.Parameter.empty else one.default
    if default is False and one.kind is not bool:  # a choice stands for True
        default = None
    return _option(one.name, one.kind, default, one.help, one.option.panel, one.option)


def _argument(one: Keyword, default: Any) -> inspect.Parameter:
    many = get_origin(one.kind) is list
    declared = typer.Argument(
        help=one.help,
        autocompletion=one.option.complete,
        metavar=one.name.upper().removesuffix("S") if many else one.name.upper(),
        show_default=False,
    )
    kind = one.kind if default is ... else one.kind | None
    return _parameter(one.name, Annotated[kind, declared], default)


def _option(
    name: str, kind: Any, default: Any, text: str, panel: str, option: Option | None = None
) -> inspect.Parameter:
    option = option or Option()
    names = option.flags or (flag(name),)
    if name in LETTERS:
        names = (LETTERS[name], *names)
    if kind is bool and default is True:  # what is given switches it off
        names, default = (flag(name, off=True),), False
    low, high = option.range or (None, None)
    declared = typer.Option(
        *names,
        help=text,
        min=low,
        max=high,
        rich_help_panel=panel,
        autocompletion=option.complete,
        metavar=None if kind is bool else _metavar(name, kind),
        show_default=False,
    )
    wanted = kind | None if default is None else kind
    return _parameter(name, Annotated[wanted, declared], default)


def _parameter(name: str, annotation: Any, default: Any) -> inspect.Parameter:
    default = inspect.Parameter.empty if default is ... else default
    return inspect.Parameter(
        name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation
    )


def _metavar(name: str, kind: Any) -> str:
    """What stands for a value in help."""
    if name in VALUES:
        value = VALUES[name]
        return value if isinstance(value, str) else ",".join(value)
    if get_origin(kind) is Literal:
        return "WORD"
    known = {Path: "PATH", list[Path]: "PATH", float: "X", int: "N"}
    return known.get(kind, "TEXT")


def _of_models(with_settings: bool) -> list[inspect.Parameter]:
    """An option for each field of `Profile`, and of `Settings`, that has a flag."""
    from algid.api.words import COMPLETED, of_profile
    from algid.base.units import names_of
    from algid.profile import ALL_CHANNELS, Profile
    from algid.settings import OF_BOTH, Settings

    units = {
        "angle_unit": ", ".join(names_of("angle")),
        "torque_unit": "N m, mN m, A, mA, lbf in, …",
    }
    declared = []
    for name, text in units.items():
        option = Option(complete=of_profile(name))
        declared.append(_option(name, str, None, f"{text}.", EVERYDAY, option))
    for name, one in Profile.model_fields.items():
        if name in BY_SET or name in ALL_CHANNELS or name == "velocity":
            continue
        if with_settings and name in OF_BOTH:
            continue
        kind = Path if name == "torque_file" else str
        option = Option(complete=COMPLETED.get(name) or of_profile(name))
        panel = _panel(one)
        declared.append(_option(name, kind, None, one.description or "", panel, option))
    for name, one in Settings.model_fields.items() if with_settings else ():
        if name not in BY_SET:
            kind, panel = kind_of(one.annotation), _panel(one)
            default = False if kind is bool else None
            option = Option(complete=COMPLETED.get(name))
            declared.append(_option(name, kind, default, one.description or "", panel, option))
    return declared


def _panel(field: Any) -> str:
    return (field.json_schema_extra or {}).get("panel") or ADVANCED


def _set(own: Mapping[str, Keyword], of_logs: bool) -> inspect.Parameter:
    """The option that sets whatever has no flag."""
    from algid.api.words import COMPLETED

    names = [name for name in own if name in BY_SET]

    def complete(incomplete: str) -> list[str]:
        mine = [f"{name}=" for name in names if name.startswith(incomplete)]
        return mine + (COMPLETED["set"](incomplete) if of_logs else [])

    text = "Any other setting, as tau1.sign=-1; may be repeated."
    if not of_logs:
        text = f"NAME=VALUE of {', '.join(names)}."
    return _option("set", list[str], None, text, ADVANCED, Option(complete=complete))


def take(given: dict[str, Any], line: str, own: Mapping[str, Keyword], of_logs: bool) -> None:
    """Put one ``NAME=VALUE`` among what is given."""
    from algid.api.options import refuse_unknown, setting_of

    setting = setting_of(line)
    if not of_logs:
        refuse_unknown(setting, [name for name in own if name in BY_SET])
    for name, value in setting.items():
        if isinstance(value, Mapping) and isinstance(given.get(name), Mapping):
            value = {**given[name], **value}
        given[name] = value
