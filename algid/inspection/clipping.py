"""Torques that a sensor cuts off: found by motion, reported, and left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from algid.estimators.saturation import UNSEEN, Limit, Saturation, saturation_of
from algid.log import Log, Origin
from algid.notices import Notice, Remedy
from algid.signals.segments import Segment, segments

CODE = "CLIPPED_TORQUE"
LOOKED_AT = 1 << 18
"""Samples at the beginning of logs in which limits are looked for."""


def saturation(*logs: Log, gravity: float = 9.81, effort: str | None = None) -> Saturation:
    """The limits that cut off torques of an arm's logs, and the joints whose limits are sound.

    They are looked for in the beginning of the logs, at most `LOOKED_AT` samples in all.

    Parameters
    ----------
    logs : of one arm, with or without one payload, or their beginnings
    gravity : float, m/s^2
        0 for an arm in a horizontal plane.
    effort : str, as in a profile
        An external torque is not what moves the arm, and shows no limit.
    """
    if effort == "external":
        return UNSEEN
    pieces: list[Segment] = []
    for log in logs:
        if len(log) > 1 and CODE not in log.origin.reading.accepted:
            pieces += segments([log.part(0, LOOKED_AT // len(logs))])
    return saturation_of(pieces, gravity) if pieces else UNSEEN


@dataclass
class Counted:
    """Counts the samples of a log that lie beyond its limits."""

    limits: tuple[Limit, ...]

    def __post_init__(self) -> None:
        self._beyond = [0] * len(self.limits)
        self._rows = 0

    def add(self, block: Log) -> None:
        """Count those of a block."""
        self._rows += len(block)
        for place, limit in enumerate(self.limits):
            self._beyond[place] += int(np.count_nonzero(limit.beyond(block.tau)))

    def notices(self, origin: Origin) -> list[Notice]:
        """What there is to say of each limit that lies within the samples counted."""
        notices = []
        for limit, beyond in zip(self.limits, self._beyond, strict=True):
            if beyond:
                notices.append(_notice(origin, limit, beyond, self._rows))
        return notices


def clipped(log: Log, limits: Sequence[Limit]) -> list[Notice]:
    """What there is to say of a log's limits."""
    counted = Counted(tuple(limits))
    counted.add(log)
    return counted.notices(log.origin)


def _notice(origin: Origin, limit: Limit, beyond: int, rows: int) -> Notice:
    name = f"tau{limit.joint + 1}"
    source = origin.mapping.get(name, name)
    finite = [abs(side) for side in (limit.low, limit.high) if np.isfinite(side)]
    numbers = {
        "channel": name if source == name else f"{name} ({source})",
        "level": max(finite),
        "count": beyond,
        "percent": 100 * beyond / rows,
    }
    keep = Remedy({"accept": CODE}, "to use them nevertheless")
    return Notice(CODE, numbers=numbers, lossy=True, remedies=(keep,))
