"""Information of short cells of a log on the payload: sums of whitened rows that are linear in it.

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

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from algid.arm import FloatArray
from algid.base.errors import ResultError
from algid.base.names import names_in, outside, within
from algid.estimators.noise import first_guess
from algid.estimators.parametrisation import BODY_PARAMETERS, Shared
from algid.estimators.whitening import Linearised, NoiseLevels, linearise, trajectory
from algid.identification.known import (
    by_constants,
    covariance_of,
    has_error_bar,
    model_of,
    noise_of,
    payload_length,
    prior_of,
    shift_of,
    with_error_bar,
)
from algid.model import K3, K6, K7, SINES, TERMS, Model
from algid.options import flag
from algid.results import Result
from algid.signals.differences import POINTS, Stencil
from algid.signals.filters import smoothed
from algid.signals.segments import Segment, pieces

CELL = 0.02  # s
_PIECE_SAMPLES = 16384
SMOOTHING = 40.0  # Hz: of the trajectory at which a piece is first linearised
COULOMB = TERMS["coulomb"]
FRICTION = (K6, K7) + COULOMB.names


@dataclass(frozen=True, eq=False)
class IdentifiedArm:
    """The arm that carries the payload: model, coefficients k (q,), link lengths in m, noise."""

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
    body: tuple[str, ...] = ()
    """What of the payload's body is uncertain: y_p, and J_p for each kilogram."""

    @property
    def unit(self) -> FloatArray:
        """D (q,): what a payload of 1 kg adds to the coefficients."""
        shared, beta = self._loaded
        return shared.coefficients(beta, True) - shared.coefficients(beta, False)

    @property
    def friction(self) -> list[int]:
        """Which coefficients are viscous or Coulomb friction's."""
        return list(map(self.model.names.index, within(FRICTION, self.model.names)))

    @property
    def tip_equivalent(self) -> float:
        """Mass in kg that at the tip has the inertia k3 of link 2 about joint 2."""
        return abs(float(self.k[self.model.names.index(K3)])) / self.l2**2

    @property
    def by_shape(self) -> FloatArray:
        """Derivatives (2 + b, q) of `unit` by l1, l2 and the uncertain parts of payload `body`."""
        shared, beta = self._loaded
        places = list(map(shared.names.index, ("l1", "l2") + self.body))
        return shared.jacobian(beta, True).T[places]

    @property
    def _loaded(self) -> tuple[Shared, FloatArray]:
        """Parameters of the arm with a payload of 1 kg."""
        of_payload = [1.0, self.l1, self.l2]
        body: tuple[str, ...] = ()
        if not set(SINES).isdisjoint(self.model.names):
            body += ("y_p",)
            of_payload.append(self.y)
        body += ("J_p",)
        of_payload.append(self.gyration**2)
        shared = Shared(self.model, payload=True, body=body)
        return shared, np.append(self.k, of_payload)


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
    segments: Iterable[Segment], arm: IdentifiedArm, c: FloatArray, settle: int = 1
) -> list[Cells]:
    """Cells of each piece of a log, linearised at the coefficients `c` (q,).

    They are linearised `settle` times more, each time at the trajectory of the fit before.
    """
    cells = []
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
        cells.append(_sums(linear, piece, stencil, arm, c))
    return cells


def _sums(
    linear: Linearised, piece: Segment, stencil: Stencil, arm: IdentifiedArm, c: FloatArray
) -> Cells:
    Y, e = linear.columns[:-1], linear.columns[-1]
    g = arm.unit @ Y
    e = e + (c - arm.k) @ Y
    torque = e + arm.k @ Y
    step = max(1, round(CELL / piece.dt))
    count = e.size // (2 * step)

    def by_cell(rows: FloatArray) -> FloatArray:
        whole = rows[..., : count * 2 * step]
        return whole.reshape(rows.shape[:-1] + (count, 2 * step)).sum(axis=-1)

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
    """The arm of a result with link lengths from it or given, and the covariance (p, p) of both.

    Behind the q constants stand l1, l2 and what is uncertain of the payload's body.

    Noise levels are the result's; where it has none, those of the log's first stretch.

    Raises
    ------
    ResultError
        If the result leaves a constant or a link length open.
    """
    if result.fit is None:
        raise ResultError(
            f"{result.log.path}: the result of {flag('estimator')} {result.estimator} has no error "
            f"bars; identify with {flag('estimator')} refined or weak"
        )
    model = model_of(result)
    prior = prior_of(result, model)
    y, gyration = _body(result)
    body: tuple[str, ...] = ()
    if _of_payload(result, "m_p"):
        body = with_error_bar(result, BODY_PARAMETERS)
    uncertain = prior.names + body
    for name, given in (("l1", l1), ("l2", l2)):
        if given is None and has_error_bar(result, name):
            uncertain += (name,)
    covariance = _covariance_of(result, prior.names + ("l1", "l2") + body, uncertain)
    constants = _by_constants(result, l1)
    if constants is None:
        first_link = _length(result, "l1", l1)
    else:
        first_link, slopes = constants
        covariance = _with_first_length(covariance, prior.names, slopes)
    arm = IdentifiedArm(
        model=model,
        k=prior.mean,
        l1=first_link,
        l2=_length(result, "l2", l2),
        noise=noise_of(result) or first_guess(first.theta, first.tau),
        shift=shift_of(result).at(first.dt),
        y=y,
        gyration=gyration,
        body=body,
    )
    return arm, covariance


def _by_constants(result: Result, given: float | None) -> tuple[float, dict[str, float]] | None:
    """l1 = g |K1| / |K2| in m and its derivatives by the constants.

    None where l1 is given, or the payload determines it better.
    """
    if given is not None or result.settings.get("l1") is not None:
        return None
    length = by_constants(result)
    if length is None or length[0] <= 0 or payload_length(result) is not None:
        return None
    return length


def _with_first_length(
    covariance: FloatArray, constants: Sequence[str], slopes: Mapping[str, float]
) -> FloatArray:
    """The covariance (p, p) with l1, which stands behind the constants, as a function of them."""
    T = np.eye(covariance.shape[0])
    row = T[len(constants)]
    row[:] = 0.0
    for name, slope in slopes.items():
        row[constants.index(name)] = slope
    return T @ covariance @ T.T


def _covariance_of(result: Result, names: Sequence[str], uncertain: Sequence[str]) -> FloatArray:
    """Covariance (p, p) of `names`, nothing where they are not `uncertain`.

    J_p is that of each kilogram.
    """
    assert result.fit is not None
    if "J_p" not in uncertain:
        return covariance_of(result, names, uncertain)
    more = list(names) + ["m_p"]
    open_ones = set(uncertain)
    if "m_p" in result.fit.covariance_names:
        open_ones.add("m_p")
    covariance = covariance_of(result, more, open_ones)
    J, m_p = _of_payload(result, "J_p"), _of_payload(result, "m_p")
    T = np.eye(len(names), len(more))
    row = names.index("J_p")
    T[row, [row, -1]] = 1 / m_p, -J / m_p**2  # of J_p / m_p
    return T @ covariance @ T.T


def with_friction(arm: IdentifiedArm, covariance: FloatArray) -> tuple[IdentifiedArm, FloatArray]:
    """The arm and its covariance (p, p) with columns of Coulomb friction, zero if it had none."""
    if COULOMB.name in arm.model.terms:
        return arm, covariance
    model = replace(arm.model, terms=arm.model.terms + (COULOMB.name,))
    places = np.array(list(map(model.names.index, arm.model.names)))
    k = np.zeros(len(model.names))
    k[places] = arm.k
    others = covariance.shape[0] - len(places)  # lengths, and what the payload's body adds
    size = k.size + others
    places = np.append(places, np.arange(k.size, size))
    wider = np.zeros((size, size))
    wider[np.ix_(places, places)] = covariance
    return replace(arm, model=model, k=k), wider


def _body(result: Result) -> tuple[float, float]:
    """Offset and radius of gyration in m of the result's payload, assumed for all objects."""
    y, J, m_p = (_of_payload(result, name) for name in ("y_p", "J_p", "m_p"))
    if m_p <= 0:
        return y, 0.0
    return y, float(np.sqrt(max(J, 0.0) / m_p))


def _of_payload(result: Result, name: str) -> float:
    """The estimate of one of the payload's parameters, 0 where the result has none."""
    if name not in result.payload:
        return 0.0
    return float(result.payload[name].estimate or 0.0)


def _length(result: Result, name: str, given: float | None) -> float:
    """A link's length: the one given, else the one the result was made with, else its estimate."""
    if given is not None:
        return float(given)
    if result.settings.get(name) is not None:
        return float(result.settings[name])
    estimated = result.payload.get(name)
    if estimated is None or estimated.estimate is None:
        raise ResultError(
            f"{result.log.path}: its result has no {name}; give the link's length with {flag(name)}"
        )
    return estimated.estimate
