"""The torque of an arm with real drives, put together from the terms of `algid.physics.terms`.

======  ==========================================================  =========  =========
symbol  name                                                        shape      unit
======  ==========================================================  =========  =========
c       coefficients of the columns switched on                     (q,)       `UNITS`
Y       regressor, τ = Y c                                          (2, q, N)
J       sensitivity, ∂τ/∂c                                          (2, q, N)
P       partials, ∂τ/∂θ, ∂τ/∂θ̇ and ∂τ/∂θ̈                           (3, 2, 2, N)
L       load of a joint: inertia, Coriolis and gravity              (2, N)     N m
======  ==========================================================  =========  =========

Which columns there are, their derivatives and what acts on the torque's channel are the terms' own
business; here they are put in order once a model (`Compiled`) and evaluated along motions.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from algid.arm import FloatArray
from algid.base.names import by_name, named_values, names_in, outside, within
from algid.physics.parameters import BODY, PAYLOAD, Parameter
from algid.physics.signals import (
    ALPHA,
    MOTION,
    WIDTHS,
    Motion,
    Product,
    Values,
    Widths,
    sine_cosine,
)
from algid.physics.terms import ALWAYS, OPTIONAL, Term
from algid.physics.terms.base import TorqueColumn, Vector
from algid.physics.terms.coulomb import F1, F2
from algid.physics.terms.rigid import K1, K2, K3, K4, K5
from algid.physics.terms.rotor import J2
from algid.physics.terms.viscous import K6, K7

__all__ = [
    "F1",
    "F2",
    "J2",
    "K1",
    "K2",
    "K3",
    "K4",
    "K5",
    "K6",
    "K7",
    "Model",
    "Motion",
    "Term",
    "sine_cosine",
]


def names_of(terms: Iterable[Term]) -> tuple[str, ...]:
    """Names of the parameters of some terms, in order."""
    names: list[str] = []
    for term in terms:
        names += term.names
    return tuple(names)


EVERY_TERM = by_name(ALWAYS + OPTIONAL)
TERMS = {term.name: term for term in OPTIONAL if not term.delays}
"""Terms that a model may have; a delay acts before a model does, on the log's times."""
DELAYS = names_of(term for term in OPTIONAL if term.delays)
FIRST_TERMS = tuple(name for name, term in TERMS.items() if term.usual)
"""Terms that most real joints have."""
CHOICES = names_in(OPTIONAL)
"""Names that ``--model`` takes."""
PARAMETERS: dict[str, Parameter] = {}
for _term in EVERY_TERM.values():
    PARAMETERS |= by_name(_term.parameters)
PARAMETERS |= by_name(PAYLOAD + BODY)
UNITS = {name: parameter.unit for name, parameter in PARAMETERS.items()}
COLUMN_NAMES = names_of(ALWAYS) + names_of(TERMS.values())
RIGID = names_of(term for term in ALWAYS if term.inertial)
SINES: dict[str, str] = {}
"""Parameters that are the sine part of another."""
for _term in TERMS.values():
    SINES |= _term.sines
SINE_OF = {cosine: sine for sine, cosine in SINES.items()}
"""The sine parts of the parameters that have one."""
MOMENTS = (K1, K2, K4)
"""The constants k1, k2 and k4, which are phasors with their sine parts: K = k + i ks."""
LARGEST_PHASE = np.pi / 4
"""rad: beyond, a phase is another convention."""
_SIGN_TRIALS = 4  # as many patterns as the signs of two loads have


@dataclass(frozen=True)
class Model(Widths):
    """Which terms the torque has beside eq. (1), and the widths of its friction.

    Parameters
    ----------
    terms : names in `TERMS`, in any order
    gravity : float, m/s^2
        0 for an arm that moves in a horizontal plane: parameters that weigh have no column then.

    Raises
    ------
    ValueError
        If a term is not in `TERMS`.
    """

    terms: tuple[str, ...] = ()
    gravity: float = 9.81

    def __post_init__(self) -> None:
        unknown = outside(self.terms, TERMS)
        if unknown:
            raise ValueError(f"terms: expected some of {', '.join(TERMS)}, got {unknown[0]!r}")
        object.__setattr__(self, "terms", within(TERMS, self.terms))

    @property
    def compiled(self) -> Compiled:
        """Its columns and their derivatives."""
        return _compiled(self.terms, self.gravity != 0)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns in their order."""
        return self.compiled.names

    @property
    def linear(self) -> bool:
        """Whether the torque is linear in the coefficients, so that the regressor needs none."""
        return all(TERMS[term].linear for term in self.terms)

    @property
    def iterated(self) -> tuple[str, ...]:
        """Names of the coefficients in which the torque is not linear."""
        return names_of(TERMS[name] for name in self.terms if not TERMS[name].linear)

    @cached_property
    def lag_name(self) -> str | None:
        """The coefficient that is the time constant of a low-pass of the torque.

        None where there is no such term.
        """
        for name in self.terms:
            if TERMS[name].lags:
                return TERMS[name].names[0]
        return None

    def lag(self, c: FloatArray) -> float:
        """The time constant in s of the torque's low-pass; 0 without."""
        if self.lag_name is None:
            return 0.0
        return float(c[self.names.index(self.lag_name)].flat[0])  # one low-pass for the whole log

    def values(self, c: FloatArray) -> dict[str, float]:
        """Coefficients of all `COLUMN_NAMES` by name: zero where a column is switched off."""
        return dict.fromkeys(COLUMN_NAMES, 0.0) | named_values(self.names, c)


def without_delay(terms: Iterable[str]) -> tuple[str, ...]:
    """Those of the names in `CHOICES` that a model may have."""
    return within(terms, TERMS)


Weighted = Mapping[Product, Sequence[tuple[int, float]]]
"""An expression that is linear in the coefficients: for each product their places and factors."""


@dataclass(frozen=True, eq=False)
class Compiled:
    """The columns of a model in order, and what derives from them, each once it is asked for.

    Parameters
    ----------
    names : of the columns
    columns : of all terms; several may belong to one name
    loads : places of the columns to which friction by load is in proportion
    """

    names: tuple[str, ...]
    columns: tuple[TorqueColumn, ...]
    loads: tuple[int, ...]

    @cached_property
    def place(self) -> dict[str, int]:
        """Where each column stands."""
        return dict(zip(self.names, range(len(self.names)), strict=True))

    @cached_property
    def parts(self) -> tuple[tuple[Weighted, Weighted], ...]:
        """f, p and s in τ = d²s/dt² + dp/dt + f, by joint."""
        return (
            self._weighted(column.f for column in self.columns),
            self._weighted(column.p for column in self.columns),
            self._weighted(column.s for column in self.columns),
        )

    @cached_property
    def torque(self) -> tuple[Weighted, Weighted]:
        """The torque, by joint."""
        return self._weighted(column.torque for column in self.columns)

    @cached_property
    def rest(self) -> Sequence[Weighted]:
        """The torque without accelerations, by joint."""
        rest = []
        for whole in self.torque:
            rest.append({one: whole[one] for one in whole if set(one).isdisjoint(ALPHA)})
        return rest

    @cached_property
    def partials(self) -> Mapping[tuple[int, int, int], Weighted]:
        """Derivatives by order of θ's derivative, torque's joint and angle's joint."""
        partials = {}
        for order, signals in enumerate(MOTION):
            for angle, signal in enumerate(signals):
                by_joint = self._weighted([column.partials[signal] for column in self.columns])
                for joint, weighted in enumerate(by_joint):
                    partials[order, joint, angle] = weighted
        return partials

    @cached_property
    def inertia(self) -> Sequence[Weighted]:
        """What multiplies the accelerations: both of the first joint's torque, then the other's."""
        return [self.partials[2, joint, angle] for joint, angle in np.ndindex(2, 2)]

    def _weighted(self, vectors: Iterable[Vector]) -> tuple[Weighted, Weighted]:
        """What the columns are, or derive to, as expressions in all of their coefficients."""
        one: dict[Product, list[tuple[int, float]]] = {}
        two: dict[Product, list[tuple[int, float]]] = {}
        for column, vector in zip(self.columns, vectors, strict=True):
            for weighted, entry in zip((one, two), vector, strict=True):
                for product, factor in entry.products.items():
                    pair = self.place[column.parameter], factor
                    weighted.setdefault(product, []).append(pair)
        return one, two

    def only(self, places: Collection[int]) -> Compiled:
        """The columns at `places` alone, each where it stands."""
        return _only(self, frozenset(places))

    @property
    def of_load(self) -> Compiled:
        """The columns that are the joints' load."""
        return self.only(self.loads)

    @property
    def beside_load(self) -> Compiled:
        """The other columns."""
        return self.only(set(range(len(self.names))).difference(self.loads))


@lru_cache(maxsize=1024)
def _only(compiled: Compiled, places: frozenset[int]) -> Compiled:
    own = [one for one in compiled.columns if compiled.place[one.parameter] in places]
    return replace(compiled, columns=tuple(own))


def terms_named(names: Iterable[str]) -> Iterator[Term]:
    """The terms with these names."""
    return map(EVERY_TERM.__getitem__, names)


def widths_in(terms: Iterable[str]) -> tuple[str, ...]:
    """Widths of friction that shape some of the terms."""
    return within(WIDTHS, [width for term in terms_named(terms) for width in term.shapes])


@lru_cache(maxsize=256)
def _compiled(terms: tuple[str, ...], gravity: bool) -> Compiled:
    names: list[str] = []
    columns: list[TorqueColumn] = []
    loads: list[int] = []
    for term in (*ALWAYS, *terms_named(terms)):
        for parameter in term.parameters:
            if gravity or not parameter.weighs:
                if term.inertial:
                    loads.append(len(names))
                names.append(parameter.name)
        for column in term.columns:
            if column.parameter in names:
                columns.append(column)
    return Compiled(tuple(names), tuple(columns), tuple(loads))


def summed(weighted: Weighted, c: FloatArray, values: Values) -> FloatArray | float:
    """The value of an expression that is linear in the coefficients `c` (q,) or (q, N)."""
    known = c.tolist() if c.ndim == 1 else c  # Python's numbers are faster than NumPy's
    factors = {}
    for product, pairs in weighted.items():
        total = 0.0
        for place, factor in pairs:
            total = total + factor * known[place]
        factors[product] = total
    return values.sum(factors)


def regressor(model: Model, motion: Motion, c: FloatArray | None = None) -> FloatArray:
    """Y with τ = Y c: eq. (1) and the model's terms.

    Parameters
    ----------
    model : Model
    motion : Motion of N samples
    c : (q,), in `UNITS`; or (q, N), coefficients of their own at each sample
        Where a model that is not linear is taken.

    Returns
    -------
    (2, q, N), N m over the column's unit

    Notes
    -----
    Friction by load and gains make the torque bilinear in c: Y is taken at `c` then, with the load
    that c gives, a joint's rows times its gain, the links' columns at their own motion behind
    elastic joints, and nothing in the columns of gains and of compliance. The column of a low-pass,
    which is no function of the motion at one instant, is nothing too.

    Raises
    ------
    ValueError
        If the model is not linear and `c` is not given.
    """
    if c is None and not model.linear:
        raise ValueError(
            f"the regressor of {', '.join(model.terms)} depends on the coefficients, got none"
        )
    if c is None:
        c = np.zeros(len(model.names))
    compiled = model.compiled
    values = of_links = Values(motion, model)
    links = link_motion(model, c, motion)
    if links is not motion:
        of_links = Values(links, model)
    Y = np.zeros((2, len(compiled.names), motion.theta.shape[1]))
    for rows, weighted in zip(Y, compiled.torque, strict=True):
        for product, pairs in weighted.items():
            for place, factor in pairs:
                value = (of_links if place in compiled.loads else values).of(product)
                rows[place] += value if factor == 1 else factor * value
    for share, whole in acting(model, "of_motor"):
        Y[:, share] = c[whole] * (Y[:, share] - Y[:, whole])
    for place, joint in acting(model, "by_load"):
        loads = list(compiled.loads)
        load = torques_of(Y[joint, loads], apart(model, c)[loads])
        Y[joint, place] = np.abs(load) * smooth_sign(model, motion.omega[joint])
    if acting(model, "gains"):
        Y *= gains(model, c).reshape(2, 1, -1)
    return Y


def loads_of(model: Model) -> tuple[str, ...]:
    """Names of the columns that are the joints' load, which a payload changes."""
    return tuple(model.names[place] for place in model.compiled.loads)


def apart(model: Model, c: FloatArray) -> FloatArray:
    """Coefficients (q, ...) whose links are without their motors, and these in place of shares."""
    pairs = acting(model, "of_motor")
    if pairs:
        c = np.array(c)
    for share, whole in pairs:
        c[share] *= c[whole]
        c[whole] -= c[share]
    return c


def link_motion(model: Model, c: FloatArray, motion: Motion) -> Motion:
    """The links' motion where the joints are elastic and `motion`, the motors', has a load."""
    pairs = acting(model, "elastic")
    if not pairs or motion.load is None:
        return motion
    signals = np.stack([motion.theta, motion.omega, motion.alpha])
    for place, joint in pairs:
        signals[:, joint] -= c[place] * motion.load[:, joint]
    return Motion(*signals)


def phasor(model: Model, c: FloatArray, name: str) -> complex:
    """The moment `name` of the coefficients `c` (q,), or of more, as a phasor; 0 without a column.

    Its sine part is imaginary.
    """
    return phasor_of(dict(zip(model.names, c.tolist(), strict=False)), name)


def phasor_of(values: Mapping[str, float], name: str) -> complex:
    """The moment `name` of coefficients by name as a phasor; what they lack is 0."""
    return complex(values.get(name, 0.0), values.get(SINE_OF.get(name, ""), 0.0))


def moments_of(values: Mapping[str, float]) -> tuple[complex, complex, complex]:
    """The moments k1, k2 and k4 of coefficients by name as phasors; what they lack is 0."""
    return phasor_of(values, K1), phasor_of(values, K2), phasor_of(values, K4)


def length_by_coupling(values: Mapping[str, float], gravity: float) -> float | None:
    """l1 = g |K1| / |K2| in m (Table 1), by the coefficients by name; `gravity` in m/s².

    It is negative where both are more than a right angle apart: an arm's is positive. None without
    gravity, k1 or k2.
    """
    first, second, _ = moments_of(values)
    sign = float(np.sign((first * second.conjugate()).real))
    if not gravity or not sign:
        return None
    return gravity * abs(first) / abs(second) * sign


def acting(model: Model, kind: str) -> list[tuple[int, int]]:
    """Places of the model's coefficients that act as `kind`, an attribute of `Term`, and on what.

    That is a joint, or the place of the coefficient whose share each is.
    """
    place, pairs = model.compiled.place, []
    for term in model.terms:
        for name, on in getattr(TERMS[term], kind):
            if name in place:
                pairs.append((place[name], place.get(on, on)))
    return pairs


def gains(model: Model, c: FloatArray) -> FloatArray:
    """By what (2, ...) each joint's torque is multiplied at the coefficients `c` (q, ...)."""
    factor = np.ones((2, *c.shape[1:]))
    for place, joint in acting(model, "gains"):
        factor[joint] *= 1 + c[place]
    return factor


def torques_of(rows: FloatArray, c: FloatArray) -> FloatArray:
    """Torques (..., N) of a regressor's rows (..., q, N) at coefficients (q,) or (q, N)."""
    return np.einsum("...qn,qn->...n", rows, c.reshape(c.shape[0], -1))


def torque(model: Model, c: FloatArray, motion: Motion) -> FloatArray:
    """Torque τ (2, N) in N m; without a low-pass, which needs the torque at other instants too."""
    return torques_of(regressor(model, motion, c), c)


def load(model: Model, c: FloatArray, motion: Motion) -> FloatArray:
    """Each joint's load (2, N) in N m that a model's coefficients `c` (q,) give a motion.

    It is what friction by load goes by, less that friction, and as no gain reads it.
    """
    values, c = Values(motion, model), apart(model, c)
    load = np.empty_like(motion.theta)
    for joint, weighted in enumerate(model.compiled.of_load.torque):
        load[joint] = summed(weighted, c, values)
    return load


def sensitivity(model: Model, c: FloatArray, motion: Motion) -> FloatArray:
    """J, the derivative of the torque by the coefficients.

    Parameters
    ----------
    model : Model
    c : (q,), in `UNITS`; or (q, N), coefficients of their own at each sample
    motion : Motion of N samples

    Returns
    -------
    (2, q, N), N m over the column's unit; nothing in the column of a low-pass

    Notes
    -----
    The load that bends elastic joints stays as it is: see `algid.estimators.elastic.with_bends`.
    The regressor where the torque is linear in c. Else, with sgn L, t = tanh(ω / ω_s), load shares
    e and gains g,

        ∂τ_i/∂k_j = Y_ij (1 + e_i t_i sgn L_i)        for the columns j of the load
        ∂τ_i/∂g_i = τ_i / (1 + g_i)
    """
    J = regressor(model, motion, c)
    if model.linear:
        return J
    loads = list(model.compiled.loads)
    differentiate(model, J, c)
    for place, joint in acting(model, "by_load"):
        # a gain scales the load, which leaves its sign
        load = torques_of(J[joint, loads], apart(model, c)[loads])
        sign = smooth_sign(model, motion.omega[joint])
        J[joint, loads] *= 1 + c[place] * sign * np.sign(load)
    return J


def differentiate(model: Model, Y: FloatArray, c: FloatArray) -> None:
    """Make of a regressor Y (2, q, N) at `c`, in place, derivatives by gains and motors' shares.

    It may be of samples or of windows.
    """
    tau = torques_of(Y, c)
    for share, whole in acting(model, "of_motor"):
        if c[whole]:  # of nothing no motor has a share
            Y[:, whole] += c[share] / c[whole] * Y[:, share]
    for place, joint in acting(model, "gains"):
        Y[joint, place] = tau[joint] / gains(model, c)[joint]


def partials(model: Model, c: FloatArray, motion: Motion) -> FloatArray:
    """P = ∂τ/∂θ, ∂τ/∂θ̇ and ∂τ/∂θ̈.

    Parameters
    ----------
    model : Model
    c : (q,), in `UNITS`; or (q, N), coefficients of their own at each sample
    motion : Motion of N samples

    Returns
    -------
    (3, 2, 2, N), N m/rad, N m s/rad and N m s²/rad
        By order of θ's derivative, torque's joint and angle's joint. Where a load is nothing its
        sign is too.
    """
    compiled, own = model.compiled, apart(model, c)
    values = Values(motion, model)
    P = np.empty((3, 2, 2, motion.theta.shape[1]))
    for where, weighted in compiled.partials.items():
        P[where] = summed(weighted, own, values)
    for place, joint in acting(model, "by_load"):
        share, sign = own[place], smooth_sign(model, motion.omega[joint])
        carried = load(model, c, motion)[joint]
        for (order, row, angle), weighted in compiled.of_load.partials.items():
            if row == joint:
                slope = summed(weighted, own, values)
                P[order, joint, angle] += share * sign * np.sign(carried) * slope
        P[1, joint, joint] += share * np.abs(carried) * (1 - sign**2) / model.coulomb_speed
    P *= gains(model, own).reshape(2, 1, -1)
    return P


def smooth_sign(model: Model, omega: FloatArray) -> FloatArray:
    """The smooth sign tanh(ω / ω_s) of velocities."""
    return np.tanh(omega / model.coulomb_speed)


def inertia(model: Model, c: FloatArray, theta: FloatArray) -> FloatArray:
    """What multiplies the accelerations (2, 2, ...) at angles (2, ...), rotors included, in kg m².

    `c` is (q,), or (q, ...) for arms of their own at each sample.
    """
    values, c = Values(Motion(theta, theta, theta), model), apart(model, c)
    M = np.empty((2, 2) + theta.shape[1:])
    for entry, weighted in zip(np.ndindex(2, 2), model.compiled.inertia, strict=True):
        M[entry] = summed(weighted, c, values)
    return M


def acceleration(
    model: Model, c: FloatArray, theta: FloatArray, omega: FloatArray, tau: FloatArray
) -> FloatArray:
    """Accelerations that torques give: `torque` solved for θ̈, without a low-pass.

    Parameters
    ----------
    model : Model
    c : (q,), in `UNITS`; or (q, N), for an arm of its own at each sample, of a model that is linear
    theta, omega, tau : (2, N), rad, rad/s and N m

    Returns
    -------
    (2, N), rad/s²

    Notes
    -----
    With L = M θ̈ + n the load, D = 1 + e tanh(ω / ω_s) sgn L, R the inertia that is no load,
    friction and offsets in r and gains g,

        (D M + R) θ̈ = τ / (1 + g) - r - D n

    The signs of L are those of the torque left for it, and found again until they are their own.
    """
    c, by_load = apart(model, c), acting(model, "by_load")
    values = Values(Motion(theta, omega, omega), model)
    beside = model.compiled.beside_load if by_load else model.compiled
    R = [summed(weighted, c, values) for weighted in beside.inertia]
    left = tau / gains(model, c).reshape(2, -1)
    for joint, weighted in enumerate(beside.rest):
        left[joint] -= summed(weighted, c, values)
    if not by_load:
        return _solved(R, left)
    of_load = model.compiled.of_load
    M = [summed(weighted, c, values) for weighted in of_load.inertia]
    n, share = np.zeros_like(left), np.zeros_like(left)
    for joint, weighted in enumerate(of_load.rest):
        n[joint] = summed(weighted, c, values)
    for place, joint in by_load:
        share[joint] = c[place] * smooth_sign(model, omega[joint])
    signs = np.sign(left)
    for _ in range(_SIGN_TRIALS):
        D = 1 + share * signs
        rows = [D[joint] * m + r for joint, m, r in zip((0, 0, 1, 1), M, R, strict=True)]
        alpha = _solved(rows, left - D * n)
        load = np.stack([M[0] * alpha[0] + M[1] * alpha[1], M[2] * alpha[0] + M[3] * alpha[1]]) + n
        after = np.sign(load)
        if np.array_equal(after, signs):
            break
        signs = after
    return alpha


def advanced(
    model: Model, c: FloatArray, x: FloatArray, torques: FloatArray, step: FloatArray | float
) -> FloatArray:
    """Angles and velocities (4, N) a `step` s later, by the classical Runge-Kutta method.

    `torques` (3, 2, N) are those at the step's beginning, middle and end.
    """

    def rate(x: FloatArray, tau: FloatArray) -> FloatArray:
        return np.concatenate([x[2:], acceleration(model, c, x[:2], x[2:], tau)])

    begin, middle, end = torques
    first = rate(x, begin)
    second = rate(x + 0.5 * step * first, middle)
    third = rate(x + 0.5 * step * second, middle)
    last = rate(x + step * third, end)
    return x + step / 6 * (first + 2 * (second + third) + last)


def _solved(matrix: Sequence[FloatArray | float], right: FloatArray) -> FloatArray:
    """X (2, N) with [[a, b], [c, d]] x = right, of a matrix a, b, c, d."""
    a, b, c, d = matrix
    return np.stack([d * right[0] - b * right[1], a * right[1] - c * right[0]]) / (a * d - b * c)
