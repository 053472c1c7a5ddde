"""Which parameters, and which combinations of them, the logs determine.

A direction counts as undetermined when its standard deviation reaches the size of the parameters
it mixes: the information matrix is scaled by the largest parameter of each physical class
(inertia, gravity, friction …), and its small eigenvalues name the directions.

======  ===================================================  ===============  ===============
symbol  name                                                 shape            unit
======  ===================================================  ===============  ===============
S       information on the parameters                        (Q, Q)           1 / (unit unit)
size    what a parameter's standard deviation compares with  (Q,)             unit
null    directions over the sizes that S leaves open         (Q, m)           1
======  ===================================================  ===============  ===============
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.criteria import STILL, UNDETERMINED
from algid.base.names import named_values, outside, places_outside, within
from algid.estimators.combine import scaled_pinv
from algid.model import PARAMETERS, RIGID
from algid.notices import Notice
from algid.physics.parameters import INERTIA, LENGTH, MASS, MOMENT, VISCOUS, Scale

# of √(inertia × gravity), half the critical damping: an arm may be free of friction, and that be
# known
_DAMPING = 0.1
_NOTHING = 1e-14  # of the largest eigenvalue: rounding
SHARE = 0.15
"""Of an eigenvector: below it a parameter has no part in the direction."""


def examine(
    names: Sequence[str],
    values: FloatArray,
    S: FloatArray,
    moved: FloatArray,
    bounded: Collection[str] = (),
) -> tuple[tuple[Notice, ...], FloatArray, NDArray[np.bool_]]:
    """Which parameters and combinations the information determines.

    Parameters
    ----------
    names : Q names in `algid.model.UNITS`
    values : (Q,)
    S : (Q, Q)
        Information on them.
    moved : (2,), rad
        Each joint's travel: why something is open.
    bounded : names that are known to be nothing, or shrunk
        They are determined, and the others' information is what they leave of it.

    Returns
    -------
    Undetermined directions in words, the covariance (Q, Q), and which parameters (Q,) are open:
    those that have a share of `SHARE` or more in an open direction. The covariance is the inverse
    of S, as wide along open directions as S has it.
    """
    free, size, eigenvalues, vectors, lost = _spectrum(names, values, S, bounded)
    null = vectors[:, lost]
    lacking, covariance = np.zeros(len(names), dtype=bool), np.zeros_like(S)
    lacking[free] = np.sqrt(np.sum(null**2, axis=1)) >= SHARE
    # A direction of little information is as wide here as it is: what it mixes with is as unsure.
    inverse = (vectors / np.maximum(eigenvalues, _NOTHING * eigenvalues[-1] + 1e-300)) @ vectors.T
    covariance[np.ix_(free, free)] = inverse * np.outer(size, size)
    return tuple(_left_open(outside(names, bounded), null, size, moved)), covariance, lacking


def open_directions(
    names: Sequence[str], values: FloatArray, S: FloatArray, bounded: Collection[str] = ()
) -> tuple[FloatArray, FloatArray]:
    """Directions that the information S (Q, Q) on parameters `values` (Q,) leaves open.

    Returns
    -------
    null : (Q, m), orthonormal, of the parameters over their sizes
    size : (Q,)
        Both of those parameters alone that are not `bounded`.
    """
    _, size, _, vectors, lost = _spectrum(names, values, S, bounded)
    return vectors[:, lost], size


def _spectrum(
    names: Sequence[str], values: FloatArray, S: FloatArray, bounded: Collection[str]
) -> tuple[list[int], FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]:
    """Places and sizes of the parameters that are not `bounded`.

    With them eigenvalues and vectors of what the others leave of the information, scaled by the
    sizes, and which count as zero.
    """
    free = places_outside(names, bounded)
    if len(free) < len(names):
        S = scaled_pinv(scaled_pinv(S)[np.ix_(free, free)])
    size = sizes(outside(names, bounded), values[free])
    scaled = S * np.outer(size, size)
    eigenvalues, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    least = max(1 / UNDETERMINED**2, _NOTHING * eigenvalues[-1])
    return free, size, eigenvalues, vectors, eigenvalues < least


def sizes(names: Sequence[str], values: FloatArray) -> FloatArray:
    """Size (Q,) of each parameter: the largest value of its class.

    That of viscous friction is a share of critical damping.
    """
    scales = [PARAMETERS[name].scale for name in names]
    value_of = named_values(names, np.abs(values))

    def largest(scale: Scale, among: Iterable[str]) -> float:
        return max(
            (value_of[name] for name in among if PARAMETERS[name].scale is scale), default=0.0
        )

    arm = within(RIGID, names)
    inertia, moment = largest(INERTIA, arm), largest(MOMENT, arm)
    least = {VISCOUS: _DAMPING * float(np.sqrt(inertia * moment))}
    # With both lengths known the torque is linear in the payload, which may be none, and that be
    # known: its size is that of a mass which at 1 m loads the arm as much as it loads itself.
    if LENGTH not in scales:
        least[MASS] = max(moment / 9.81, inertia)
    return np.array(
        [max(largest(scale, names), least.get(scale, 0.0), scale.least) for scale in scales]
    )


def _left_open(
    names: Sequence[str], null: FloatArray, size: FloatArray, moved: FloatArray
) -> Iterator[Notice]:
    """What the directions `null` leave open; `moved` (2,) in rad is why."""
    still = moved < STILL
    why = ""
    if still.all():
        why = ": neither joint moved"
    elif still.any():
        why = f": joint {np.argmax(still) + 1} never moved"

    def said(case: str, names: list[str], **numbers: float) -> Notice:
        about = {"case": case, "names": names, "why": why}
        return Notice("OPEN_DIRECTION", numbers=about | numbers)

    for group in _groups(null):
        part = null[group]
        together = [names[row] for row in group]
        free = int(np.linalg.matrix_rank(part, tol=SHARE))
        if free >= len(group):
            yield from (said("alone", [name]) for name in together)
        elif len(group) == 2:
            widest = np.argmax(np.linalg.norm(part, axis=0))
            first, second = part[:, widest] * size[group]
            ratio = float(-second / first)
            case = "ratio"  # so many times the first plus the second are determined
            for name, value in (("sum", 1.0), ("difference", -1.0)):
                if abs(ratio - value) < 0.15:
                    case = name
            yield said(case, together, ratio=ratio)
        else:
            yield said("several", together, count=len(group) - free)


def _groups(null: FloatArray) -> list[NDArray[np.int64]]:
    """Rows that share an undetermined direction."""
    projector = np.abs(null @ null.T)
    rows = np.flatnonzero(np.sqrt(np.diag(projector)) >= SHARE)
    linked = projector[np.ix_(rows, rows)] >= SHARE**2
    # along chains of links, as many as there may be
    reached = np.linalg.matrix_power(linked.astype(np.float64), len(rows)) > 0
    return [rows[list(group)] for group in dict.fromkeys(map(tuple, reached.tolist()))]
