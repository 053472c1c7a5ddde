"""JSON messages, rewritten as records: their numbers stand at no fixed place.

A record has a hash of the message's structure, and behind it the message's numbers as float64.
"""

from __future__ import annotations

import json
import re
import struct
from contextlib import suppress
from typing import Any

from algid.base.limits import LIMITS
from algid.base.text import repeated
from algid.readers.annotations import BAD, GOOD, object_in
from algid.readers.messages.layout import MessageLayout, MisfitError, tells
from algid.readers.messages.message_file import Messages

_LEVEL = re.compile(r"\b(?:properties|items)\.")
"""What a schema's levels are called."""


class JsonRecords:
    """The structures of a topic's messages: what they name, and the order of their numbers."""

    def __init__(self) -> None:
        self._layouts: dict[int, MessageLayout] = {}
        self._misfit = ""

    def records(self, messages: Messages) -> Messages:
        """The messages as records, which `parse` reads until the next ones are made."""
        if len(self._layouts) > LIMITS.layouts:  # what is remembered must not grow with the file
            self._layouts.clear()
        rows = []
        for start, size in zip(messages.starts, messages.sizes, strict=True):
            end = start + min(size, LIMITS.message_bytes)
            try:
                rows.append(self._record(messages.content[start:end].tobytes()))
            except MisfitError as error:
                self._misfit = self._misfit or str(error)
                rows.append(b"")
        return Messages.of(rows, messages.log_ns)

    def parse(self, record: bytes) -> MessageLayout:
        """The layout of a record.

        Raises
        ------
        MisfitError
            If its message was no JSON object.
        """
        if not record:
            raise MisfitError(self._misfit)
        return self._layouts[struct.unpack_from("<q", record)[0]]

    def _record(self, payload: bytes) -> bytes:
        try:
            content = json.loads(payload, object_pairs_hook=_unique, parse_int=float)
            leaves = _gather(content, "", {})
        except (ValueError, RecursionError) as error:
            raise MisfitError(f"a message that is no JSON ({type(error).__name__})") from error
        if not isinstance(content, dict):
            raise MisfitError("a JSON message that is no object")
        numbers = {
            path: leaf
            for path, leaf in leaves.items()
            if type(leaf) is float or (type(leaf) is bool and path in GOOD | BAD)
        }
        # what changes with every message is no structure: of very many groups a few are enough
        few = len(self._layouts) < LIMITS.layouts
        told = {}
        for path, leaf in leaves.items():
            missing = leaf is None and path.endswith("]")  # it has a place in its list
            if type(leaf) is tuple or missing or (few and tells(path)):
                told[path] = leaf
        structure = hash((tuple(numbers), tuple(told.items())))
        if structure not in self._layouts:
            layout = self._layouts[structure] = MessageLayout(fixed=[(0, 8)])
            for place, path in enumerate(numbers, start=1):
                layout.add(path, 8 * place, "<f8")
            for path, leaf in leaves.items():
                if type(leaf) is tuple:
                    layout.texts[path] = leaf
                elif type(leaf) is str or path in told:
                    layout.label(path, str(leaf))
        return struct.pack(f"<q{len(numbers)}d", structure, *numbers.values())


def properties(schema: str) -> dict[str, str]:
    """What a JSON schema says of its properties, by their path: ``state.effort.unit``.

    A list's unit may stand at its items.
    """
    with suppress(RecursionError):
        leaves = _gather(object_in(schema), "", {})
        return {_LEVEL.sub("", path): str(leaf) for path, leaf in leaves.items()}
    return {}


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object whose names stand there once: of two alike the parser takes the last."""
    found = dict(pairs)
    if len(found) < len(pairs):
        (name, *_) = repeated(name for name, _ in pairs)
        raise MisfitError(f"a JSON message that names {name[:80]!r} twice")
    return found


def _gather(value: Any, path: str, leaves: dict[str, Any]) -> dict[str, Any]:
    """Add to `leaves` by path what is no object or list; a list of texts is one too."""
    if isinstance(value, dict):
        for key, inner in value.items():
            _gather(inner, f"{path}.{key}" if path else key, leaves)
    elif isinstance(value, list) and not (value and all(isinstance(one, str) for one in value)):
        for index, inner in enumerate(value):
            _gather(inner, f"{path}[{index}]", leaves)
    else:
        leaves[path] = tuple(value) if isinstance(value, list) else value
    return leaves
