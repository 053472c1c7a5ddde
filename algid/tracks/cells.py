"""Information of short cells of a log on the payload: sums of whitened rows that are linear in it.

Rows are whitened as in `algid.estimators.whitening`. With the payload's column g = Y d, d what one
kilogram at the tip adds to the constants (Table 2), a row reads e = g m_p + noise.

======  ==========================================  =========
symbol  name                                        shape
======  ==========================================  =========
A       Σ g², information on m_p                    (C,)
B       Σ g e, so that m_p = ΣB / ΣA                (C,)
S       Σ g Y, how constants' errors enter          (C, q)
E       Σ e²                                        (C,)
Q       Σ of the whitened torques squared           (C,)
N       Σ c Y, c the columns of friction            (C, f, q)
D       Σ c e                                       (C, f)
======  ==========================================  =========
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from algid.arm import FloatArray
from algid.base.names import names_in, outside
from algid.signals.differences import POINTS, Stencil
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
    A: FloatArray
    B: FloatArray
    S: FloatArray
    E: FloatArray
    Q: FloatArray
    rows: FloatArray
    N: FloatArray
    D: FloatArray
    friction: list[int] = field(default_factory=list)
    """Which of the q columns are friction's."""

    def __len__(self) -> int:
        return int(self.start.size)

    @property
    def middle(self) -> FloatArray:
        """Time (C,) in s amid each cell."""
        return 0.5 * (self.start + self.end)

    def part(self, first: int, last: int) -> Cells:
        """Cells `first` to `last` - 1."""
        return replace(self, **{name: getattr(self, name)[first:last] for name in SUMS})

    @property
    def mass(self) -> float:
        """The payload in kg that fits all cells best."""
        return float(self.B.sum() / max(self.A.sum(), 1e-300))

    def sensitivity(self, arm: IdentifiedArm, mass: FloatArray) -> FloatArray:
        """T (C, p): shift of the scores of payload `mass` (C,) kg by constants, lengths, body."""
        return np.concatenate([self.S, mass[:, None] * (self.S @ arm.by_shape.T)], axis=1)

    def friction_sensitivity(self, arm: IdentifiedArm, mass: FloatArray) -> FloatArray:
        """V (C, f, p): shift of D by constants, lengths and body of a payload of `mass` (C,) kg."""
        return np.concatenate([self.N, mass[:, None, None] * (self.N @ arm.by_shape.T)], axis=2)

    def squares(self, mass: float | FloatArray) -> FloatArray:
        """Σ (e − g m_p)² (C,): what a payload of `mass` kg, one or (C,), leaves."""
        return np.asarray(self.E - 2 * mass * self.B + mass**2 * self.A)


SUMS = outside(names_in(fields(Cells)), ("friction",))


def joined(parts: Sequence[Cells]) -> Cells:
    """Cells one after another."""
    sums: dict[str, Any] = {}
    for name in SUMS:
        sums[name] = np.concatenate([getattr(part, name) for part in parts])
    return replace(parts[0], **sums)


def cells_of(
    segments: Iterable[Segment], arm: IdentifiedArm, c: FloatArray, *, settle: bool = True
) -> list[Cells]:
    """Cells of each piece of a log, linearised at the coefficients `c` (q,).

    `settle` is that of `IdentifiedArm.linearised`.
    """
    cells = []
    for piece in pieces(segments, _PIECE_SAMPLES):
        if len(piece) < 3 * POINTS:
            continue
        linear = arm.linearised(piece, c, settle=settle)
        Y, e = linear.columns[:-1], linear.columns[-1]
        g = arm.unit @ Y
        e = e + (c - arm.k) @ Y
        torque = e + arm.k @ Y
        step = max(1, round(CELL / piece.dt))
        count = e.size // (2 * step)

        def by_cell(rows: FloatArray, count: int = count, step: int = step) -> FloatArray:
            whole = rows[..., : count * 2 * step]
            return whole.reshape(rows.shape[:-1] + (count, 2 * step)).sum(axis=-1)

        given = Stencil(piece.dt, arm.shift).torques(len(piece))
        first = piece.start + piece.dt * (given.start + step * np.arange(count))
        cells.append(
            Cells(
                first,
                first + step * piece.dt,
                by_cell(g * g),
                by_cell(g * e),
                by_cell(g * Y).T,
                by_cell(e * e),
                by_cell(torque * torque),
                np.full(count, 2.0 * step),
                np.stack([by_cell(c * Y) for c in Y[arm.friction]]).transpose(2, 0, 1),
                by_cell(Y[arm.friction] * e).T,
                arm.friction,
            )
        )
    return cells
