"""Weak-form normal equations with the columns of any terms; every sub-model follows from them.

======  ==================================================================  ====================
symbol  name                                                                shape
======  ==================================================================  ====================
p       coefficients of the columns, the delay, the loaded arm's k1 … k5    (P,)
G       Gram matrices of a log by stretch, joints weighed, the torque last  (B, P + 1, P + 1)
======  ==================================================================  ====================

Loaded logs share every coefficient with unloaded ones save k1 … k5, so that friction is one where
both kinds tell it and no payload need be guessed. Joints weigh by the residual of all columns
together, log by log, whatever the sub-model, so that sub-models compare.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.estimators.combine import long_run_variance, scaled_pinv, scaled_pinvs
from algid.estimators.hold import Lateness
from algid.estimators.modulating_functions import OVERLAP, Known, row_weights
from algid.estimators.too_short import TooShortError
from algid.estimators.weak import Normal, Source, WeakSettings, normal_equations
from algid.model import DELAYS, EVERY_TERM, loads_of, without_delay
from algid.physics.terms import ALWAYS
from algid.signals.segments import Segment, pieces, spread_pieces

IntArray = NDArray[np.int64]
Coefficients = Mapping[str, float]

_PIECES = 8  # of a log, and up to twice as many: what a selection looks at
_PIECE_SAMPLES = 16384
_FOLDS = 5  # blocks of a log, where there are too few logs to leave whole ones out
_FEWEST_LOGS = 3
_REWEIGHTINGS = 4
_STAMPS = 0.01
"""Of a period: what stamps leave open at least, also in the log of a simulator."""
CHANGE = next(iter(DELAYS), "change of the delay")
"""The column of a change of the delay."""


def term_names(term: str) -> tuple[str, ...]:
    """Names of the coefficients of a term, or of the delay."""
    return EVERY_TERM[term].names


@dataclass(frozen=True, eq=False)
class Training:
    """Evenly spread pieces of a log, all of it where it is short."""

    pieces: tuple[Segment, ...]
    loaded: bool
    known: dict[Hashable, Known] = field(default_factory=dict)
    """Moments that the models have in common."""

    @classmethod
    def of(cls, source: Source, loaded: bool) -> Training:
        """The pieces of one pass over a log."""
        every = pieces(source(), _PIECE_SAMPLES)
        return cls(tuple(spread_pieces(every, _PIECES, _PIECE_SAMPLES)[0]), loaded)

    @property
    def driven(self) -> bool:
        """Whether both joints have a torque."""
        return all(any(piece.tau[joint].any() for piece in self.pieces) for joint in (0, 1))

    def segments(self) -> Iterable[Segment]:
        """The pieces, as a source gives them."""
        return self.pieces


class Grams:
    """Normal equations of all logs with the columns of a model and of the delay.

    Parameters
    ----------
    logs : Training of each log
    settings : WeakSettings
    at : coefficients by name, of unloaded and of loaded logs
        Where terms that are not linear are linearised.

    Attributes
    ----------
    open_squares : float
        Sum of squared moments that a torque makes which comes a hundredth of a period late.

    Raises
    ------
    TooShortError
        If no log is long enough for a window.
    """

    def __init__(
        self, logs: Sequence[Training], settings: WeakSettings, at: Mapping[bool, Coefficients]
    ) -> None:
        self.settings = settings = replace(settings, estimate_delay=True)
        self.names = (*settings.model.names, CHANGE)
        loads = loads_of(settings.model)
        self._rigid = [place for place, name in enumerate(self.names) if name in loads]
        normals, periods = [], []
        for log in logs:
            here = np.array([at[log.loaded].get(name, 0.0) for name in settings.model.names])
            normal = normal_equations(log.segments, settings, here, log.known)
            if normal is not None:
                normals.append((log.loaded, normal))
                periods.append(log.pieces[0].dt)
        if not normals:
            raise TooShortError(
                "no log is long enough: expected at least a second of samples without a gap"
            )
        self._dt = max(normal.dt for _, normal in normals)
        self.kinds = {loaded for loaded, _ in normals}
        self._both = len(self.kinds) == 2
        self.size = len(self.names) + self._both * len(self._rigid)
        self._weigh(normals)
        of_delay = self.names.index(CHANGE)
        self.open_squares = sum(
            (_STAMPS * dt) ** 2 * float(gram[:, of_delay, of_delay].sum())
            for gram, dt in zip(self._logs, periods, strict=True)
        )
        whole = all(
            sum(loaded is kind for loaded, _ in normals) >= _FEWEST_LOGS for kind in self.kinds
        )
        self.held_out: Literal["logs", "blocks"] = "logs" if whole else "blocks"
        parts = 1 if whole else _FOLDS
        self._folds = np.array(
            [
                part.sum(axis=0)
                for gram in self._logs
                for part in np.array_split(gram, parts)
                if len(part)
            ]
        )
        self._total = self._folds.sum(axis=0)
        self._squares: dict[tuple[int, ...], float] = {}
        self._spreads: dict[
            tuple[int, ...], tuple[FloatArray, tuple[FloatArray, FloatArray], int]
        ] = {}

    def _weigh(self, normals: Sequence[tuple[bool, Normal]]) -> None:
        weights: list[FloatArray] = [np.ones(2) for _ in normals]
        whole = [normal.gram.sum(axis=0) for _, normal in normals]
        for _ in range(_REWEIGHTINGS):
            total = np.zeros((self.size + 1, self.size + 1))
            for (loaded, normal), w in zip(normals, weights, strict=True):
                rows = self._rows(loaded)
                total[rows] += np.einsum("a,baxy->xy", w, normal.gram)
            p = _solved(total, np.arange(self.size))
            weights = [
                row_weights(gram, np.append(-p[self._places(loaded)], 1.0), normal.rows)
                for (loaded, normal), gram in zip(normals, whole, strict=True)
            ]
        # Overlapping rows repeat each other: a window's worth of rows counts as two.
        share = 2.0 / OVERLAP
        self._logs = [
            self._wide(loaded, np.einsum("a,baxy->bxy", share * w, normal.gram))
            for (loaded, normal), w in zip(normals, weights, strict=True)
        ]
        self.cost = -sum(
            share * float(normal.rows @ np.log(w))
            for (_, normal), w in zip(normals, weights, strict=True)
        )

    def _places(self, loaded: bool) -> IntArray:
        """Where a log's coefficients stand in p."""
        places = np.arange(len(self.names))
        if loaded and self._both:
            places[self._rigid] = len(self.names) + np.arange(len(self._rigid))
        return places

    def _wide(self, loaded: bool, gram: FloatArray) -> FloatArray:
        """Gram matrices (B, P + 1, P + 1) in p of a log's (B, q + 1, q + 1)."""
        wide = np.zeros((len(gram), self.size + 1, self.size + 1))
        wide[:, *self._rows(loaded)] = gram
        return wide

    def _rows(self, loaded: bool) -> tuple[IntArray, IntArray]:
        """Where rows and columns of a log's Gram matrix stand, the torque's last."""
        rows = np.append(self._places(loaded), self.size)
        return rows[:, None], rows

    def _columns(self, terms: Iterable[str], *others: str) -> IntArray:
        """Places in p of eq. (1), of `terms`, and of `others` by name."""
        names = {name for term in terms for name in term_names(term)}.union(others)
        names |= {name for term in ALWAYS for name in term.names}
        return np.array(self._named(names))

    def coefficients(self, terms: Iterable[str]) -> dict[bool, dict[str, float]]:
        """The sub-model's coefficients by name, of unloaded (False) and of loaded logs (True).

        A kind of which there is no log has those of the other.
        """
        p = _solved(self._total, self._columns(terms))
        by_kind = {
            kind: dict(zip(self.names, p[self._places(kind)].tolist(), strict=True))
            for kind in self.kinds
        }
        return {kind: by_kind.get(kind, next(iter(by_kind.values()))) for kind in (False, True)}

    def held_out_squares(self, terms: Iterable[str]) -> float:
        """Sum of squared prediction errors of moments of logs or blocks, each from the others."""
        columns = self._columns(terms)
        key = tuple(columns.tolist())  # each sub-model is asked for beside every term that it lacks
        if key not in self._squares:
            rest = self._total - self._folds
            p = np.einsum(
                "nij,nj->ni",
                scaled_pinvs(rest[:, columns[:, None], columns]),
                rest[:, columns, -1],
            )
            v = np.concatenate([-p, np.ones((len(p), 1))], axis=1)
            own = [*columns.tolist(), -1]
            kept = self._folds[np.ix_(range(len(p)), own, own)]
            self._squares[key] = float(np.einsum("ni,nij,nj->", v, kept, v, optimize=True))
        return self._squares[key]

    def wald(self, terms: Sequence[str], among: Sequence[str]) -> tuple[float, int, float]:
        """Wald statistic of the coefficients of `terms` in the sub-model with the terms `among`.

        Loaded logs have some of their own: a payload may lie off a link's line that is straight.

        Returns
        -------
        The smaller of the Wald statistics bᵀ V⁻¹ b by the plain and by the sandwich covariance V,
        the coefficients b, and the independent stretches of log behind them.
        """
        columns = self._columns(among)
        key = tuple(columns.tolist())  # each sub-model is asked for by every term that it has
        if key not in self._spreads:
            self._spreads[key] = self._spread(columns)
        value, covariances, stretches = self._spreads[key]
        names = {name for term in terms for name in term_names(term)}
        own = np.flatnonzero(np.isin(columns, self._named(names)))
        solutions = [
            float(value[own] @ scaled_pinv(S[np.ix_(own, own)]) @ value[own]) for S in covariances
        ]
        return min(solutions), own.size, float(stretches)

    def lateness(self, terms: Iterable[str]) -> Lateness:
        """How late the torque acts in the sub-model with `terms`.

        Its deviation is the larger of those by white noise and by the sandwich.
        """
        columns = self._columns(without_delay(terms), CHANGE)
        value, covariances, _ = self._spread(columns)
        own = np.flatnonzero(columns == self.names.index(CHANGE))
        variance = max(float(covariance[own[0], own[0]]) for covariance in covariances)
        # what a delay that is left out adds to the others, beside their deviations
        rest, column = np.delete(columns, own), columns[own[0]]
        _, beside, _ = self._spread(rest)
        slope = scaled_pinv(self._total[np.ix_(rest, rest)]) @ self._total[rest, column]
        size = np.sqrt(np.max([np.diag(covariance) for covariance in beside], axis=0))
        return Lateness(
            self.settings.shift.delay + float(value[own[0]]),
            float(np.sqrt(max(variance, 0.0))),
            0.5 * self._dt,
            float(np.max(np.abs(slope) / np.maximum(size, 1e-300))),
        )

    def _named(self, names: set[str]) -> list[int]:
        """Places in p of coefficients by name, the loaded arm's with them."""
        basic = [place for place, name in enumerate(self.names) if name in names]
        loaded = [
            len(self.names) + row
            for row, place in enumerate(self._rigid)
            if self.names[place] in names
        ]
        return [*basic, *(loaded if self._both else [])]

    def _spread(self, columns: IntArray) -> tuple[FloatArray, tuple[FloatArray, FloatArray], int]:
        """Least squares on `columns`, plain and sandwich covariance, independent stretches."""
        inverse = scaled_pinv(self._total[np.ix_(columns, columns)])
        value = inverse @ self._total[columns, -1]
        meat, stretches = np.zeros_like(inverse), 0
        for gram in self._logs:
            variance, lags = long_run_variance(
                gram[:, columns, -1] - gram[:, columns[:, None], columns] @ value
            )
            meat += variance
            stretches += len(gram) // (lags + 1)
        stretches = max(stretches, len(columns) + 2)
        return (
            value,
            (inverse, inverse @ meat @ inverse * (stretches / (stretches - len(columns)))),
            stretches,
        )


def _solved(gram: FloatArray, columns: IntArray) -> FloatArray:
    """P (P,) of least squares with the columns given, zero elsewhere."""
    p = np.zeros(len(gram) - 1)
    p[columns] = scaled_pinv(gram[np.ix_(columns, columns)]) @ gram[columns, -1]
    return p
