"""Channels that may hold a torque, if the one that was read holds none, with their remedies."""

from __future__ import annotations

import re
from pathlib import Path

from algid.base.errors import LogError
from algid.log import Log
from algid.notices import Remedy
from algid.readers.formats import entries_at

_TORQUE = re.compile(r"(?<![a-z])(torques?|efforts?|tau(?![a-z])|moment)", re.IGNORECASE)
_CURRENT = re.compile(r"(?<![a-z])(currents?|i_?q)(?![a-z])", re.IGNORECASE)
_OTHER = re.compile(
    r"cmd|command|desired|target|limit|(?<![a-z])des(?![a-z])|\(empty\)$", re.IGNORECASE
)
_MOST = 3


def torques_beside(log: Log, channel: str) -> list[Remedy]:
    """What else in the log's file may be the torque `channel`, and the settings that take it.

    Torques come before currents, and those of the same joint, by its number, before all others.
    """
    try:
        entries = entries_at(Path(log.origin.path))
    except LogError:  # a log in memory, or a file that is gone
        return []
    used, found = set(log.origin.mapping.values()), []
    amperes = {f"{channel}.unit": "A", f"{channel}.torque_constant": None}
    for pattern, unit in ((_TORQUE, {}), (_CURRENT, amperes)):
        for entry in entries:
            for field in entry.fields or (entry.name,):
                home, source = {}, field
                if entry.fields:
                    home, source = {f"{channel}.topic": entry.name}, f"{entry.name}: {field}"
                if pattern.search(field) and not _OTHER.search(field) and source not in used:
                    takes = {**home, f"{channel}.source": field, **unit}
                    found.append((channel[-1] not in source, Remedy(takes, "the log also holds")))
    found.sort(key=lambda one: one[0])
    return [remedy for _, remedy in found[:_MOST]]
