"""Channels that may hold a torque, if the one that was read holds none, with their remedies."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from algid.base.errors import LogError
from algid.log import Log
from algid.notices import Remedy
from algid.readers.formats import Entry, entries_at

_TORQUE = re.compile(r"(?<![a-z])(torques?|efforts?|tau(?![a-z])|moment)", re.IGNORECASE)
_CURRENT = re.compile(r"(?<![a-z])(currents?|i_?q)(?![a-z])", re.IGNORECASE)
_COMMANDED = re.compile(r"cmd|command|desired|target|limit|(?<![a-z])des(?![a-z])", re.IGNORECASE)
_MOST = 3


def torques_beside(log: Log, channel: str) -> list[Remedy]:
    """What else in the log's file may be the torque `channel`, and the settings that take it."""
    try:
        entries = entries_at(Path(log.origin.path))
    except LogError:  # a log in memory, or a file that is gone
        return []
    used = set(log.origin.mapping.values())
    unused = [(source, one) for source, one in _candidates(entries, channel) if source not in used]
    # of the same joint first, by its number
    unused.sort(key=lambda pair: channel[-1] not in pair[0])
    return [remedy for _, remedy in unused[:_MOST]]


def _candidates(entries: tuple[Entry, ...], channel: str) -> Iterator[tuple[str, Remedy]]:
    """Name and remedy of each channel that may be a torque: torques first, then currents."""
    places, bare = [], []
    for entry in entries:
        for field in entry.fields:
            places.append((entry.name, field))
        if not entry.fields:
            bare.append(("", entry.name))
    places += bare
    amperes = {f"{channel}.unit": "A", f"{channel}.torque_constant": None}
    for pattern, unit in ((_TORQUE, {}), (_CURRENT, amperes)):
        for topic, field in places:
            if (
                pattern.search(field)
                and not _COMMANDED.search(field)
                and not field.endswith("(empty)")
            ):
                home, source = {}, field
                if topic:
                    home, source = {f"{channel}.topic": topic}, f"{topic}: {field}"
                yield (
                    source,
                    Remedy({**home, f"{channel}.source": field, **unit}, "the log also holds"),
                )
