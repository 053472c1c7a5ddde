"""JSON messages: parsed one by one, since their numbers stand at no fixed place."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from algid.base.limits import LIMITS
from algid.base.words import counted, repeated
from algid.readers.messages.layout import Columns, Decoder, MessageLayout, MisfitError, Numbers
from algid.readers.messages.message_file import Messages
from algid.readers.stated import BAD, GOOD, GROUPS

_PART = re.compile(r"\[[^\]]*\]|[^.\[\]]+")


def parse_layout(payload: bytes) -> MessageLayout:
    """The layout of one message: the paths of its numbers and lists of strings, without places.

    Raises
    ------
    MisfitError
        If the message is no JSON object.
    """
    layout = MessageLayout()
    _add(_object(payload, _unique), "", layout, 0)
    return layout


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object whose names stand there once: of two alike the parser takes the last."""
    for name in repeated(name for name, _ in pairs):
        raise MisfitError(f"a JSON message that names {name[:80]!r} twice")
    return dict(pairs)


def _object(payload: bytes, pairs: Any = None) -> dict[str, Any]:
    if len(payload) > LIMITS.message_bytes:
        raise MisfitError(f"a JSON message of {counted(len(payload), 'byte')}")
    try:
        content = json.loads(payload, object_pairs_hook=pairs)
    except (ValueError, RecursionError) as error:
        raise MisfitError(f"a message that is no JSON ({type(error).__name__})") from error
    if not isinstance(content, dict):
        raise MisfitError("a JSON message that is no object")
    return content


def _add(value: Any, path: str, layout: MessageLayout, depth: int) -> None:
    if depth > LIMITS.definition_depth:
        raise MisfitError("a JSON message nested too deep")
    if isinstance(value, dict):
        for key, inner in value.items():
            _add(inner, f"{path}.{key}" if path else str(key), layout, depth + 1)
    elif isinstance(value, list):
        if value and all(isinstance(one, str) for one in value):
            layout.texts[path] = tuple(value)
        for index, inner in enumerate(value):
            _add(inner, f"{path}[{index}]", layout, depth + 1)
    elif isinstance(value, str):
        layout.labels[path] = value
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        layout.numbers[path] = Numbers(0, "json")


@dataclass
class JsonDecoder(Decoder):
    """The decoder of JSON messages."""

    def columns(self, messages: Messages) -> tuple[NDArray[np.bool_], Columns]:
        """True for the messages (N,) that hold what is wanted; their numbers in file order."""
        held = np.zeros(len(messages), np.bool_)
        paths = [(path, _PART.findall(path)) for path in self.wanted.values()]
        rows: list[list[Any]] = []
        for row, (start, size) in enumerate(zip(messages.starts, messages.sizes, strict=True)):
            try:
                content = _object(messages.content[start : start + size].tobytes())
                bad = [name for name in GOOD & content.keys() if content[name] in (0, False)]
                bad += [name for name in BAD & content.keys() if content[name] not in (0, False)]
                if bad:  # the message says itself that it is no measurement
                    self.without(tuple(bad))
                    continue
                header = content.get("header")
                for place in (content, header if isinstance(header, dict) else {}):
                    for name in GROUPS & place.keys():
                        self.label(name, str(place[name]))
                values = [
                    _value(content, [path] if path in content else parts) for path, parts in paths
                ]
                if None not in values:
                    held[row] = True
                    rows.append(values)
                else:
                    layout = MessageLayout()
                    _add(content, "", layout, 0)
                    self.without(layout.missing(self.wanted))
            except MisfitError as error:
                self.misfitting(str(error))
        columns = zip(*rows, strict=True) if rows else [()] * len(paths)
        return held, dict(zip(self.wanted, map(_column, columns), strict=True))


def _column(values: Sequence[int | float]) -> NDArray[np.int64] | NDArray[np.float64]:
    """Numbers as int64 where all of them are whole and that small."""
    if values and all(isinstance(value, int) and abs(value) < 2**63 for value in values):
        return np.array(values, np.int64)
    return np.array(list(map(_float, values)), np.float64)


def _float(value: float) -> float:
    try:
        return float(value)
    except OverflowError:  # a whole number beyond float64
        return math.inf


def _value(message: dict[str, Any], parts: Sequence[str]) -> int | float | None:
    """The number at a path as in `MessageLayout.find`, or None."""
    inner: Any = message
    parent: Any = None
    for part in parts:
        if not part.startswith("["):
            parent, inner = inner, inner.get(part) if isinstance(inner, dict) else None
            continue
        name = part[1:-1]
        place = int(name) if name.isdigit() else -1
        for names in parent.values() if isinstance(parent, dict) else ():
            if isinstance(names, list) and name in names:
                place = names.index(name) if names.count(name) == 1 else -1
                break
        found = isinstance(inner, list) and 0 <= place < len(inner)
        inner = inner[place] if found else None
    return inner if isinstance(inner, (int, float)) and not isinstance(inner, bool) else None
