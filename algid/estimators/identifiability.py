"""Which parameters, and which combinations of them, the logs determine.

And whether innovations are white.

A direction counts as undetermined when its standard deviation reaches the size of the parameters
it mixes: the information matrix is scaled by the largest parameter of each physical class
(inertia, gravity, friction …), and its small eigenvalues name the directions.

The error bars of the likelihood suppose innovations that are white and Gaussian: Ljung & Box's
test on those of each joint, as they are and summed over 16 and 64 samples, so that slow colour is
seen as well as fast. The smallest p-value counts three times over (Bonferroni), and a correlation
too faint to matter counts as none. The excess kurtosis shows heavy tails.

======  ===================================================  ===============  ===============
symbol  name                                                 shape            unit
======  ===================================================  ===============  ===============
S       information on the parameters                        (Q, Q)           1 / (unit unit)
size    what a parameter's standard deviation compares with  (Q,)             unit
null    directions over the sizes that S leaves open         (Q, m)           1
w       innovations of a piece                               (2, n)           1
rho     their autocorrelations, by scale and joint           (3, 2, lags)     1
======  ===================================================  ===============  ===============
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray, keep_arrays
from algid.base.compiled import chi2_tail
from algid.base.criteria import STILL, UNDETERMINED
from algid.base.significance import level
from algid.model import PARAMETERS, RIGID
from algid.notices import Notice
from algid.physics.parameters import INERTIA, LENGTH, MASS, MOMENT, VISCOUS

# of √(inertia × gravity), half the critical damping: an arm may be free of friction, and that be
# known
_DAMPING = 0.1
_NOTHING = 1e-14  # of the largest eigenvalue: rounding
SHARE = 0.15
"""Of an eigenvector: below it a parameter has no part in the direction."""


@dataclass(frozen=True, eq=False)
class Identifiability:
    """Undetermined directions in words, which parameters are determined, and their covariance."""

    left_open: tuple[Notice, ...]
    determined: tuple[bool, ...]
    covariance: FloatArray


def examine(
    names: Sequence[str], values: FloatArray, S: FloatArray, moved: FloatArray
) -> Identifiability:
    """Which parameters and combinations the information determines.

    Parameters
    ----------
    names : Q names in `algid.model.UNITS`
    values : (Q,)
    S : (Q, Q)
        Information on them.
    moved : (2,), rad
        Each joint's travel: why something is open.

    Returns
    -------
    Identifiability
        A parameter is open that has a share of `SHARE` or more in an open direction. The
        covariance is the inverse of S, as wide along open directions as S has it.
    """
    size = sizes(names, values)
    eigenvalues, vectors, lost = _spectrum(S, size)
    null = vectors[:, lost]
    part = np.sqrt(np.sum(null**2, axis=1))
    determined = tuple((part < SHARE).tolist())
    # A direction of little information is as wide here as it is: what it mixes with is as unsure.
    inverse = (vectors / np.maximum(eigenvalues, _NOTHING * eigenvalues[-1] + 1e-300)) @ vectors.T
    return Identifiability(
        tuple(_left_open(names, null, size, moved)), determined, inverse * np.outer(size, size)
    )


def open_directions(
    names: Sequence[str], values: FloatArray, S: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Directions that the information S (Q, Q) on parameters `values` (Q,) leaves open.

    Returns
    -------
    null : (Q, m), orthonormal, of the parameters over their sizes
    size : (Q,)
    """
    size = sizes(names, values)
    _, vectors, lost = _spectrum(S, size)
    return vectors[:, lost], size


def _spectrum(S: FloatArray, size: FloatArray) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Eigenvalues and vectors of the information scaled by the sizes, and which count as zero."""
    scaled = S * np.outer(size, size)
    eigenvalues, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    least = max(1 / UNDETERMINED**2, _NOTHING * float(eigenvalues[-1]))
    return eigenvalues, vectors, eigenvalues < least


def sizes(names: Sequence[str], values: FloatArray) -> FloatArray:
    """Size (Q,) of each parameter: the largest value of its class.

    That of viscous friction is a share of critical damping.
    """
    scales = [PARAMETERS[name].scale for name in names]
    sized = dict.fromkeys(scales + [VISCOUS], 0.0)
    inertia = moment = 0.0  # the largest of the arm's own
    for name, scale, value in zip(names, scales, np.abs(values).tolist(), strict=True):
        sized[scale] = max(sized[scale], value)
        if name in RIGID and scale is INERTIA:
            inertia = max(inertia, value)
        elif name in RIGID and scale is MOMENT:
            moment = max(moment, value)
    # With both lengths known the torque is linear in the payload, which may be none, and that be
    # known: its size is that of a mass which at 1 m loads the arm as much as it loads itself.
    if MASS in scales and LENGTH not in scales:
        sized[MASS] = max(sized[MASS], moment / 9.81, inertia)
    sized[VISCOUS] = max(sized[VISCOUS], _DAMPING * float(np.sqrt(inertia * moment)))
    return np.array([max(sized[scale], scale.least) for scale in scales])


def _left_open(
    names: Sequence[str], null: FloatArray, size: FloatArray, moved: FloatArray
) -> Iterator[Notice]:
    """What the directions `null` leave open; `moved` (2,) in rad is why."""
    still = moved < STILL
    why = ""
    if still.all():
        why = ": neither joint moved"
    elif still.any():
        why = f": joint {int(np.argmax(still)) + 1} never moved"
    for group in _groups(null):
        part = null[group]
        together = [names[row] for row in group]
        free = int(np.linalg.matrix_rank(part, tol=SHARE))
        if free >= len(group):
            for name in together:
                yield _open("alone", [name], why)
        elif len(group) == 2:
            widest = int(np.argmax(np.linalg.norm(part, axis=0)))
            case, ratio = _relation(part[:, widest] * size[group])
            yield _open(case, together, why, ratio=ratio)
        else:
            yield _open("several", together, why, count=len(group) - free)


def _open(case: str, names: Sequence[str], why: str, **numbers: float) -> Notice:
    numbers_and_names = {"case": case, "names": names, "why": why} | numbers
    return Notice("OPEN_DIRECTION", numbers=numbers_and_names)


def _groups(null: FloatArray) -> list[list[int]]:
    """Rows that share an undetermined direction."""
    projector = null @ null.T
    rest = np.flatnonzero(np.sqrt(np.diag(projector)) >= SHARE).tolist()
    groups: list[list[int]] = []
    while rest:
        group = [rest.pop(0)]
        for row in group:  # which grows as rows that are linked to it are found
            linked = [other for other in rest if abs(projector[row, other]) >= SHARE**2]
            for other in linked:
                rest.remove(other)
            group += linked
        groups.append(sorted(group))
    return groups


def _relation(direction: FloatArray) -> tuple[str, float]:
    """The determined relation of two parameters; `direction` is the undetermined one, own units.

    Their sum, their difference, or a number of times the first plus the second.
    """
    ratio = float(-direction[1] / direction[0])
    for case, value in (("sum", 1.0), ("difference", -1.0)):
        if abs(ratio - value) < 0.15:
            return case, ratio
    return "ratio", ratio


SCALES = (1, 16, 64)
_LAGS = 10
_FAINT = 0.02  # root mean square of the correlations that does not matter
_TAILS = 6.0  # standard errors of the kurtosis
_HEAVY = 1.0  # excess kurtosis that matters


@dataclass(frozen=True, eq=False)
class Correlations:
    """Innovations' counts (3,), lag products (3, 2, 1 + lags) by scale, fourth powers (2,)."""

    count: FloatArray
    products: FloatArray
    fourth: FloatArray

    def __add__(self, other: Correlations) -> Correlations:
        return Correlations(
            self.count + other.count, self.products + other.products, self.fourth + other.fourth
        )


@dataclass(frozen=True, eq=False)
class Whiteness:
    """The test's outcome by joint (2,): p-value, lag-one correlation, excess kurtosis.

    And the verdict.
    """

    p_value: FloatArray
    lag1: FloatArray
    kurtosis: FloatArray
    joint_white: tuple[bool, bool]

    def __post_init__(self) -> None:
        keep_arrays(self)

    @property
    def white(self) -> bool:
        """Whether both joints' innovations pass."""
        return all(self.joint_white)


def correlations(w: FloatArray) -> Correlations:
    """Sums over the innovations of one piece, which add up over pieces.

    Parameters
    ----------
    w : (2, n), of unit variance where the model holds
    """
    counts, products = [], []
    for scale in SCALES:
        whole = w.shape[1] // scale
        x = w
        if scale > 1:
            x = w[:, : whole * scale].reshape(2, whole, scale).sum(axis=2) / np.sqrt(scale)
        counts.append(float(whole))
        products.append([_lag_products(x[0]), _lag_products(x[1])])
    return Correlations(np.array(counts), np.array(products), np.sum(w**4, axis=1))


def _lag_products(x: FloatArray) -> list[float]:
    """Sums of the products of x (n,) with itself, 0 to `_LAGS` samples later."""
    return [float(x[lag:] @ x[: max(0, x.size - lag)]) for lag in range(_LAGS + 1)]


def judge(sums: Correlations) -> Whiteness:
    """Test innovations for whiteness.

    Parameters
    ----------
    sums : Correlations

    Returns
    -------
    Whiteness
        A joint is white with a p-value of its share at least, and without heavy tails.

    Notes
    -----
    Ljung & Box 1978: n (n + 2) Σ ρ_l² / (n − l) over the lags l is χ² with as many degrees of
    freedom.
    """
    power = np.maximum(sums.products[:, :, :1], 1e-300)
    rho = sums.products[:, :, 1:] / power
    n = sums.count[:, None, None]
    lags = np.arange(1, _LAGS + 1)
    tested = lags < n / 4
    terms = n * (n + 2) * rho**2 / np.maximum(n - lags, 1)
    statistic = np.sum(np.where(tested, terms, 0.0), axis=2)
    p = chi2_tail(np.maximum(tested.sum(axis=2), 1), statistic)
    # In a long log the least colour is significant; one this faint does not move an error bar.
    faint = np.sqrt(np.mean(rho**2, axis=2)) < _FAINT
    p_value = np.minimum(1.0, len(SCALES) * np.where(faint, 1.0, p).min(axis=0))
    variance = power[0, :, 0] / sums.count[0]
    kurtosis = sums.fourth / sums.count[0] / variance**2 - 3
    heavy = (kurtosis > _HEAVY) & (kurtosis > _TAILS * np.sqrt(24 / sums.count[0]))
    first, second = ((p_value >= 0.5 * level("NOT_WHITE")) & ~heavy).tolist()
    return Whiteness(p_value, rho[0, :, 0], kurtosis, (first, second))
