"""Torques that a sensor cuts off: found by motion, reported, and left out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from algid.estimators.saturation import UNSEEN, Limit, Saturation, saturation_of
from algid.inspection.figures import source
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


def beyond(log: Log, limits: Sequence[Limit]) -> list[int]:
    """How many samples of a log, or of a block of it, lie beyond each of its limits."""
    return [int(np.count_nonzero(limit.beyond(log.tau))) for limit in limits]


def clipped(
    origin: Origin, limits: Sequence[Limit], counts: Sequence[int], rows: int
) -> list[Notice]:
    """What there is to say of each limit beyond which `counts` samples of `rows` lie."""
    notices = []
    for limit, count in zip(limits, counts, strict=True):
        numbers = {
            "channel": source(origin, f"tau{limit.joint + 1}"),
            "level": max(abs(side) for side in (limit.low, limit.high) if np.isfinite(side)),
            "count": count,
            "percent": 100 * count / rows,
        }
        if count:
            keep = Remedy({"accept": CODE}, "to use them nevertheless")
            notices.append(Notice(CODE, numbers=numbers, remedies=(keep,)))
    return notices
