"""Samples with almost equal stamps, put in their place before anything is interpolated.

Receipt times come in clusters: a sample is sent twice, or is late and arrives with its successor,
or a buffer is emptied at once. Two nodes a microsecond apart make any polynomial through them
steep by their noise over that microsecond. A cluster is a run of samples each nearer to the one
before than `NEAR` periods. Where as many periods lack samples before a cluster as it has samples,
and the angles move on through it as they did over those periods, its samples are late: each goes
back to its own period. Otherwise they are one instant, and their mean stands for them.

=======  ====================================  =========
name     meaning                               shape
=======  ====================================  =========
first    first sample of each cluster          (C,)
size     samples of each cluster               (C,)
=======  ====================================  =========
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from algid.arm import FloatArray
from algid.log import IntArray, Log, join, signals_of

NEAR = 0.3
"""Periods: nodes of a cubic this far apart still carry noise of at most twice one sample's."""


def spaced(blocks: Iterable[Log], period: float) -> Iterator[Log]:
    """The log that comes in `blocks`, without samples nearer than `NEAR` of a `period` in s.

    None of the `blocks`, one at least, is empty. What comes out does not depend on how they were
    cut.
    """
    held: list[Log] = []  # the last cluster, which may go on in the next block
    before: Log | None = None  # the sample before it
    for block in blocks:
        log = join([*held, block])
        far = np.flatnonzero(np.diff(log.stamp_ns) >= NEAR * period * 1e9) + 1
        last = int(far[-1]) if far.size else 0
        if last:
            yield _settled(log.part(0, last), before, period)
            before = log.part(last - 1, last)
        held = [log.part(last, len(log))]
    yield _settled(join(held), before, period)


def near_stamps(stamp_ns: IntArray, period: float) -> int:
    """Number of samples of a log (N,) less than `NEAR` of a `period` in s after the one before."""
    return int(np.count_nonzero(np.diff(stamp_ns) < NEAR * period * 1e9))


def _settled(log: Log, before: Log | None, period: float) -> Log:
    """Whole clusters with every sample in its place.

    `before` is the sample before the first of them.
    """
    if not near_stamps(log.stamp_ns, period):
        return log
    known = log if before is None else join([before, log])
    first = np.append(0, np.flatnonzero(np.diff(known.stamp_ns) >= NEAR * period * 1e9) + 1)
    size = np.diff(first, append=len(known))
    # nothing shows whether the log's first samples are late: the last one is not
    if size[0] > 1:
        return _settled(log.part(int(size[0]) - 1, len(log)), None, period)
    stamps, kept = known.stamp_ns.copy(), np.isin(np.arange(len(known)), first)
    for start, own in zip(first[size > 1].tolist(), size[size > 1].tolist(), strict=True):
        if _late(known.part(start - 1, start + own), period):
            later = np.rint(np.arange(1, own + 1) * period * 1e9).astype(np.int64)
            cluster = stamps[start : start + own]
            cluster[:] = np.minimum(known.stamp_ns[start - 1] + later, cluster)
            kept[start : start + own] = True
    whole = _merged(replace(known, stamp_ns=stamps), np.flatnonzero(kept))
    return whole if before is None else whole.part(1, len(whole))


def _late(cluster: Log, period: float) -> bool:
    """Whether a cluster, here after the sample before it, belongs to the periods between the two.

    As many periods have to lack samples as it has, and its angles (2, m + 1) to lie nearer to a
    line at equal steps than to a line at their times (m + 1,).
    """
    times, theta = (
        (cluster.stamp_ns - cluster.stamp_ns[0]) * 1e-9,
        cluster.theta - cluster.theta[:, :1],
    )
    if round(times[-1] / period) != len(cluster) - 1:
        return False
    even = np.arange(times.size) / (times.size - 1)
    off_even = np.sum((theta - theta[:, -1:] * even) ** 2)
    off_timed = np.sum((theta - theta[:, -1:] * (times / times[-1])) ** 2)
    return bool(off_even <= off_timed)


def _merged(log: Log, starts: IntArray) -> Log:
    """The mean of the samples from each start to the next."""
    counts = np.diff(starts, append=len(log))

    def mean(rows: FloatArray) -> FloatArray:
        return np.asarray(np.add.reduceat(rows, starts, axis=-1) / counts)

    origin_ns = log.stamp_ns[0]
    return replace(
        log,
        # floor, since rounding to even would depend on where the block begins
        stamp_ns=origin_ns
        + np.floor(mean((log.stamp_ns - origin_ns).astype(np.float64)) + 0.5).astype(np.int64),
        **signals_of(log, mean),
    )
