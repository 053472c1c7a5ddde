"""What short cells of a log tell of the payload: sums over whitened rows that are linear in it.

Errors in variables are whitened as in `algid.estimators.whitening`, so that the rows' noise is
white whatever the angles' noise does to neighbouring torques. With the payload's column g = Y d, d
what one kilogram at the tip adds to the constants (Table 2), a row reads e = g m_p + noise.

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

The arm that a result describes, for tracking what it carries.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np

from algid.arm import FloatArray
from algid.errors import ResultError
from algid.estimators.noise import first_guess
from algid.estimators.parametrisation import Shared
from algid.estimators.whitening import Linearised, NoiseLevels, linearise, trajectory
from algid.identification.known import (
    first_length,
    model_of,
    payload_length,
    prior_of,
    shift_of,
)
from algid.model import PARAMETERS, SINES, TERMS, Model
from algid.results import Result
from algid.signals.differences import POINTS, Stencil
from algid.signals.filters import smoothed
from algid.signals.segments import Segment, pieces

CELL = 0.02  # s
_PIECE_SAMPLES = 16384
SMOOTHING = 40.0  # Hz: of the trajectory at which a piece is first linearised
COULOMB = TERMS["coulomb"]
FRICTION = ("k6", "k7", *COULOMB.names)


@dataclass(frozen=True, eq=False)
class IdentifiedArm:
    """The arm that carries the payload: its model, coefficients k (q,), link lengths in m, and noise levels."""

    model: Model
    k: FloatArray
    l1: float
    l2: float
    noise: NoiseLevels
    shift: float = 0.0
    y: float = 0.0
    """m, of a payload's centre of mass off link 2's line."""
    gyration: float = 0.0
    """m, a payload's radius of gyration."""

    @property
    def unit(self) -> FloatArray:
        """D (q,): what a payload of 1 kg adds to the coefficients."""
        across = bool(set(SINES) & set(self.model.names))
        shared = Shared(self.model, payload=True, body=(*(("y_p",) if across else ()), "J_p"))
        body = {"m_p": 1.0, "l1": self.l1, "l2": self.l2, "y_p": self.y, "J_p": self.gyration**2}
        beta = np.concatenate([self.k, [body[name] for name in shared.names[self.k.size :]]])
        return shared.coefficients(beta, True) - shared.coefficients(beta, False)

    @property
    def friction(self) -> list[int]:
        """Which coefficients are viscous or Coulomb friction's."""
        return [self.model.names.index(name) for name in FRICTION if name in self.model.names]

    @property
    def tip_equivalent(self) -> float:
        """Mass in kg that at the tip has the inertia k3 of link 2 about joint 2."""
        return abs(float(self.k[self.model.names.index("k3")])) / self.l2**2

    @property
    def by_lengths(self) -> tuple[FloatArray, FloatArray]:
        """Derivatives (q,) by l1 and l2 of what a payload of 1 kg adds to the coefficients."""
        g, l1, l2 = self.model.gravity, self.l1, self.l2
        return (
            self.added(np.array([2 * l1, 0.0, l2, g, 0.0])),
            self.added(np.array([0.0, 2 * l2, l1, 0.0, g])),
        )

    def added(self, z: FloatArray) -> FloatArray:
        """Payload constants z (5,) as changes of the coefficients (q,)."""
        places = [PARAMETERS[name].payload for name in self.model.names]
        return np.array([0.0 if place is None else z[place] for place in places])


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
        return self._with({name: getattr(self, name)[first:last] for name in SUMS})

    def weighted(self, weights: FloatArray) -> Cells:
        """The cells with the sums of each times its weight (C,), rows and torques aside."""

        def by_cell(x: FloatArray) -> FloatArray:
            return np.asarray(weights.reshape(-1, *[1] * (x.ndim - 1)) * x)

        return self._with({name: by_cell(getattr(self, name)) for name in "ABSEND"})

    def _with(self, sums: Mapping[str, FloatArray]) -> Cells:
        every = {name: getattr(self, name) for name in SUMS} | dict(sums)
        return Cells(**every, friction=self.friction)

    @property
    def mass(self) -> float:
        """The payload in kg that fits all cells best."""
        return float(self.B.sum() / max(self.A.sum(), 1e-300))

    def sensitivity(self, arm: IdentifiedArm, mass: float | FloatArray) -> FloatArray:
        """T (C, q + 2): how the scores of a payload of `mass` kg, one or (C,), shift with constants, l1 and l2."""
        by_l1, by_l2 = arm.by_lengths
        return np.column_stack([self.S, mass * (self.S @ by_l1), mass * (self.S @ by_l2)])

    def friction_sensitivity(self, arm: IdentifiedArm, mass: FloatArray) -> FloatArray:
        """V (C, f, q + 2): how D shifts with constants, l1 and l2 where the payload has `mass` (C,) kg."""
        lengths = [mass[:, None] * (self.N @ by_length) for by_length in arm.by_lengths]
        return np.concatenate([self.N, *(one[..., None] for one in lengths)], axis=2)

    def squares(self, mass: float | FloatArray) -> FloatArray:
        """Σ (e − g m_p)² (C,): what a payload of `mass` kg, one or (C,), leaves."""
        return np.asarray(self.E - 2 * mass * self.B + mass**2 * self.A)


SUMS = tuple(one.name for one in fields(Cells) if one.name != "friction")


def joined(parts: Sequence[Cells]) -> Cells:
    """Cells one after another."""
    sums = {name: np.concatenate([getattr(part, name) for part in parts]) for name in SUMS}
    return Cells(**sums, friction=parts[0].friction)


def cells_of(
    segments: Iterable[Segment], arm: IdentifiedArm, mass: float, settle: int = 1
) -> list[Cells]:
    """Cells of each piece of a log, linearised at a payload of `mass` kg and, `settle` times, at its trajectory."""
    c, found = arm.k + mass * arm.unit, []
    for piece in pieces(segments, _PIECE_SAMPLES):
        if len(piece) < 3 * POINTS:
            continue
        stencil = Stencil(piece.dt, arm.shift)
        theta = smoothed(piece.theta, piece.dt, min(SMOOTHING, 0.1 / piece.dt))
        linear = linearise(arm.model, c, theta, piece, stencil, arm.noise)
        for _ in range(settle):
            multiplier = linear.solve_transposed(linear.columns[-1:])[0]
            theta = trajectory(piece, linear, multiplier, arm.noise)
            linear = linearise(arm.model, c, theta, piece, stencil, arm.noise)
        found.append(_sums(linear, piece, stencil, arm, mass))
    return found


def _sums(
    linear: Linearised, piece: Segment, stencil: Stencil, arm: IdentifiedArm, mass: float
) -> Cells:
    Y, e = linear.columns[:-1], linear.columns[-1]
    g = arm.unit @ Y
    e = e + mass * g
    torque = e + arm.k @ Y
    step = max(1, round(CELL / piece.dt))
    count = e.size // (2 * step)

    def by_cell(rows: FloatArray) -> FloatArray:
        return rows[..., : count * 2 * step].reshape(*rows.shape[:-1], count, 2 * step).sum(axis=-1)

    first = piece.start + piece.dt * (stencil.torques(len(piece)).start + step * np.arange(count))
    return Cells(
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


def arm_of(
    result: Result, first: Segment, l1: float | None = None, l2: float | None = None
) -> tuple[IdentifiedArm, FloatArray]:
    """The arm of a result with link lengths from it or given, and the covariance (q + 2, q + 2) of both.

    Noise levels are the result's; where it has none, the log's first stretch tells them.

    Raises
    ------
    ResultError
        If the result leaves a constant or a link length open.
    """
    if result.fit is None:
        raise ResultError(
            f"{result.log.path}: the result of --estimator {result.estimator} has no error bars; "
            "identify with --estimator refined or weak"
        )
    model = model_of(result)
    prior = prior_of(result, model)
    fitted = result.fit.covariance_names
    names = [
        *prior.names,
        *(n for n, given in (("l1", l1), ("l2", l2)) if given is None and n in fitted),
    ]
    places = [fitted.index(name) for name in names]
    rows = [(*prior.names, "l1", "l2").index(name) for name in names]
    covariance = np.zeros((len(prior.names) + 2,) * 2)
    covariance[np.ix_(rows, rows)] = np.array(result.fit.covariance, dtype=np.float64)[
        np.ix_(places, places)
    ]
    noise = [result.fit.noise.get(name, 0.0) for name in ("theta1", "theta2", "tau1", "tau2")]
    constants = _by_constants(result, l1, prior.names)
    if constants is not None:
        _, gradient = constants
        q, row = gradient.size, covariance[-2]
        row[:] = 0.0
        row[:q] = gradient @ covariance[:q, :q]
        if "l2" in names:
            by_l2 = [
                result.fit.covariance[fitted.index("l2")][fitted.index(n)] for n in prior.names
            ]
            row[-1] = gradient @ np.array(by_l2, dtype=np.float64)
        row[-2] = row[:q] @ gradient
        covariance[:, -2] = row
    known = IdentifiedArm(
        model,
        prior.mean,
        _length(result, "l1", l1) if constants is None else constants[0],
        _length(result, "l2", l2),
        NoiseLevels(np.array(noise[:2]), np.array(noise[2:]))
        if min(noise) > 0
        else first_guess(first.theta, first.tau),
        shift_of(result)(first.dt),
        *_body(result),
    )
    return known, covariance


def _by_constants(
    result: Result, given: float | None, names: Sequence[str]
) -> tuple[float, FloatArray] | None:
    """l1 = g k1 / k2 in m and its gradient (q,) by the constants `names`.

    None where l1 is given, or the payload tells it better.
    """
    if given is not None or result.settings.get("l1") is not None:
        return None
    found = first_length(result)
    if found is None or found[0] <= 0 or payload_length(result) is not None:
        return None
    k1, k2 = (result.parameters[name].estimate or math.nan for name in ("k1", "k2"))
    gradient = np.zeros(len(names))
    gradient[names.index("k1")], gradient[names.index("k2")] = found[0] / k1, -found[0] / k2
    return found[0], gradient


def with_friction(arm: IdentifiedArm, covariance: FloatArray) -> tuple[IdentifiedArm, FloatArray]:
    """The arm and its covariance (q + 2, q + 2) with columns of Coulomb friction, of nothing where it had none."""
    if COULOMB.name in arm.model.terms:
        return arm, covariance
    model = replace(arm.model, terms=(*arm.model.terms, COULOMB.name))
    places = [model.names.index(name) for name in arm.model.names]
    k = np.zeros(len(model.names))
    k[places] = arm.k
    places += [k.size, k.size + 1]
    wider = np.zeros((k.size + 2,) * 2)
    wider[np.ix_(places, places)] = covariance
    return replace(arm, model=model, k=k), wider


def _body(result: Result) -> tuple[float, float]:
    """Offset and radius of gyration in m of the payload behind a result: objects are taken to be shaped like it."""
    y, J, m_p = (
        float(result.payload[name].estimate or 0.0) if name in result.payload else 0.0
        for name in ("y_p", "J_p", "m_p")
    )
    return y, float(np.sqrt(max(J, 0.0) / m_p)) if m_p > 0 else 0.0


def _length(result: Result, name: str, given: float | None) -> float:
    known = [
        given,
        result.settings.get(name),
        result.payload[name].estimate if name in result.payload else None,
    ]
    found = next((value for value in known if value is not None), None)
    if found is None:
        raise ResultError(
            f"{result.log.path}: its result has no {name}; give the link's length with --{name}"
        )
    return float(found)
