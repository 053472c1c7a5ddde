"""Weak-form normal equations with the columns of any terms; every sub-model follows from them.

======  ==================================================================  ====================
symbol  name                                                                shape
======  ==================================================================  ====================
p       coefficients of the columns, the delay, the loaded arm's k1 … k5    (P,)
G       Gram matrices of a log by stretch, joints weighed, the torque last  (B, P + 1, P + 1)
======  ==================================================================  ====================

Loaded logs share every coefficient with unloaded ones save k1 … k5, so that friction is one where
both kinds determine it and no payload need be guessed. Joints weigh by the residual of all columns
together, log by log, whatever the sub-model, so that sub-models compare.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from algid.arm import FloatArray
from algid.base.names import vector
from algid.estimators.combine import long_run_variances, scaled_pinv, scaled_pinvs
from algid.estimators.hold import Lateness
from algid.estimators.modulating_functions import OVERLAP, Known, row_weights
from algid.estimators.too_short import OF_A_WINDOW, TooShortError
from algid.estimators.weak import Normal, Source, WeakSettings, normal_equations
from algid.model import DELAYS, loads_of, names_of, terms_named, without_delay
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


@dataclass(frozen=True, eq=False)
class Training:
    """Evenly spread pieces of a log, the `whole` of it where it is short."""

    pieces: tuple[Segment, ...]
    loaded: bool
    whole: bool = True
    known: dict[Hashable, Known] = field(default_factory=dict)
    """Moments that the models have in common."""

    @classmethod
    def of(cls, source: Source, loaded: bool) -> Training:
        """The pieces of one pass over a log."""
        every = pieces(source(), _PIECE_SAMPLES)
        spread, whole = spread_pieces(every, _PIECES, _PIECE_SAMPLES)
        return cls(tuple(spread), loaded, whole)

    @cached_property
    def half(self) -> Training:
        """Every second piece, enough for a shape; a log that is short is not halved.

        The moments of a piece are those of the same piece here.
        """
        if self.whole:
            return self
        return replace(self, pieces=self.pieces[::2])

    @property
    def driven(self) -> bool:
        """Whether both joints have a torque."""
        moved = np.zeros(2, dtype=bool)
        for piece in self.pieces:
            moved |= np.any(piece.tau, axis=1)
        return bool(moved.all())

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
        columns = settings.model.names
        self.names = (*columns, CHANGE)
        self._rigid = np.flatnonzero(np.isin(self.names, loads_of(settings.model)))
        normals, periods = [], []
        for log in logs:
            here = vector(columns, at[log.loaded], otherwise=0.0)
            normal = normal_equations(log.segments, settings, here, log.known)
            if normal is not None:
                normals.append((log.loaded, normal))
                periods.append(log.pieces[0].dt)
        if not normals:
            raise TooShortError(f"no {OF_A_WINDOW}")
        self._dt = max(normal.dt for _, normal in normals)
        logs_of = Counter(loaded for loaded, _ in normals)
        self.kinds = set(logs_of)
        self._both = len(self.kinds) == 2
        self.size = len(self.names) + self._both * len(self._rigid)
        self._weigh(normals)
        of_delay = self.names.index(CHANGE)
        self.open_squares = 0.0
        for gram, dt in zip(self._logs, periods, strict=True):
            self.open_squares += (_STAMPS * dt) ** 2 * float(gram[:, of_delay, of_delay].sum())
        self.held_out: Literal["logs", "blocks"] = "logs"
        parts = 1
        if min(logs_of.values()) < _FEWEST_LOGS:
            self.held_out = "blocks"
            parts = _FOLDS
        folds = []
        for gram in self._logs:
            for part in np.array_split(gram, parts):
                if len(part):
                    folds.append(part.sum(axis=0))
        self._folds = np.array(folds)
        self._total = self._folds.sum(axis=0)
        self._squares: dict[tuple[int, ...], float] = {}
        self._spreads: dict[
            tuple[int, ...], tuple[FloatArray, tuple[FloatArray, FloatArray], int]
        ] = {}

    def _weigh(self, normals: Sequence[tuple[bool, Normal]]) -> None:
        whole = np.stack([normal.gram.sum(axis=0) for _, normal in normals])
        rows = np.stack([normal.rows for _, normal in normals])
        is_loaded = np.array([loaded for loaded, _ in normals])
        kinds = [(kind, np.flatnonzero(is_loaded == kind)) for kind in self.kinds]
        weights = np.ones((len(normals), 2))
        for _ in range(_REWEIGHTINGS):
            total = np.zeros((self.size + 1, self.size + 1))
            for loaded, own in kinds:
                total[self._rows(loaded)] += np.einsum("na,naxy->xy", weights[own], whole[own])
            p = _solved(total, np.arange(self.size))
            for loaded, own in kinds:
                signs = np.append(-p[self._places(loaded)], 1.0)
                weights[own] = row_weights(whole[own], signs, rows[own])
        # Overlapping rows repeat each other: a window's worth of rows counts as two.
        share = 2.0 / OVERLAP
        self._logs: list[FloatArray] = []
        for (loaded, normal), w in zip(normals, weights, strict=True):
            gram = np.einsum("a,baxy->bxy", share * w, normal.gram)
            self._logs.append(self._wide(loaded, gram))
        self.cost = -share * float(np.sum(rows * np.log(weights)))

    @cached_property
    def _alike(self) -> list[FloatArray]:
        """Gram matrices (n, B, P + 1, P + 1) of logs with as many stretches."""
        by_length: dict[int, list[FloatArray]] = {}
        for gram in self._logs:
            by_length.setdefault(len(gram), []).append(gram)
        return [np.stack(alike) for alike in by_length.values()]

    def _places(self, loaded: bool) -> IntArray:
        """Where a log's coefficients stand in p."""
        places = np.arange(len(self.names))
        if loaded and self._both:
            places[self._rigid] = len(self.names) + np.arange(len(self._rigid))
        return places

    def _wide(self, loaded: bool, gram: FloatArray) -> FloatArray:
        """Gram matrices (B, P + 1, P + 1) in p of a log's (B, q + 1, q + 1)."""
        if not self._both:
            return gram
        wide = np.zeros((len(gram), self.size + 1, self.size + 1))
        wide[:, *self._rows(loaded)] = gram
        return wide

    def _rows(self, loaded: bool) -> tuple[IntArray, IntArray]:
        """Where rows and columns of a log's Gram matrix stand, the torque's last."""
        rows = np.append(self._places(loaded), self.size)
        return rows[:, None], rows

    def _columns(self, terms: Iterable[str], *others: str) -> IntArray:
        """Places in p of eq. (1), of `terms`, and of `others` by name."""
        own = names_of(terms_named(terms))
        return self._named(names_of(ALWAYS) + own + others)

    def coefficients(self, terms: Iterable[str]) -> dict[bool, dict[str, float]]:
        """The sub-model's coefficients by name, of unloaded (False) and of loaded logs (True).

        A kind of which there is no log has those of the other.
        """
        p = _solved(self._total, self._columns(terms))
        unloaded, loaded = p[self._places(False)].tolist(), p[self._places(True)].tolist()
        return {
            False: dict(zip(self.names, unloaded, strict=True)),
            True: dict(zip(self.names, loaded, strict=True)),
        }

    def held_out_squares(self, terms: Iterable[str]) -> float:
        """Sum of squared prediction errors of moments of logs or blocks, each from the others."""
        columns = self._columns(terms)
        key = tuple(columns.tolist())  # each sub-model is asked for beside every term that it lacks
        if key not in self._squares:
            rest = self._total - self._folds
            inverse = scaled_pinvs(rest[:, columns[:, None], columns])
            p = np.einsum("nij,nj->ni", inverse, rest[:, columns, -1])
            v = np.concatenate([-p, np.ones((len(p), 1))], axis=1)
            own = np.append(columns, -1)
            kept = self._folds[np.ix_(np.arange(len(p)), own, own)]
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
        names = names_of(terms_named(terms))
        own = np.flatnonzero(np.isin(columns, self._named(names)))
        statistics = []
        for S in covariances:
            inverse = scaled_pinv(S[np.ix_(own, own)])
            statistics.append(float(value[own] @ inverse @ value[own]))
        return min(statistics), own.size, float(stretches)

    def lateness(self, terms: Iterable[str]) -> Lateness:
        """How late the torque acts in the sub-model with `terms`.

        Its deviation is the larger of those by white noise and by the sandwich.
        """
        columns = self._columns(without_delay(terms), CHANGE)
        value, covariances, _ = self._spread(columns)
        own = int(np.flatnonzero(columns == self.names.index(CHANGE))[0])
        variance = float(np.max(covariances, axis=0)[own, own])
        # what a delay that is left out adds to the others, beside their deviations
        rest, column = np.delete(columns, own), columns[own]
        _, beside, _ = self._spread(rest)
        slope = scaled_pinv(self._total[np.ix_(rest, rest)]) @ self._total[rest, column]
        size = np.sqrt(np.diag(np.max(beside, axis=0)))
        return Lateness(
            self.settings.shift.delay + float(value[own]),
            float(np.sqrt(max(variance, 0.0))),
            0.5 * self._dt,
            float(np.max(np.abs(slope) / np.maximum(size, 1e-300))),
        )

    def _named(self, names: Sequence[str]) -> IntArray:
        """Places in p of coefficients by name, the loaded arm's with them."""
        wanted = np.isin(self.names, names)
        if self._both:
            wanted = np.append(wanted, wanted[self._rigid])
        return np.flatnonzero(wanted)

    def _spread(self, columns: IntArray) -> tuple[FloatArray, tuple[FloatArray, FloatArray], int]:
        """Least squares on `columns`, plain and sandwich covariance, independent stretches."""
        inverse = scaled_pinv(self._total[np.ix_(columns, columns)])
        value = inverse @ self._total[columns, -1]
        v = np.zeros(self.size + 1)
        v[columns], v[-1] = -value, 1.0
        meat, stretches = np.zeros_like(inverse), 0
        for alike in self._alike:
            scores = (alike @ v)[:, :, columns]
            variance, lags = long_run_variances(scores)
            meat += variance
            stretches += int(np.sum(alike.shape[1] // (lags + 1)))
        stretches = max(stretches, len(columns) + 2)
        sandwich = inverse @ meat @ inverse * (stretches / (stretches - len(columns)))
        return value, (inverse, sandwich), stretches


def _solved(gram: FloatArray, columns: IntArray) -> FloatArray:
    """P (P,) of least squares with the columns given, zero elsewhere."""
    p = np.zeros(len(gram) - 1)
    p[columns] = scaled_pinv(gram[np.ix_(columns, columns)]) @ gram[columns, -1]
    return p
