"""What CAD or an earlier result says of k1 … k5: a normal prior, beside which logs are evidence.

Masses m, centres of mass l_c, inertias I and link 1's length of a drawing are wrong by independent
shares. With D the derivatives of the constants by them and σ their errors, by Table 1,

    k1 = m2 l1 lc2   k2 = g m2 lc2   k3 = I2 + m2 lc2²
    k4 = g (m1 lc1 + m2 l1)          k5 = I1 + m1 lc1² + m2 l1²
    P = D diag(σ²) Dᵀ,   σ_m = e m,   σ_I = e I,   σ_lc = e max(|lc|, √(I / m)),   σ_l1 = 0.01 l1

A balanced link's centre may be off as well, by as large a share of its radius of gyration.

**Logs and prior.** With W the covariance of the logs' estimates c of these constants and B a basis
of the combinations that they determine, their information is J, and both together say

    J = B (Bᵀ W B)⁻¹ Bᵀ,   V = (J + P⁻¹)⁻¹,   k = m + V J (c − m)

Other parameters follow by their covariance with c. A constant is from the prior where the logs
leave it open or doubtful, or where V is more than half of P: the logs tell less of it than the
prior does. The logs are expected to move k from m by P − V, and contradict the prior beyond that.

======  =====================================  =======
symbol  name                                   shape
======  =====================================  =======
m, P    the prior's mean, its covariance       (n, n)
e       relative error of a drawing            scalar
c, W    the logs' estimates, their covariance  (n, n)
k, V    what both say, its covariance          (n, n)
======  =====================================  =======
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from algid.arm import Arm, FloatArray
from algid.base.criteria import SAME_LENGTH, STILL
from algid.base.errors import ResultError, SettingError
from algid.base.names import outside, places_outside, vector
from algid.base.significance import LEVEL, chance
from algid.estimators.combine import likelihood, scaled_pinv
from algid.estimators.fit import Fit
from algid.estimators.identifiability import SHARE, open_directions
from algid.identification.known import covariance_of, with_error_bar
from algid.identification.urdf import arm_of
from algid.model import RIGID, UNITS
from algid.notices import Notice
from algid.options import flag
from algid.physics.effort import absent
from algid.results import read_result
from algid.settings import Settings

ERROR = 20.0
"""Per cent by which a drawing is wrong where nothing else is said."""
_HALF = 0.5  # of the prior's variance: what is wider is more the prior's than the logs'
_UNMOVED = 1e-3  # of the prior's standard deviation: a smaller expected move contradicts nothing


@dataclass(frozen=True, eq=False)
class Statement:
    """What a file says of constants: its name, theirs, their mean (n,) and covariance (n, n)."""

    file: str
    names: tuple[str, ...]
    mean: FloatArray
    covariance: FloatArray

    def without(self, names: tuple[str, ...]) -> Statement:
        """What it says of the other constants, whatever those of the `names` are."""
        kept = places_outside(self.names, names)
        covariance = self.covariance[np.ix_(kept, kept)]
        return Statement(self.file, outside(self.names, names), self.mean[kept], covariance)


def statement_of(settings: Settings) -> Statement | None:
    """What the settings' prior says of the constants that the torque holds; None without one.

    Raises
    ------
    ResultError
        If its file is neither a URDF of such an arm nor a result with error bars.
    SettingError
        If an error is given for a result, which has its own.
    """
    if settings.prior is None:
        return None
    file, error = settings.prior, settings.prior_error
    if Path(file).suffix.lower() == ".urdf":
        arm = replace(arm_of(Path(file))[0], g=settings.gravity)
        covariance = drawn_covariance(arm, (ERROR if error is None else error) / 100)
        said = Statement(file, RIGID, arm.constants()[: len(RIGID)], covariance)
    else:
        if error is not None:
            raise SettingError(
                f"{flag('prior_error')}: {file} is a result, which has error bars; leave it out"
            )
        try:
            result = read_result(file)
        except ResultError as wrong:
            raise ResultError(f"{flag('prior')}: no URDF by its name, and {wrong}") from wrong
        names = with_error_bar(result, RIGID)
        if not names:
            raise ResultError(f"{file}: the result has no error bars of k1 … k5; give another one")
        value = {name: result.parameters[name].estimate or 0.0 for name in names}
        said = Statement(file, names, vector(names, value), covariance_of(result, names, names))
    gone = absent(settings.effort, RIGID)
    if settings.gravity == 0:
        gone += absent("gravity-compensated", RIGID)
    return said.without(gone)


def drawn_covariance(arm: Arm, error: float) -> FloatArray:
    """Covariance P (5, 5) of k1 … k5 of a drawn arm, of which masses and more err by that share."""
    moves = []
    for name in ("m1", "m2", "lc1", "lc2", "I1", "I2", "l1"):
        value = getattr(arm, name)
        step = error * abs(value)
        if name == "l1":
            step = SAME_LENGTH * value
        elif name in ("lc1", "lc2"):
            number = name[-1]
            gyration = np.sqrt(getattr(arm, f"I{number}") / getattr(arm, f"m{number}"))
            step = error * max(abs(value), float(gyration))
        # the constants are polynomials of second order in each: central differences are exact
        more, less = (replace(arm, **{name: value + sign * step}) for sign in (1, -1))
        moves.append((more.constants() - less.constants())[: len(RIGID)] / 2)
    D = np.transpose(moves)
    return np.asarray(D @ D.T)


def with_prior(fit: Fit, said: Statement) -> Fit:
    """The fit with what a file says of k1 … k5, and the status FROM_PRIOR for what is its more.

    Where the logs contradict it by more than chance, the fit as it is, with a notice of that.

    Parameters
    ----------
    fit : Fit
        Of logs alone, with its doubts.
    said : Statement
    """
    said = said.without(outside(said.names, outside(fit.names, fit.absent)))
    if not fit.converged or not said.names:
        return fit
    places = [fit.names.index(name) for name in said.names]
    others = places_outside(range(len(fit.names)), places)
    W, P, m = fit.covariance, said.covariance, said.mean
    # an arm at rest tells its weight: what noise makes of accelerations is no inertia
    weight = absent("gravity-compensated", RIGID) if (fit.moved < STILL).all() else RIGID
    doubtful = [fit.status[p] != "OK" or fit.names[p] not in weight for p in places]
    B = _determined(fit, places, doubtful)
    J = B @ scaled_pinv(B.T @ W[np.ix_(places, places)] @ B) @ B.T
    V = scaled_pinv(J + scaled_pinv(P))
    k = m + V @ J @ (fit.values[places] - m)
    # P − V, how far logs are expected to move the constants
    expected = np.sqrt(np.maximum(np.diag(P - V), 0.0))
    std = np.sqrt(np.diag(P))
    known = expected > _UNMOVED * std
    distance = np.abs(k - m) / np.where(known, expected, np.inf)
    most = int(np.argmax(distance))
    if chance(float(distance[most]), len(places)) < LEVEL:
        numbers = {
            "case": "prior",
            "name": said.names[most],
            "file": said.file,
            "given": float(m[most]),
            "std": float(std[most]),
            "unit": UNITS[said.names[most]],
            "estimate": float(k[most]),
            "distance": float(distance[most]),
        }
        return fit.noted(Notice("OTHER_ARM", numbers=numbers))
    values, covariance = fit.values.copy(), W.copy()
    A = W[np.ix_(others, places)] @ J
    values[places] = k
    values[others] += A @ (k - fit.values[places])
    covariance[np.ix_(places, places)] = V
    covariance[np.ix_(others, places)] = A @ V
    covariance[np.ix_(places, others)] = (A @ V).T
    covariance[np.ix_(others, others)] -= A @ (W[np.ix_(places, places)] - V) @ A.T
    status = list(fit.status)
    for place, vague, own, before in zip(places, doubtful, np.diag(V), np.diag(P), strict=True):
        if vague or own > _HALF * before:
            status[place] = "FROM_PRIOR"
    return replace(fit, values=values, covariance=covariance, status=tuple(status))


def _determined(fit: Fit, places: list[int], doubtful: list[bool]) -> FloatArray:
    """Basis B (n, r) of the combinations of the parameters at n `places` that logs determine.

    They hold nothing of those that are `doubtful`.
    """
    information = likelihood(fit.shared, fit.logs, fit.values, fit.prior)[2]
    bounded = fit.absent + (() if fit.shrinkage is None else fit.shrinkage.names)
    free = places_outside(fit.names, bounded)
    if bounded:
        information = scaled_pinv(scaled_pinv(information)[np.ix_(free, free)])
    null, size = open_directions(outside(fit.names, bounded), fit.values[free], information)
    own = [free.index(place) for place in places]
    lost, share, _ = np.linalg.svd(np.hstack([null[own], np.diag(np.array(doubtful, float))]))
    return lost[:, np.count_nonzero(share > SHARE) :] / size[own][:, None]
