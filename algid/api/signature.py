"""What a verb's signature and docstring say of each keyword: its type, its bounds, its help.

The command line and the guide are made from it, and the verb checks its values by it.
"""

from __future__ import annotations

import builtins
import inspect
import re
import sys
import types
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, wraps
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from algid.base.errors import SettingError
from algid.base.files import misfit
from algid.moved import refuse_moved_keywords
from algid.options import ADVANCED, ARGUMENTS, EVERYDAY, EVERYDAY_FIELDS, Option, flag

CALLERS = ("settings", "progress", "complain", "command", "sensors", "labels")
"""Keywords that no command line has."""
EMPTY = inspect.Parameter.empty
Verb = TypeVar("Verb", bound=Callable[..., Any])


class _Names(dict[str, Any]):
    """A module's names; what is imported for type checkers alone is typed as a path."""

    def __missing__(self, name: str) -> Any:
        return vars(builtins).get(name, Path)


@cache
def options_of(taker: Callable[..., Any], of: str = "") -> Mapping[str, Option]:
    """What a verb, `Settings` or `Profile` takes that a command line has, by name.

    Of ``**options`` nothing is said; `of` is a channel, whose fields are the profile's.
    """
    module, is_model = vars(sys.modules[taker.__module__]), hasattr(taker, "model_fields")
    helps, found = _described(taker), dict[str, Option]()
    for own, one in inspect.signature(taker).parameters.items():
        if own in CALLERS or one.kind is one.VAR_KEYWORD:
            continue
        hint, name = one.annotation, of + own
        if isinstance(hint, str):
            hint = eval(hint, module, _Names(module))  # our own source
        if hasattr(hint, "model_fields"):
            found |= options_of(hint, f"{name}.")
            continue
        parts, words = _parts(hint), _words(hint)
        stated = next((part for part in parts if isinstance(part, Option)), Option())
        kinds, kind = [part for part in parts if not isinstance(part, Option)], stated.kind
        if kind is None:  # text where Python takes several forms
            kind = kinds[0] if len(kinds) == 1 and get_origin(kinds[0]) is None else str
            kind = Path if Path in kinds else kind
        argument = one.kind is not one.KEYWORD_ONLY and not stated.flag
        panel, default = EVERYDAY, stated.default if one.default is None else one.default
        if is_model:  # a field that is not typed is not said
            panel = EVERYDAY if name in EVERYDAY_FIELDS else ADVANCED
            default = False if kind is bool else None
        found[name] = replace(
            stated,
            name=name,
            kind=kind,
            default=default,
            panel=ARGUMENTS if argument else stated.panel or panel,
            flag=stated.flag or flag(name, off=default is True),
            help=helps.get(own) or f"{', '.join(words)}.",
            words=words,
            check=stated.check or (Literal[*words] if words else None),
            argument=argument,
            or_file=Path in kinds,
        )
    return found


def verb(function: Verb) -> Verb:
    """A function that is called with what pydantic makes of its keywords.

    One that is out of its bounds, none of the words that are known, or of a name that has moved is
    refused.
    """

    @wraps(function)
    def called(*args: Any, **given: Any) -> Any:
        from pydantic import TypeAdapter, ValidationError

        refuse_moved_keywords(function.__name__, given)
        bound = inspect.signature(function).bind(*args, **given)
        for name, one in options_of(function).items():
            value = bound.arguments.get(name)
            if one.check is None or value is None or isinstance(value, bool):
                continue
            try:
                bound.arguments[name] = TypeAdapter(one.check).validate_python(value)
            except ValidationError as error:
                raise SettingError(f"{one.flag}: {misfit(error)[1]}") from None
        return function(*bound.args, **bound.kwargs)

    return called  # type: ignore[return-value]  # it takes and gives the same


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


def _parts(hint: Any) -> list[Any]:
    """The alternatives of a union, and what is said beside them."""
    if hint is type(None):
        return []
    if get_origin(hint) is Annotated:
        base, *beside = get_args(hint)
        return [*(one for one in beside if isinstance(one, Option)), *_parts(base)]
    if get_origin(hint) in (Union, types.UnionType):
        return [part for inner in get_args(hint) for part in _parts(inner)]
    return [hint]


def _words(hint: Any) -> list[str]:
    """The words that a type states, anywhere in it."""
    if get_origin(hint) is Literal:
        return [str(word) for word in get_args(hint)]
    return list(dict.fromkeys(word for part in get_args(hint) for word in _words(part)))
