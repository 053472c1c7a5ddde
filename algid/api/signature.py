"""What a verb's signature and docstring say of each keyword: its type, its bounds, its help.

The command line and the guide are made from it, and the verb checks its values by it.
"""

from __future__ import annotations

import builtins
import inspect
import re
import sys
from collections import ChainMap, defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cache, wraps
from itertools import chain
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args, get_origin

from algid.base.errors import SettingError
from algid.base.files import misfit
from algid.moved import refuse_moved_keywords
from algid.options import (
    ADVANCED,
    ARGUMENTS,
    EVERYDAY,
    EVERYDAY_FIELDS,
    SELDOM,
    TYPED,
    Option,
)

CALLERS = ("settings", "progress", "complain", "command", "sensors", "labels")
"""Keywords that no command line has."""
EMPTY = inspect.Parameter.empty
Verb = TypeVar("Verb", bound=Callable[..., Any])


@cache
def options_of(taker: Callable[..., Any], of: str = "") -> Mapping[str, Option]:
    """What a verb, `Settings` or `Profile` takes that a command line has, by name.

    Of ``**options`` nothing is said; `of` is a channel, whose fields are the profile's.
    """
    # what is imported for type checkers alone is typed as a path
    module = vars(sys.modules[taker.__module__])
    names = ChainMap(module, vars(builtins), defaultdict[str, Any](lambda: Path))
    helps, found = described(taker)[1], dict[str, Option]()
    is_model = hasattr(taker, "model_fields")
    for own, one in inspect.signature(taker).parameters.items():
        if own in CALLERS or one.kind is one.VAR_KEYWORD:
            continue
        hint, name = one.annotation, of + own
        if isinstance(hint, str):
            hint = eval(hint, module, names)  # our own source
        if hasattr(hint, "model_fields"):
            found |= options_of(hint, f"{name}.")
            continue
        parts = list(_parts(hint))
        stated = next((part for part in parts if isinstance(part, Option)), Option())
        literals = (get_args(part) for part in parts if get_origin(part) is Literal)
        words = list(dict.fromkeys(map(str, chain.from_iterable(literals))))
        kinds, kind = {part for part in parts if isinstance(part, type)}, stated.kind
        if kind is None:  # text where Python takes several forms
            kind = Path if Path in kinds else str
            if len(kinds) == 1 and not words:
                (kind,) = kinds
        panel, default = EVERYDAY, stated.default if one.default is None else one.default
        argument = one.kind is not one.KEYWORD_ONLY and name not in TYPED
        if name in SELDOM or (is_model and name not in EVERYDAY_FIELDS):
            panel = ADVANCED
        if is_model:  # a field that is not typed is not said
            default = False if kind is bool else None
        found[name] = replace(
            stated,
            name=name,
            kind=kind,
            default=default,
            panel=ARGUMENTS if argument else panel,
            help=helps.get(own) or f"{', '.join(words)}.",
            words=words,
            check=stated.check or (Literal[*words] if words else None),
        )
    return found


def _parts(hint: Any) -> Iterator[Any]:
    """All that a type is made of."""
    yield hint
    for part in get_args(hint):
        if part is not type(None):
            yield from _parts(part)


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
                why = f"{misfit(error)[1]} ({one.help.rstrip('.')})"
                raise SettingError(f"{one.flag}: {why}") from None
        return function(*bound.args, **bound.kwargs)

    return called  # type: ignore[return-value]  # it takes and gives the same


def described(taker: Callable[..., Any]) -> tuple[list[str], dict[str, str]]:
    """What a docstring says: paragraphs, the example of a command the last, and of each parameter.

    Of a parameter that is the first sentence.
    """
    above, *rest = re.split(r"\n\n([A-Z]\w+)\n-+\n", inspect.cleandoc(taker.__doc__ or ""))
    sections, helps = dict(zip(rest[::2], rest[1::2], strict=True)), dict[str, str]()
    for entry in re.split(r"\n(?=\S)", sections.get("Parameters", "")):
        names, _, body = entry.partition("\n")
        first = re.split(r"(?<=\.)\s", " ".join(body.split()))[0]
        for name in names.partition(" : ")[0].split(", "):
            helps[name.strip("*")] = first
    example = sections.get("Examples", "").partition("\n\n")[0].replace("$", "Example:")
    return [" ".join(one.split()) for one in (*above.split("\n\n"), example)], helps
