"""JSON messages: parsed one by one, since their numbers stand at no fixed place."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from algid.base.limits import LIMITS
from algid.base.words import counted, repeated
from algid.readers.messages.batch import Messages
from algid.readers.messages.columnar import Decoder, Fields, MisfitError, Numbers, Shape
from algid.readers.stated import BAD, GOOD, GROUPS

_BEYOND = 2**1024 - 2**970
"""From here on an integer rounds to more than the largest float64."""


def walk(payload: bytes) -> Shape:
    """The shape of one message: the paths of its numbers and lists of strings, without places.

    Raises
    ------
    MisfitError
        If the message is no JSON object.
    """
    shape = Shape()
    _walk(_object(payload, _once), "", shape)
    return shape


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object whose names stand there once; of two alike the parser takes the last."""
    content = dict(pairs)
    if len(content) < len(pairs):
        twice = repeated(name for name, _ in pairs)
        raise MisfitError(f"a JSON message that names {twice[0][:80]!r} twice")
    return content


def _object(
    payload: bytes, pairs: Callable[[list[tuple[str, Any]]], dict[str, Any]] | None = None
) -> dict[str, Any]:
    if len(payload) > LIMITS.json_bytes:
        raise MisfitError(
            f"a JSON message of {counted(len(payload), 'byte')}; expected {LIMITS.json_bytes} at "
            "most"
        )
    try:
        content = json.loads(payload, object_pairs_hook=pairs)
    except (ValueError, RecursionError) as error:
        raise MisfitError(f"a message that is no JSON ({type(error).__name__})") from error
    if not isinstance(content, dict):
        raise MisfitError("a JSON message that is no object")
    return content


def _walk(value: Any, path: str, shape: Shape) -> None:
    shape.count()
    if isinstance(value, dict):
        for key, inner in value.items():
            _walk(inner, f"{path}.{key}" if path else str(key), shape)
    elif isinstance(value, list):
        if value and all(isinstance(one, str) for one in value):
            shape.texts[path] = tuple(value)
        for index, inner in enumerate(value):
            _walk(inner, f"{path}[{index}]", shape)
    elif isinstance(value, str):
        shape.labels[path] = value
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        shape.numbers[path] = Numbers(0, "json")


@dataclass
class JsonDecoder(Decoder):
    """The decoder of JSON messages."""

    def read(self, messages: Messages, held: NDArray[np.bool_]) -> Fields:
        """The numbers of the messages that hold what is wanted, by name.

        Notes in `held` (N,) which do.
        """
        paths = [(path, _PART.findall(path)) for path in self.wanted.values()]
        rows: list[list[Any]] = []
        for row, (start, size) in enumerate(zip(messages.starts, messages.sizes, strict=True)):
            payload = messages.content[start : start + size].tobytes()
            try:
                content = _object(payload)
            except MisfitError as error:
                self.misfitting(str(error))
                continue
            if flags := _flagged(content):
                self.without(flags)
                continue
            for place in (content, content.get("header")):
                if isinstance(place, dict):
                    for name in GROUPS & place.keys():
                        self.label(name, str(place[name]))
            found = _Paths(content)
            values = [found.value([path] if path in content else parts) for path, parts in paths]
            held[row] = None not in values
            if held[row]:
                rows.append(values)
            else:
                self._without(content, values)
        columns: Fields = {}
        for place, name in enumerate(self.wanted):
            columns[name] = _column([row[place] for row in rows])
        return columns

    def _without(self, found: dict[str, Any], values: list[int | float | None]) -> None:
        shape = Shape()
        try:
            _walk(found, "", shape)
        except MisfitError as error:
            self.misfitting(str(error))
            return
        lacks = (name for name, value in zip(self.wanted, values, strict=True) if value is None)
        self.without(() if shape.of_others(self.wanted.values()) else tuple(lacks))


def _flagged(content: dict[str, Any]) -> tuple[str, ...]:
    """What a message says by which it is no measurement."""
    bad = [name for name in GOOD & content.keys() if content[name] in (0, False)]
    return (*bad, *(name for name in BAD & content.keys() if content[name] not in (0, False)))


def _column(values: list[int | float]) -> NDArray[np.int64] | NDArray[np.float64]:
    """Numbers as int64 where all of them are whole and that small.

    Infinite where beyond float64.
    """
    if values and all(isinstance(value, int) and abs(value) < 2**63 for value in values):
        return np.array(values, np.int64)
    with suppress(OverflowError):
        return np.array(values, np.float64)
    numbers = np.empty(len(values))
    for place, value in enumerate(values):
        beyond = isinstance(value, int) and abs(value) >= _BEYOND
        numbers[place] = math.inf if beyond else value
    return numbers


_PART = re.compile(r"\[[^\]]*\]|[^.\[\]]+")


class _Paths:
    """Takes numbers out of one message by paths as in `Shape.find`."""

    def __init__(self, message: dict[str, Any]) -> None:
        self._message = message
        self._lists: dict[int, list[list[Any]]] = {}
        """Cache of adjacent lists by their object, which may have many other fields."""

    def value(self, parts: Sequence[str]) -> int | float | None:
        """The number at a path, or None."""
        inner: Any = self._message
        parent: Any = None
        for part in parts:
            if not part.startswith("["):
                parent, inner = inner, inner.get(part) if isinstance(inner, dict) else None
                continue
            name, index = part[1:-1], None
            if isinstance(parent, dict):
                names = self._list_with(name, parent)
                if names is not None:  # one that stands there twice has no place
                    index = names.index(name) if names.count(name) == 1 else len(names)
            if index is None and name.isdigit():
                index = int(name)
            inner = (
                inner[index]
                if isinstance(inner, list) and index is not None and index < len(inner)
                else None
            )
        return inner if isinstance(inner, (int, float)) and not isinstance(inner, bool) else None

    def _list_with(self, name: str, parent: dict[str, Any]) -> list[Any] | None:
        """The first list within `parent` that holds a name."""
        lists = self._lists.get(id(parent))
        if lists is None:
            lists = [one for one in parent.values() if isinstance(one, list)]
            self._lists[id(parent)] = lists
        for one in lists:
            if name in one:
                return one
        return None
