"""Pieces of a stream of segments: the same cuts however the reader blocked the log.

Estimators work on pieces of bounded length, so that a day-long log needs no more memory than a short one. A
piece never spans a gap. The cuts depend on the samples alone, not on the blocks they came in.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from algid.sampling import Segment


def _joined(parts: list[Segment]) -> Segment:
    if len(parts) == 1:
        return parts[0]
    omegas = [part.omega for part in parts if part.omega is not None]
    return Segment(
        start=parts[0].start,
        dt=parts[0].dt,
        theta=np.concatenate([part.theta for part in parts], axis=1),
        tau=np.concatenate([part.tau for part in parts], axis=1),
        omega=np.concatenate(omegas, axis=1) if len(omegas) == len(parts) else None,
        continues=parts[0].continues,
    )


def _part(segment: Segment, first: int, last: int) -> Segment:
    return Segment(
        start=segment.start + segment.dt * first,
        dt=segment.dt,
        theta=segment.theta[:, first:last],
        tau=segment.tau[:, first:last],
        omega=None if segment.omega is None else segment.omega[:, first:last],
        continues=segment.continues if first == 0 else True,
    )


def pieces(segments: Iterable[Segment], length: int, overlap: int = 0) -> Iterator[Segment]:
    """Cut a stream of segments into pieces of `length` samples; the last one of a gapless run differs.

    Parameters
    ----------
    segments : iterable of Segment
        In time; `Segment.continues` tells which follow the one before without a gap.
    length : int
        Samples a piece advances.
    overlap : int
        Samples of the piece before that a piece repeats at its start. A remainder of fewer than half a
        `length` is joined to the piece before it.

    Raises
    ------
    ValueError
        If length < 1 or overlap < 0.
    """
    if length < 1 or overlap < 0:
        raise ValueError(f"length must be at least 1 and overlap at least 0, got {length} and {overlap}")
    kept: list[Segment] = []
    held = 0
    for segment in segments:
        if kept and not segment.continues:
            yield from _last(_joined(kept), length, overlap)
            kept, held = [], 0
        kept.append(segment)
        held += len(segment)
        if held < 2 * length + overlap:
            continue
        run = _joined(kept)
        first = 0
        while held - first >= 2 * length + overlap:
            yield _part(run, first, first + length + overlap)
            first += length
        kept, held = [_part(run, first, held)], held - first
    if kept:
        yield from _last(_joined(kept), length, overlap)


def _last(run: Segment, length: int, overlap: int) -> Iterator[Segment]:
    """The rest of a run, shorter than two pieces: one piece, or two where the second is long enough."""
    cut = length + overlap
    if len(run) - length < overlap + (length + 1) // 2:
        yield run
        return
    yield _part(run, 0, cut)
    yield _part(run, length, len(run))
