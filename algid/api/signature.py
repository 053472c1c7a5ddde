"""What a verb's signature and docstring say of each keyword: its type, its bounds, its help.

The command line and the guide are made from it, and the verb checks its numbers by it.
"""

from __future__ import annotations

import builtins
import inspect
import math
import re
import sys
import types
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from algid.base.errors import SettingError
from algid.options import Option, flag

CALLERS = ("settings", "progress", "complain", "command", "sensors", "labels", "cwd")
"""Keywords that no command line has."""


@dataclass(frozen=True)
class Keyword:
    """A parameter of a verb.

    Parameters
    ----------
    name : str
    kind : type
        What a command line takes: text where Python takes several forms.
    default : object
        `inspect.Parameter.empty` where it must be given.
    option : Option
    help : str
        The first sentence of its entry in the docstring.
    place : an `inspect` kind of parameter
    """

    name: str
    kind: Any
    default: Any
    option: Option
    help: str
    place: Any


class _Names(dict[str, Any]):
    """A module's names; what is imported for type checkers alone is typed as a path."""

    def __missing__(self, name: str) -> Any:
        return vars(builtins).get(name, Path)


@cache
def keywords(verb: Callable[..., Any]) -> Mapping[str, Keyword]:
    """The parameters of a verb that a command line has, by name, without ``**options``."""
    names = _Names(vars(sys.modules[verb.__module__]))
    helps = _described(verb)
    found = {}
    for one in inspect.signature(verb).parameters.values():
        if one.name in CALLERS or one.kind is one.VAR_KEYWORD:
            continue
        hint = eval(one.annotation, {}, names)  # our own source
        options = [part for part in _flattened(hint) if isinstance(part, Option)]
        option = options[0] if options else Option()
        kind = option.kind or kind_of(hint)
        default = one.default
        if one.default is None and option.default is not None:
            default = option.default
        help_text = helps.get(one.name, "")
        found[one.name] = Keyword(one.name, kind, default, option, help_text, one.kind)
    return found


def check(verb: Callable[..., Any], given: Mapping[str, Any]) -> None:
    """Refuse numbers that a verb cannot take; None stands for what is not given.

    Parameters
    ----------
    verb : callable
    given : mapping
        By name; ``locals()`` at the beginning of the verb.

    Raises
    ------
    SettingError
        If a number is out of its bounds, or a word none of those that are known.
    """
    for name, one in keywords(verb).items():
        value = given[name]
        if value is None:
            continue
        if get_origin(one.kind) is Literal and value not in (*get_args(one.kind), True, False):
            words = ", ".join(get_args(one.kind))
            typed = one.option.flags[-1] if one.option.flags else flag(name)
            raise SettingError(f"{typed}: expected one of {words}, found {value!r:.60}")
        if one.option.range is not None:
            low, high = one.option.range
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not (number and math.isfinite(value) and low <= value <= high):
                raise SettingError(
                    f"{flag(name)}: expected a number from {low:g} to {high:g}, found {value!r:.60}"
                )


def summary(text: str, name: str) -> str:
    """The first sentence of a function's docstring, out of its module's source."""
    found = re.search(rf'^def {name}\(.*?"""(.+?)(?:\n\n|""")', text, re.M | re.S)
    return " ".join(found[1].split()) if found else ""


def head(verb: Callable[..., Any]) -> list[str]:
    """The paragraphs of a docstring above its sections, and the example of its command."""
    text = inspect.cleandoc(verb.__doc__ or "")
    above = re.split(r"\n\n[A-Z]\w+\n-+\n", text)[0]
    paragraphs = [" ".join(one.split()) for one in above.split("\n\n")]
    example = re.search(r"^\$ (algid .*?)\n\n", f"{text}\n\n", re.M | re.S)
    if example:
        paragraphs.append(f"Example: {' '.join(example[1].split())}")
    return paragraphs


def _described(verb: Callable[..., Any]) -> dict[str, str]:
    """By parameter the first sentence of what the docstring says of it."""
    text = inspect.cleandoc(verb.__doc__ or "")
    found = re.search(r"Parameters\n-+\n(.*?)(?:\n\n[A-Z]\w+\n-+|\Z)", text, re.S)
    helps: dict[str, str] = {}
    for entry in re.split(r"\n(?=\S)", found[1] if found else ""):
        names, _, body = entry.partition("\n")
        first = re.split(r"(?<=\.)\s", " ".join(body.split()))[0]
        for name in names.partition(" : ")[0].split(", "):
            helps[name.strip("*")] = first
    return helps


def _flattened(hint: Any) -> Iterator[Any]:
    """The alternatives of a union, and what is said beside them."""
    if get_origin(hint) is Annotated:
        base, *beside = get_args(hint)
        yield from (one for one in beside if isinstance(one, Option))
        yield from _flattened(base)
    elif get_origin(hint) in (Union, types.UnionType):
        for part in get_args(hint):
            yield from _flattened(part)
    elif hint is not type(None):
        yield hint


def kind_of(hint: Any) -> Any:
    """What a command line takes of several types."""
    parts = [part for part in _flattened(hint) if not isinstance(part, Option)]
    for part in parts:
        if get_origin(part) is Literal or part is Path:
            return part
    return parts[0] if len(parts) == 1 else str
