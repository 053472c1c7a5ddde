"""JSON messages: parsed one by one, since their numbers stand at no fixed place."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from algid.readers.mcap.columnar import ExcessError, Fields, MisfitError, Numbers, Shape
from algid.readers.mcap.messages import Messages

_LARGEST = 1 << 20
_BYTES_A_STEP = 64


def walk(payload: bytes) -> Shape:
    """The shape of one message: the paths of its numbers and lists of strings, without places.

    Raises
    ------
    MisfitError
        If the message is no JSON object.
    """
    shape = Shape()
    _walk(_object(payload), "", shape)
    return shape


def _object(payload: bytes) -> dict[str, Any]:
    if len(payload) > _LARGEST:
        raise MisfitError(f"a JSON message of {len(payload)} bytes; expected {_LARGEST} at most")
    try:
        found = json.loads(payload)
    except (ValueError, RecursionError) as error:
        raise MisfitError(f"a message that is no JSON ({type(error).__name__})") from error
    if not isinstance(found, dict):
        raise MisfitError("a JSON message that is no object")
    return found


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
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        shape.numbers[path] = Numbers(0, "json")


@dataclass
class JsonDecoder:
    """Reads the wanted numbers out of JSON messages: the `Decoder` of this encoding."""

    wanted: Mapping[str, str]
    needed: frozenset[str]
    works: Callable[[int], bool]
    skipped: int = 0
    misfits: int = 0
    misfit: str = ""

    def columns(self, messages: Messages) -> tuple[NDArray[np.bool_], Fields]:
        """Which messages hold what is needed (N,), and the numbers of those, by name.

        Messages that are no JSON object are left out and counted.

        Raises
        ------
        ExcessError
            If they are more than in any honest file of this size.
        """
        if not self.works(int(messages.sizes.sum()) // _BYTES_A_STEP):
            raise ExcessError("more text than any recorder's file of this size")
        misfits = self.misfits
        held = np.zeros(len(messages), np.bool_)
        rows: list[list[Any]] = []
        for row, (start, size) in enumerate(zip(messages.starts, messages.sizes, strict=True)):
            try:
                found = _object(messages.content[start : start + size].tobytes())
            except MisfitError as error:
                self.misfits += 1
                self.misfit = self.misfit or str(error)
                continue
            values = [_value(found, path) for path in self.wanted.values()]
            held[row] = all(
                value is not None or name not in self.needed for name, value in zip(self.wanted, values, strict=True)
            )
            if held[row]:
                rows.append(values)
        self.skipped += int(held.size - np.count_nonzero(held)) - (self.misfits - misfits)
        return held, {name: _column([row[place] for row in rows]) for place, name in enumerate(self.wanted)}


def _column(values: list[Any]) -> NDArray[np.generic]:
    whole = bool(values) and all(isinstance(value, int) and abs(value) < 2**63 for value in values)
    return np.array(values, np.int64) if whole else np.array([_float(value) for value in values], np.float64)


def _float(value: float | None) -> float:
    try:
        return math.nan if value is None else float(value)
    except OverflowError:  # an integer of more than 308 digits
        return math.inf


def _value(found: Any, path: str) -> Any:
    """The number at a path as in `Shape.find`, or None."""
    parent: Any = None
    for part in re.findall(r"\[[^\]]*\]|[^.\[\]]+", path):
        if not part.startswith("["):
            parent, found = found, found.get(part) if isinstance(found, dict) else None
            continue
        index = _place(parent, part[1:-1])
        if index is None and part[1:-1].isdigit():
            index = int(part[1:-1])
        found = found[index] if isinstance(found, list) and index is not None and index < len(found) else None
    return found if isinstance(found, (int, float)) and not isinstance(found, bool) else None


def _place(parent: Any, name: str) -> int | None:
    """Where a name stands in a list beside; behind its end, where nothing is, for one that stands there twice."""
    lists = [one for one in parent.values() if isinstance(one, list)] if isinstance(parent, dict) else []
    named = next((one for one in lists if name in one), [])
    return None if not named else named.index(name) if named.count(name) == 1 else len(named)
