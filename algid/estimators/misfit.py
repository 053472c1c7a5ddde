"""Whether the likelihood holds: the noise that it leaves, and how that depends on the motion.

The likelihood takes the level of the torque's noise from the logs. A torque that the model lacks
makes that level grow, and the error bars with it, by less than it moves the estimates. Where it is
far beyond what neighbouring samples differ by, no sensor has such noise. Of less, Rao's score test
(1948) sees it: of torques G that a motion makes, beside those of the model, the residual e has

    b = GᵀV⁻¹e - XᵀS⁻¹ YᵀV⁻¹e,   W = bᵀ M⁺ b,   M = GᵀV⁻¹G - XᵀS⁻¹X,   X = YᵀV⁻¹G

and W is χ² of rank(M) degrees of freedom where the model holds. G has the columns of the terms
that the model is without, one of a delay, and shapes that no term has: friction of gears by all
torque that passes them, a motor that saturates or has a dead band, drag of the air, springs (a
cable, a hose), cogging and other pull by the joint's angle, friction that changes along a turn, and
what one drive does to the other joint.

A controller makes torque of its encoders' noise, which the residual holds too: that they correlate
looks like a delay of the torque. Such a torque is fast: the columns are those of the smooth motion.

======  =================================================  ================  =================
symbol  name                                               shape             unit
======  =================================================  ================  =================
Y       columns of the parameters                          (2 n, Q)          N m / parameter's
G       torques beside them                                (2 n, m)          N m
======  =================================================  ================  =================
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray, keep_arrays
from algid.base.compiled import chi2_tail
from algid.base.names import places_outside, vector, within
from algid.estimators.combine import RANK_TOLERANCE, scaled_pinv
from algid.estimators.hold import Lateness
from algid.estimators.log_likelihood import Beside, LogEvidence
from algid.estimators.parametrisation import Shared
from algid.model import (
    DELAYS,
    EVERY_TERM,
    TERMS,
    Model,
    Motion,
    acting,
    loads_of,
    names_of,
    regressor,
    smooth_sign,
    terms_named,
    torque,
    widths_in,
    without_delay,
)
from algid.physics.signals import WIDTHS
from algid.physics.terms import ALWAYS

if TYPE_CHECKING:
    from algid.estimators.fit import Fit

TERM_OF = {name: term for term, entry in EVERY_TERM.items() for name in entry.names}
_STAMPS = 0.01
"""Of a period: what stamps leave open at least, also in the log of a simulator."""
_STEP = 1e-3
"""Relative change of a width of friction by which its effect is differentiated."""


def widened(model: Model, c: FloatArray, motion: Motion, _dt: float) -> FloatArray:
    """Derivatives (widths, 2, n) of the torque by the logarithms of friction's widths, in N m."""

    def at(width: str, step: float) -> FloatArray:
        value = getattr(model, width) * (1 + step)
        return torque(replace(model, **{width: value}), c, motion)

    return np.stack([(at(one, _STEP) - at(one, -_STEP)) / (2 * _STEP) for one in WIDTHS])


At = Mapping[bool, Mapping[str, float]]
"""Coefficients by name, of unloaded and of loaded logs."""


class Products:
    """Normal equations of one pass of the likelihood, with the columns of every term.

    Parameters
    ----------
    logs : Sequence of LogEvidence
    model : Model
        A lag is among the terms if it is one of the model's.
    at : coefficients by name, of unloaded and of loaded logs
        Where it is linearised; others are zero.
    base : float, s
        The delay from which the column of the delay counts.
    beside : Beside
        `widened`, and what other torques are to be in `each`.

    `names` are those of the coefficients, of every term and widths; `each` has for a log whether it
    is loaded, and the products of its columns, the torques beside them and the residual.
    """

    def __init__(
        self,
        logs: Sequence[LogEvidence],
        model: Model,
        at: At,
        base: float,
        beside: Beside = widened,
    ) -> None:
        every = tuple(name for name, term in TERMS.items() if not term.lags or name in model.terms)
        self.shared = Shared(replace(model, terms=every), delay=True)
        self.names = (*self.shared.log_names, *WIDTHS)
        rigid = within(self.names, loads_of(self.shared.model))
        both = len({log.loaded for log in logs}) == 2
        self._labels = self.names + both * rigid
        self.size = len(self._labels)
        self._base = base
        self.determinant = 0.0
        self.each: list[tuple[bool, FloatArray]] = []
        grams, q = [], len(self.shared.log_names)
        driven = np.any([piece.tau.any(axis=1) for log in logs for piece in log.kept], axis=0)
        for log in logs:
            c = vector(self.names, {DELAYS[0]: base, **at[log.loaded]}, otherwise=0.0)
            gram, determinant = log.products(self.shared, c[:q], beside)
            if not driven.all():
                # where a joint has no motor, its gain is nothing and makes its equation vanish
                for place, _ in acting(self.shared.model, "gains"):
                    gram[:, place] = gram[:, :, place] = 0
            self.determinant += determinant
            self.each.append((log.loaded, gram.sum(axis=0)))
            # the torque itself in the place of what the point of linearisation leaves of it
            c[q - 1] -= base
            to_p = np.zeros((gram.shape[-1], self.size + 1))
            to_p[np.arange(c.size), self._places(log.loaded)] = 1
            to_p[: c.size, -1] = c
            to_p[-1, -1] = 1
            grams.append(to_p.T @ gram @ to_p)
        self._grams = np.array(grams)
        self.total = self._grams.sum(axis=(0, 1))
        self.samples = sum(log.trained for log in logs)
        self.dt = max(log.kept[0].dt for log in logs)
        of_delay = self.names.index(DELAYS[0])
        self.open_squares = (_STAMPS * self.dt) ** 2 * float(self.total[of_delay, of_delay])
        self.noisy = self.open_squares < self.samples
        keep_arrays(self)  # a fit hands it on

    def _places(self, loaded: bool) -> list[int]:
        """Where a log's coefficients and widths stand in p."""
        last = {label: place for place, label in enumerate(self._labels)}
        return [last[name] if loaded else place for place, name in enumerate(self.names)]

    def columns(self, terms: Collection[str]) -> NDArray[np.int64]:
        """Places in p of eq. (1), of `terms` and of their widths."""
        present = names_of(terms_named(terms))
        return self._named([*names_of(ALWAYS), *present, *widths_in(terms)])

    def own(self, term: str) -> NDArray[np.int64]:
        """Places in p of the coefficients of one term."""
        return self._named(EVERY_TERM[term].names)

    def _named(self, names: Collection[str]) -> NDArray[np.int64]:
        """Places in p of coefficients by name, the loaded arm's with them."""
        return np.flatnonzero([label in names for label in self._labels])

    def solve(self, columns: NDArray[np.int64]) -> tuple[FloatArray, float, FloatArray]:
        """Least squares on `columns`: p (P,), the squares left, and the inverse of its matrix.

        Squares that are nothing but the rounding of the torque's count as none.
        """
        inverse = scaled_pinv(self.total[np.ix_(columns, columns)])
        p = np.zeros(self.size)
        p[columns] = inverse @ self.total[columns, -1]
        v = np.append(-p, 1.0)
        left = float(v @ self.total @ v)
        return p, left if left > RANK_TOLERANCE * self.total[-1, -1] else 0.0, inverse

    def explained(self, own: NDArray[np.int64], rest: NDArray[np.int64]) -> float:
        """By how much columns `own` lower the squares beside the columns `rest`."""
        M, b = left_beside(self.total, rest, own[~np.isin(own, rest)])
        return float(b @ scaled_pinv(M) @ b)

    def coefficients(self, p: FloatArray) -> At:
        """Coefficients by name of unloaded and of loaded logs, the delay whole."""
        at = {}
        for loaded in (False, True):
            c = p[self._places(loaded)].tolist()
            at[loaded] = dict(zip(self.shared.log_names, c, strict=False))
            at[loaded][DELAYS[0]] += self._base
        return at

    def mean_square(self, columns: NDArray[np.int64]) -> float:
        """Mean square of what `columns` leave, 1 where the model holds; no less."""
        _, left, _ = self.solve(columns)
        return max(1.0, left / max(2 * self.samples - len(columns), 1))

    def levels(
        self, logs: Sequence[LogEvidence], columns: NDArray[np.int64]
    ) -> Iterator[FloatArray]:
        """What `columns` leave of each log's torques, RMS (2,) in N m."""
        p, _, _ = self.solve(columns)
        v = np.append(-p, 1.0)
        for log, gram in zip(logs, self._grams, strict=True):
            left = np.maximum(np.einsum("i,aij,j->a", v, gram, v), 0.0)
            yield log.noise.tau * np.sqrt(left / log.trained)

    def lateness(self, terms: Sequence[str]) -> Lateness:
        """How late the torque acts in the model with `terms`."""
        rest = self.columns(without_delay(terms))
        delay = self.names.index(DELAYS[0])
        columns = np.append(rest, delay)
        scale = self.mean_square(columns)
        p, _, inverse = self.solve(columns)
        return Lateness(
            self._base + float(p[delay]),
            float(np.sqrt(scale * max(inverse[-1, -1], 0.0))),
            0.5 * self.dt,
            float(np.max(self.effect(delay, rest, scale))),
        )

    def effect(self, place: int, rest: NDArray[np.int64], scale: float) -> FloatArray:
        """By how many of its deviations each coefficient of `rest` (R,) moves without another one.

        For a unit of that at `place`; `scale` is the mean square of what is left.
        """
        _, _, inverse = self.solve(rest)
        size = np.sqrt(scale * np.maximum(np.diag(inverse), 0.0))
        return np.abs(inverse @ self.total[rest, place]) / np.maximum(size, 1e-300)


_KINDS = {
    "gears": 1,
    "saturation": 1,
    "dead band": 1,
    "drag": 1,
    "spring": 1,
    "once a turn": 2,
    "twice a turn": 2,
    "friction along a turn": 2,
    "the other joint": 3,
}
"""What makes torques of a joint in shapes that no term has, and how many each: `of_no_term`."""
_OWN = 1e-6
"""Share of a torque beside the parameters' columns: with less it is one of theirs."""
_CANCELS = 0.02
"""Share of its terms that a torque is where they cancel."""
_ALIKE = 1e-5
"""Share of the largest eigenvalue: along smaller ones the torques repeat each other."""


def shapes(model: Model, c: FloatArray, motion: Motion, dt: float) -> FloatArray:
    """What friction's widths change, and torques of one joint each in shapes that no term has."""
    own = of_no_term(model, _acting(model, c, motion), motion)
    return np.concatenate([widened(model, c, motion, dt), own])


def of_no_term(model: Model, acting: FloatArray, motion: Motion) -> FloatArray:
    """Torques (m, 2, n) of one joint each, in shapes that no term has, where (2, n) N m act."""
    theta, omega = motion.theta, motion.omega
    sine, cosine, sign = np.sin(theta), np.cos(theta), smooth_sign(model, omega)
    both = [  # in the order of `_KINDS`
        np.abs(acting) * sign,
        np.abs(acting) * acting,
        np.sign(acting),
        np.abs(omega) * omega,
        theta - theta.mean(axis=1, keepdims=True),
        sine,
        cosine,
        np.sin(2 * theta),
        np.cos(2 * theta),
        sine * sign,
        cosine * sign,
        sign[::-1],
        omega[::-1],
        motion.alpha[::-1],
    ]
    alone = np.zeros((2, len(both), *acting.shape))
    alone[[0, 1], :, [0, 1]] = np.stack(both, axis=1)
    return alone.reshape(-1, *acting.shape)


def _acting(model: Model, c: FloatArray, motion: Motion) -> FloatArray:
    """The torque (2, n) in N m; nothing where its terms cancel, whose sum then is their noise.

    A joint without a motor has no torque that friction or a motor's faults could depend on.
    """
    parts = regressor(model, motion, c) * c[:, None]
    T = parts.sum(axis=1)
    size = np.sqrt(np.sum(np.mean(parts**2, axis=2), axis=1))
    return np.where(np.sqrt(np.mean(T**2, axis=1)) > _CANCELS * size, T.T, 0.0).T


def misfit(
    logs: Sequence[LogEvidence],
    levels: Iterable[FloatArray],
    fit: Fit | None = None,
    products: Products | None = None,
) -> float:
    """The p value of the test of the model.

    0, its extreme, where the torques' errors are no sensor's noise. Else that of the score test of
    a fit: of all torques beside the model's together, and of the most evident kind (Bonferroni).

    Parameters
    ----------
    logs : Sequence of LogEvidence
    levels : (2,) in N m
        Errors of each log's torques.
    fit : Fit, optional
        By the likelihood.
    products : Products, optional
        Of some of its logs, at its estimates, with the torques `shapes`.
    """
    if any(log.exceeds_noise(level) for log, level in zip(logs, levels, strict=True)):
        return 0.0
    if fit is None or products is None:
        return 1.0
    shared, names = fit.shared, products.names
    present = [names.index(name) for name in shared.log_names]
    absent = places_outside(names, [*shared.log_names, *WIDTHS])
    # friction's widths are estimated beside the parameters
    free = [names.index(name) for name in WIDTHS]
    torques = np.tile(np.repeat(list(_KINDS), list(_KINDS.values())), 2)
    kinds = np.concatenate([[TERM_OF[names[place]] for place in absent], torques])
    rest = [*free, *absent, *range(len(names), len(names) + torques.size), -1]
    Q, whole = len(fit.names), np.zeros(())
    for loaded, gram in products.each:
        by_shared = np.zeros((len(gram), Q + len(rest)))
        by_shared[present, :Q] = shared.jacobian(fit.values, loaded)
        by_shared[rest, Q + np.arange(len(rest))] = 1
        whole = whole + by_shared.T @ gram @ by_shared
    if fit.prior is not None:
        known = fit.prior.places(fit.names)
        whole[np.ix_(known, known)] += fit.prior.precision
    taken, tried = np.split(np.arange(len(whole) - 1), [Q + len(free)])
    M, b = left_beside(whole, taken, tried)
    beside = np.diag(M) > _OWN * np.diag(whole)[tried]
    p_values = []
    for own in (beside, *(beside & (kinds == kind) for kind in dict.fromkeys(kinds[beside]))):
        rank, statistic = _score(M, b, np.flatnonzero(own))
        p_values.append(float(chi2_tail(max(rank, 1), statistic)))
    together, *alone = p_values
    return min(1.0, 2 * together, 2 * len(alone) * min(alone, default=1.0))


def left_beside(
    total: FloatArray, taken: NDArray[np.int64], own: NDArray[np.int64]
) -> tuple[FloatArray, FloatArray]:
    """M (m, m) and b (m,) of columns `own` beside those `taken`, by the products of all columns.

    The last column is the residual.
    """
    both = np.append(own, -1)
    cross = total[np.ix_(taken, both)]
    left = total[np.ix_(both, both)] - cross.T @ scaled_pinv(total[np.ix_(taken, taken)]) @ cross
    return left[:-1, :-1], left[:-1, -1]


def _score(M: FloatArray, b: FloatArray, own: NDArray[np.int64]) -> tuple[int, float]:
    """Rank and statistic of the score along the torques `own`."""
    along, among = b[own], M[np.ix_(own, own)]
    inverse = scaled_pinv(among, _ALIKE)
    return round(float(np.sum(inverse * among))), float(along @ inverse @ along)
