"""What a verb's signature and docstring say of each keyword: its type, its bounds, its help.

The command line and the guide are made from it, and the verb checks its values by it.
"""

from __future__ import annotations

import builtins
import inspect
import math
import re
import sys
import types
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache, wraps
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from algid.base.errors import SettingError
from algid.moved import refuse_moved_keywords
from algid.options import ADVANCED, BY_SET, Option, flag

CALLERS = ("settings", "progress", "complain", "command", "sensors", "labels")
"""Keywords that no command line has."""
EMPTY = inspect.Parameter.empty
Verb = TypeVar("Verb", bound=Callable[..., Any])


@dataclass(frozen=True)
class Keyword:
    """A parameter of a verb, or a field of `Settings` or `Profile`.

    Parameters
    ----------
    name : str
    hint : its annotation
    default : object
        `EMPTY` where it must be given.
    help : str
        The first sentence of its entry in the docstring, or the field's description.
    option : Option
    place : an `inspect` kind of parameter
    by_set : bool
        Whether it has no flag of its own.
    """

    name: str
    hint: Any
    default: Any
    help: str
    option: Option
    place: Any = inspect.Parameter.KEYWORD_ONLY
    by_set: bool = False

    @property
    def kind(self) -> Any:
        """What a command line takes: text where Python takes several forms."""
        if self.option.kind is not None:
            return self.option.kind
        parts = [part for part in _parts(self.hint) if not isinstance(part, Option)]
        if Path in parts:
            return Path
        return parts[0] if len(parts) == 1 and get_origin(parts[0]) is None else str

    @property
    def words(self) -> list[str]:
        """The words that it may be; none where that is the user's own."""
        if self.option.words is not None:
            return self.option.words()
        return words_of(self.hint)

    @property
    def or_file(self) -> bool:
        """Whether it may be the path of a file too."""
        return Path in _parts(self.hint)

    @property
    def flag(self) -> str:
        """How it is typed."""
        return self.option.flag or flag(self.name, off=self.default is True)


class _Names(dict[str, Any]):
    """A module's names; what is imported for type checkers alone is typed as a path."""

    def __missing__(self, name: str) -> Any:
        return vars(builtins).get(name, Path)


@cache
def keywords(verb: Callable[..., Any]) -> Mapping[str, Keyword]:
    """The parameters of a verb that a command line has, by name, without ``**options``."""
    module = vars(sys.modules[verb.__module__])
    names = _Names(module)
    helps = _described(verb)
    found = {}
    for one in inspect.signature(verb).parameters.values():
        if one.name in CALLERS or one.kind is one.VAR_KEYWORD:
            continue
        hint = eval(one.annotation, module, names)  # our own source
        option = next((part for part in _parts(hint) if isinstance(part, Option)), Option())
        default = one.default
        if default is None and option.default is not None:
            default = option.default
        text, by_set = helps.get(one.name, ""), one.name in BY_SET
        found[one.name] = Keyword(one.name, hint, default, text, option, one.kind, by_set)
    return found


def fields(model: Any, kind: Any = None, of: str = "") -> list[Keyword]:
    """The fields of `Settings` or `Profile`, and `of` a channel; `kind` is what is typed."""
    found = []
    for name, one in model.model_fields.items():
        if hasattr(one.annotation, "model_fields"):
            found += fields(one.annotation, kind, f"{name}.")
            continue
        panel = (one.json_schema_extra or {}).get("panel") or ADVANCED
        option = next((part for part in one.metadata if isinstance(part, Option)), Option(kind))
        keyword = Keyword(
            of + name,
            one.annotation,
            False if one.annotation is bool and kind is None else None,
            one.description or "",
            replace(option, panel=panel),
            by_set=bool(of) or name in BY_SET,
        )
        found.append(keyword)
    return found


def verb(function: Verb) -> Verb:
    """A function whose keywords are refused where they are none that it takes.

    A number is out of its bounds, a word none of those that are known, a name has moved.
    """

    @wraps(function)
    def called(*args: Any, **given: Any) -> Any:
        refuse_moved_keywords(function.__name__, given)
        said = inspect.signature(function).bind(*args, **given).arguments
        for name, one in keywords(function).items():
            refuse(one, said.get(name))
        return function(*args, **given)

    return called  # type: ignore[return-value]  # it takes and gives the same


def refuse(one: Keyword, value: Any) -> None:
    """Raise `SettingError` at a number or a word that a keyword does not take."""
    if value is None or isinstance(value, bool):
        return
    words = words_of(one.hint)
    if words and value not in words:
        expected = f"expected one of {', '.join(words)}"
        raise SettingError(f"{one.flag}: {expected}, found {value!r:.60}")
    if one.option.range is not None:
        low, high = one.option.range
        finite = isinstance(value, int | float) and math.isfinite(value)
        if not (finite and low <= value <= high):
            expected = f"expected a number from {low:g} to {high:g}"
            raise SettingError(f"{one.flag}: {expected}, found {value!r:.60}")


def refuse_unknown(options: Iterable[str], known: Iterable[str]) -> None:
    """Raise `SettingError` at a name that is none of the known ones."""
    from difflib import get_close_matches

    names = list(dict.fromkeys(known))
    for name in options:
        if name not in names:
            mend = f"known are {', '.join(names)}"
            for near in get_close_matches(name, names, n=1):
                mend = f"did you mean {near}?"
            raise SettingError(f"{name}: no setting has this name; {mend}")


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


def words_of(hint: Any) -> list[str]:
    """The words that a type states, anywhere in it."""
    if get_origin(hint) is Literal:
        return [str(word) for word in get_args(hint)]
    if hint is bool:
        return []
    return list(dict.fromkeys(word for part in get_args(hint) for word in words_of(part)))
