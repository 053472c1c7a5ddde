"""Information of short cells of a log on the payload: sums of whitened rows that are linear in it.

Rows are whitened as in `algid.estimators.whitening`. With z the payload's column g, what one
kilogram at the tip adds to the torque (Table 2), and those of friction, a row reads
e = zᵀ x + noise, x the mass and the change of friction's coefficients.

======  ==========================================  =============
symbol  name                                        shape
======  ==========================================  =============
U       z = U Y: a kilogram's constants, friction   (1 + f, q)
P       Σ z Y, how constants' errors enter          (C, 1 + f, q)
M       P Uᵀ, information on x                      (C, 1 + f, 1 + f)
b       Σ z e, so that m_p = Σb / ΣM                (C, 1 + f)
E       Σ e²                                        (C,)
Q       Σ of the whitened torques squared           (C,)
======  ==========================================  =============
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from algid.arm import FloatArray
from algid.base.names import concatenated, names_in, outside, rows_of
from algid.signals.differences import POINTS
from algid.signals.segments import Segment, pieces
from algid.tracks.arm import IdentifiedArm

CELL = 0.02  # s: far shorter than an object is carried, and some samples still
_PIECE_SAMPLES = 16384


@dataclass(frozen=True, eq=False)
class Cells:
    """Sums by cell: see the table above.

    `start` and `end` (C,) are times in s, `rows` (C,) counts.
    """

    start: FloatArray
    end: FloatArray
    P: FloatArray
    b: FloatArray
    E: FloatArray
    Q: FloatArray
    rows: FloatArray
    U: FloatArray

    def __len__(self) -> int:
        return int(self.start.size)

    @cached_property
    def M(self) -> FloatArray:
        """Information (C, 1 + f, 1 + f) on the mass and friction's coefficients."""
        return np.asarray(self.P @ self.U.T)

    @property
    def A(self) -> FloatArray:
        """Information (C,) on the mass."""
        return self.M[:, 0, 0]

    @property
    def B(self) -> FloatArray:
        """Score (C,) of the mass."""
        return self.b[:, 0]

    @property
    def middle(self) -> FloatArray:
        """Time (C,) in s amid each cell."""
        return 0.5 * (self.start + self.end)

    @property
    def sums(self) -> dict[str, FloatArray]:
        """What each cell has of its own, by name."""
        return {name: getattr(self, name) for name in SUMS}

    def part(self, first: int, last: int) -> Cells:
        """Cells `first` to `last` - 1."""
        return replace(self, **rows_of(self.sums, slice(first, last)))

    @property
    def mass(self) -> float:
        """The payload in kg that fits all cells best."""
        return float(self.B.sum() / max(self.A.sum(), 1e-300))

    def sensitivity(self, arm: IdentifiedArm, mass: FloatArray) -> FloatArray:
        """T (C, 1 + f, p): shift of b by constants, lengths and body of a payload `mass` (C,)."""
        by_shape = mass[:, None, None] * (self.P @ arm.by_shape.T)
        return np.concatenate([self.P, by_shape], axis=2)

    def less(self, x: FloatArray) -> Cells:
        """The cells without what a mass and friction x (C, 1 + f) explain."""
        Mx = np.einsum("cij,cj->ci", self.M, x)
        E = self.E - np.einsum("ci,ci->c", x, 2 * self.b - Mx)
        return replace(self, b=self.b - Mx, E=E)


SUMS = outside(names_in(fields(Cells)), ("U",))


def joined(parts: Sequence[Cells]) -> Cells:
    """Cells one after another."""
    return replace(parts[0], **concatenated([part.sums for part in parts]))


def cells_of(
    segments: Iterable[Segment], arm: IdentifiedArm, c: FloatArray, *, settle: bool = True
) -> list[Cells]:
    """Cells of each piece of a log, linearised at the coefficients `c` (q,).

    `settle` is that of `IdentifiedArm.linearised`.
    """
    cells, U = [], arm.columns
    for piece in pieces(segments, _PIECE_SAMPLES, 3 * POINTS):
        columns = arm.linearised(piece, c, settle=settle).columns
        step = max(1, round(CELL / piece.dt))
        count = columns.shape[1] // (2 * step)
        Y = columns[:, : count * 2 * step].reshape(-1, count, 2 * step).swapaxes(0, 1)
        e = Y[:, -1] + (c - arm.k) @ Y[:, :-1]
        Y = Y[:, :-1]
        torque = e + arm.k @ Y
        z = U @ Y
        start = arm.times(piece)[: count * step : step]
        cells.append(
            Cells(
                start,
                start + step * piece.dt,
                z @ Y.swapaxes(1, 2),
                np.einsum("czr,cr->cz", z, e),
                np.sum(e * e, axis=1),
                np.sum(torque * torque, axis=1),
                np.full(count, 2.0 * step),
                U,
            )
        )
    return cells
