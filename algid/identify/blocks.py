"""Sums over stretches of a log, in bounded memory.

Score and information of an estimate are kept by stretch, because what the stretches disagree about tells the
error that white noise does not explain. When the stretches become too many, neighbours are added up.
"""

from __future__ import annotations

import numpy as np

from algid.arm import FloatArray

MOST_BLOCKS = 4096


class BlockSums:
    """Sums (B, ...) over consecutive stretches, B at most `2 * MOST_BLOCKS`."""

    def __init__(self) -> None:
        self._full: list[FloatArray] = []
        self._count = 0
        self._rest: FloatArray | None = None
        self._factor = 1

    def add(self, blocks: FloatArray) -> None:
        """Append the sums (b, ...) of the next b stretches."""
        if self._rest is not None:
            blocks = np.concatenate([self._rest, blocks])
        whole = blocks.shape[0] // self._factor
        self._rest = blocks[whole * self._factor :]
        self._append(_added(blocks[: whole * self._factor], self._factor))
        while self._count > 2 * MOST_BLOCKS:
            self._halve()

    def values(self) -> FloatArray:
        """All sums (B, ...) in time order; the last stretch may be shorter.

        Raises
        ------
        ValueError
            If nothing was added.
        """
        if self._rest is None:
            raise ValueError("no blocks were added")
        rest = [self._rest.sum(axis=0, keepdims=True)] if self._rest.shape[0] else []
        return np.concatenate([*self._full, *rest])

    def _append(self, sums: FloatArray) -> None:
        if sums.shape[0]:
            self._full.append(sums)
            self._count += sums.shape[0]

    def _halve(self) -> None:
        sums = np.concatenate(self._full)
        odd = sums.shape[0] % 2
        # An odd stretch waits, as one entry of the old size, for its partner.
        self._full, self._count = [], 0
        self._append(_added(sums[: sums.shape[0] - odd], 2))
        if odd:
            filler = np.zeros((self._factor - 1, *sums.shape[1:]))
            rest = self._rest if self._rest is not None else filler[:0]
            self._rest = np.concatenate([sums[-1:], filler, rest])
        self._factor *= 2


def _added(blocks: FloatArray, factor: int) -> FloatArray:
    return blocks if factor == 1 else blocks.reshape(-1, factor, *blocks.shape[1:]).sum(axis=1)


def long_run_variance(scores: FloatArray) -> tuple[FloatArray, int]:
    """Covariance of the sum of correlated scores and the lags used.

    Parameters
    ----------
    scores : (B, q), in time order, with zero sum at the estimate

    Returns
    -------
    (q, q) covariance of the sum, and the number of lags of Bartlett's window

    Notes
    -----
    Newey & West 1987 with the bandwidth of Andrews 1991, eq. (6.2) and (6.4), from a first-order autoregression.
    """
    count = scores.shape[0]
    power = np.sum(scores**2, axis=0)
    usable = scores[:, power > 0] / np.sqrt(power[power > 0])
    rho = np.clip(np.sum(usable[1:] * usable[:-1], axis=0), -0.97, 0.97)
    # α(1) with unit weights: each score was scaled to unit power above.
    persistence = np.sum(4 * rho**2 / ((1 - rho) ** 6 * (1 + rho) ** 2)) / max(np.sum(1 / (1 - rho) ** 4), 1e-300)
    lags = int(min(1.1447 * (persistence * count) ** (1 / 3), count / 4))
    total = scores.T @ scores
    for lag in range(1, lags + 1):
        cross = scores[lag:].T @ scores[:-lag]
        total += (1 - lag / (lags + 1)) * (cross + cross.T)
    return total, lags
