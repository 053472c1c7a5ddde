"""The torque of an arm with real drives: eq. (1) and the terms that real joints add.

======  ==========================================================  =========  =========
symbol  name                                                        shape      unit
======  ==========================================================  =========  =========
c       coefficients of the columns switched on                     (q,)       `UNITS`
Y       regressor, τ = Y c                                          (2, q, N)
J       sensitivity, ∂τ/∂c                                          (2, q, N)
P       partials, ∂τ/∂θ, ∂τ/∂θ̇ and ∂τ/∂θ̈                           (3, 2, 2, N)
L       load of a joint: inertia, Coriolis and gravity of eq. (1)   (2, N)     N m
ω_s     `coulomb_speed`, the width of Coulomb friction              scalar     rad/s
ω_S     `stribeck_speed`, the speed at which Stribeck's has gone    scalar     rad/s
======  ==========================================================  =========  =========

Every term is listed in `TERMS` with its equation. All its coefficients are zero on an arm without it. The rotor
of joint 1 adds to k5 alone, which is why it has no column. Friction follows tanh(ω / ω_s) instead of sign(ω), so
that a velocity error near standstill does not flip a whole sample.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from algid.arm import CONSTANT_NAMES, CONSTANT_UNITS, FloatArray, mass_matrix, passive_torque


@dataclass(frozen=True)
class Term:
    """A term of the torque beside eq. (1).

    Parameters
    ----------
    names : names of its coefficients
    unit : str, of each
    equation : str, what it adds to the torque of joint i
    title : str, in words
    needs : str or None
        A term without which it has no meaning.
    """

    names: tuple[str, ...]
    unit: str
    equation: str
    title: str
    needs: str | None = None


TERMS = {
    "coulomb": Term(("f1", "f2"), "N m", "f_i tanh(ω_i / ω_s)", "Coulomb friction"),
    "offset": Term(("o1", "o2"), "N m", "o_i", "torque offsets"),
    "rotor": Term(("j2",), "kg m^2", "j2 θ̈_2 (joint 2)", "rotor inertia of joint 2"),
    "stribeck": Term(
        ("s1", "s2"), "N m", "s_i tanh(ω_i / ω_s) exp(-(ω_i / ω_S)²)", "Stribeck friction", needs="coulomb"
    ),
    "asymmetry": Term(("a1", "a2"), "N m", "a_i tanh²(ω_i / ω_s)", "asymmetric Coulomb friction", needs="coulomb"),
    "load": Term(("e1", "e2"), "1", "e_i |L_i| tanh(ω_i / ω_s)", "friction in proportion to the joint's load"),
    "gain": Term(("gain2",), "1", "τ_2 times 1 + gain2", "torque gain of joint 2 over that of joint 1, less 1"),
    "zero": Term(("zero1", "zero2"), "rad", "θ_i + zero_i in place of θ_i", "zero offsets of the angles"),
    "lag": Term(("lag",), "s", "-lag dτ_log/dt: the logged torque lags behind", "first-order low-pass of the torque"),
}
COLUMN_NAMES = CONSTANT_NAMES + tuple(name for term in TERMS.values() for name in term.names)
UNITS = {
    **CONSTANT_UNITS,
    **{name: term.unit for term in TERMS.values() for name in term.names},
    "delay": "s",
    "m_p": "kg",
    "l1": "m",
    "l2": "m",
}
_WITH_GRAVITY = ("k2", "k4", "zero1")
RIGID = ("k1", "k2", "k3", "k4", "k5")
_SIGN_TRIALS = 4  # as many patterns as the signs of two loads have


@dataclass(frozen=True)
class Model:
    """Which terms the torque has beside eq. (1).

    Parameters
    ----------
    terms : names in `TERMS`, in any order
    gravity : float, m/s^2
        0 for an arm that moves in a horizontal plane: k2, k4 and zero1 have no column then.
    coulomb_speed : float, rad/s
        ω_s: speed at which Coulomb friction has reached three quarters of its value.
    stribeck_speed : float, rad/s
        ω_S: speed at which a third of Stribeck's additional friction is left.

    Raises
    ------
    ValueError
        If a term is not in `TERMS`.
    """

    terms: tuple[str, ...] = ()
    gravity: float = 9.81
    coulomb_speed: float = 0.2
    stribeck_speed: float = 0.3

    def __post_init__(self) -> None:
        unknown = [term for term in self.terms if term not in TERMS]
        if unknown:
            raise ValueError(f"terms: expected some of {', '.join(TERMS)}, got {unknown[0]!r}")
        object.__setattr__(self, "terms", tuple(term for term in TERMS if term in self.terms))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the columns in their order."""
        names = [*CONSTANT_NAMES, *(name for term in self.terms for name in TERMS[term].names)]
        return tuple(name for name in names if self.gravity != 0 or name not in _WITH_GRAVITY)

    @cached_property
    def columns(self) -> list[int]:
        """Where each column stands in `COLUMN_NAMES`."""
        return [COLUMN_NAMES.index(name) for name in self.names]

    @property
    def linear(self) -> bool:
        """Whether the torque is linear in the coefficients, so that the regressor needs none."""
        return not {"load", "gain", "zero"} & set(self.terms)

    def expand(self, c: FloatArray) -> FloatArray:
        """Coefficients of all `COLUMN_NAMES`: zero where a column is switched off."""
        full = np.zeros(len(COLUMN_NAMES))
        full[self.columns] = c
        return full

    def values(self, c: FloatArray) -> dict[str, float]:
        """Coefficients of all `COLUMN_NAMES` by name: zero where a column is switched off."""
        return dict(zip(COLUMN_NAMES, self.expand(c).tolist(), strict=True))


@dataclass(frozen=True, eq=False)
class Motion:
    """Angles, velocities, accelerations (2, N) and what eq. (1) needs of them."""

    theta: FloatArray
    omega: FloatArray
    alpha: FloatArray

    @cached_property
    def trigonometry(self) -> tuple[FloatArray, ...]:
        """Sine and cosine of θ1, of θ2 and of θ1 + θ2, each (N,)."""
        (s1, s2), (c1, c2) = sine_cosine(self.theta)
        return s1, c1, s2, c2, s1 * c2 + c1 * s2, c1 * c2 - s1 * s2

    def turned(self, by: FloatArray) -> Motion:
        """The motion with `by` (2,) rad added to its angles."""
        return Motion(self.theta + by[:, None], self.omega, self.alpha) if np.any(by) else self


def sine_cosine(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Sine and cosine of angles, each in the shape of `theta`, through one tangent of the half angle.

    Exact to a unit in the last place of 1, also where the tangent has its poles. NumPy has vector instructions
    for the tangent on more processors than for sine and cosine: this is several times faster there.
    """
    half = np.tan(0.5 * theta)
    square = half * half
    scale = 1 / (1 + square)
    return 2 * half * scale, (1 - square) * scale


def regressor(model: Model, motion: Motion, c: FloatArray | None = None) -> FloatArray:
    """Y with τ = Y c: eq. (1) and the model's terms.

    Parameters
    ----------
    model : Model
    motion : Motion of N samples
    c : (q,), in `UNITS`
        Where a model that is not linear is taken.

    Returns
    -------
    (2, q, N), N m over the column's unit

    Notes
    -----
    Friction by load, the gain and the zero offsets make the torque bilinear in c: Y is taken at `c` then, with
    the load and the angles that c gives, joint 2's rows times its gain, and nothing in the columns of gain2, zero1
    and zero2. The column of the lag, which is no function of the motion at one instant, is nothing too.

    Raises
    ------
    ValueError
        If the model is not linear and `c` is not given.
    """
    if c is None and not model.linear:
        raise ValueError(f"the regressor of {', '.join(model.terms)} depends on the coefficients, got none")
    value = model.values(np.zeros(len(model.names)) if c is None else c)
    motion = motion.turned(_zeros(value))
    Y = np.zeros((2, len(model.names), motion.theta.shape[1]))
    column = {name: Y[:, place] for place, name in enumerate(model.names)}
    _fill_eq1(column, motion)
    if "rotor" in model.terms:
        column["j2"][1] = motion.alpha[1]
    if "offset" in model.terms:
        column["o1"][0] = column["o2"][1] = 1.0
    for name, friction in friction_columns(model, motion.omega).items():
        for joint in range(2):
            column[f"{name}{joint + 1}"][joint] = friction[joint]
    if "load" in model.terms:
        dissipated = np.abs(_load(model, Y, value)) * _sign(model, motion.omega)
        column["e1"][0], column["e2"][1] = dissipated
    Y[1] *= 1 + value["gain2"]
    return Y


def _fill_eq1(column: Mapping[str, FloatArray], motion: Motion) -> None:
    _, c1, s2, c2, _, c12 = motion.trigonometry
    omega1, omega2 = motion.omega
    alpha1, alpha2 = motion.alpha
    column["k1"][0] = c2 * (2 * alpha1 + alpha2) - s2 * (2 * omega1 + omega2) * omega2
    column["k1"][1] = c2 * alpha1 + s2 * omega1**2
    column["k3"][:] = alpha1 + alpha2
    column["k5"][0] = alpha1
    column["k6"][0] = omega1
    column["k7"][1] = omega2
    if "k2" in column:
        column["k2"][:] = c12
        column["k4"][0] = c1


def friction_columns(model: Model, omega: FloatArray) -> dict[str, FloatArray]:
    """Columns (2, N) of the friction that a joint's own velocity (2, N) decides, by the coefficients' letter."""
    if not {"coulomb", "stribeck", "asymmetry"} & set(model.terms):
        return {}
    sign = _sign(model, omega)
    found = {}
    if "coulomb" in model.terms:
        found["f"] = sign
    if "stribeck" in model.terms:
        found["s"] = sign * np.exp(-((omega / model.stribeck_speed) ** 2))
    if "asymmetry" in model.terms:
        found["a"] = sign**2
    return found


def torque(model: Model, c: FloatArray, motion: Motion) -> FloatArray:
    """Torque τ (2, N) in N m; without the lag, which needs the torque at other instants too."""
    return np.einsum("aqn,q->an", regressor(model, motion, c), c)


def sensitivity(model: Model, c: FloatArray, motion: Motion) -> FloatArray:
    """J, the derivative of the torque by the coefficients.

    Parameters
    ----------
    model : Model
    c : (q,), in `UNITS`
    motion : Motion of N samples

    Returns
    -------
    (2, q, N), N m over the column's unit; nothing in the column of the lag

    Notes
    -----
    The regressor where the torque is linear in c. Else, with sgn L and t = tanh(ω / ω_s),

        ∂τ_i/∂k_j = Y_ij (1 + e_i t_i sgn L_i)        j = 1 … 5
        ∂τ_2/∂gain2 = τ_2 / (1 + gain2)
        ∂τ_i/∂zero_j = ∂τ_i/∂θ_j
    """
    J = regressor(model, motion, c)
    if model.linear:
        return J
    value = model.values(c)
    place = {name: number for number, name in enumerate(model.names)}
    if "gain" in model.terms:
        J[1, place["gain2"]] = J[1].T @ c / (1 + value["gain2"])
    if "zero" in model.terms:
        slope = partials(model, c, motion)[0]
        for joint in range(2):
            if f"zero{joint + 1}" in place:
                J[:, place[f"zero{joint + 1}"]] = slope[:, joint]
    if "load" in model.terms:
        turned = motion.turned(_zeros(value))
        rigid = [place[name] for name in RIGID if name in place]
        e = np.array([value["e1"], value["e2"]])
        # The gain scales joint 2's load, which leaves its sign.
        share = e[:, None] * _sign(model, turned.omega) * np.sign(_load(model, J, value))
        J[:, rigid] *= 1 + share[:, None]
    return J


def partials(model: Model, c: FloatArray, motion: Motion) -> FloatArray:
    """P = ∂τ/∂θ, ∂τ/∂θ̇ and ∂τ/∂θ̈.

    Parameters
    ----------
    model : Model
    c : (q,), in `UNITS`
    motion : Motion of N samples

    Returns
    -------
    (3, 2, 2, N), N m/rad, N m s/rad and N m s²/rad
        By order of θ's derivative, torque's joint and angle's joint. Where a load is nothing its sign is too.
    """
    value = model.values(c)
    motion = motion.turned(_zeros(value))
    P = _rigid_partials(value, motion)
    if "load" in model.terms:
        _, velocity, _ = P
        Y = np.zeros((2, len(model.names), motion.theta.shape[1]))
        _fill_eq1({name: Y[:, place] for place, name in enumerate(model.names)}, motion)
        load, sign = _load(model, Y, value), _sign(model, motion.omega)
        e = np.array([[value["e1"]], [value["e2"]]])
        P *= 1 + (e * sign * np.sign(load))[:, None]
        for joint in range(2):
            velocity[joint, joint] += (e * np.abs(load) * (1 - sign**2) / model.coulomb_speed)[joint]
    P[2, 1, 1] += value["j2"]
    slope = friction_slope(model, value, motion.omega)
    P[1, 0, 0] += slope[0]
    P[1, 1, 1] += slope[1]
    P[:, 1] *= 1 + value["gain2"]
    return P


def _rigid_partials(value: dict[str, float], motion: Motion) -> FloatArray:
    """`partials` of inertia, Coriolis and gravity."""
    k1, k2, k3, k4, k5 = (value[name] for name in RIGID)
    s1, _, s2, c2, s12, _ = motion.trigonometry
    omega1, omega2 = motion.omega
    alpha1, alpha2 = motion.alpha
    k1_s2, k1_c2, k2_s12 = k1 * s2, k1 * c2, k2 * s12
    P = np.empty((3, 2, 2, s1.size))
    position, velocity, acceleration = P
    position[0, 0] = -k4 * s1 - k2_s12
    position[0, 1] = -k1_s2 * (2 * alpha1 + alpha2) - k1_c2 * (2 * omega1 + omega2) * omega2 - k2_s12
    position[1, 0] = -k2_s12
    position[1, 1] = k1_c2 * omega1**2 - k1_s2 * alpha1 - k2_s12
    velocity[0, 0] = -2 * k1_s2 * omega2
    velocity[0, 1] = -2 * k1_s2 * (omega1 + omega2)
    velocity[1, 0] = 2 * k1_s2 * omega1
    velocity[1, 1] = 0.0
    acceleration[0, 0] = k5 + k3 + 2 * k1_c2
    acceleration[0, 1] = acceleration[1, 0] = k3 + k1_c2
    acceleration[1, 1] = k3
    return P


def friction_slope(model: Model, value: dict[str, float], omega: FloatArray) -> FloatArray:
    """Derivative (2, N) by its velocity of the friction that a joint's own velocity (2, N) decides."""

    def both(letter: str) -> FloatArray:
        return np.array([[value[f"{letter}1"]], [value[f"{letter}2"]]])

    viscous = np.array([[value["k6"]], [value["k7"]]])
    if not {"coulomb", "stribeck", "asymmetry"} & set(model.terms):
        return np.broadcast_to(viscous, omega.shape)
    sign = _sign(model, omega)
    steep = (1 - sign**2) / model.coulomb_speed
    slope = viscous + (both("f") + 2 * both("a") * sign) * steep
    if "stribeck" in model.terms:
        fading = np.exp(-((omega / model.stribeck_speed) ** 2))
        slope = slope + both("s") * fading * (steep - 2 * omega / model.stribeck_speed**2 * sign)
    return slope


def _sign(model: Model, omega: FloatArray) -> FloatArray:
    """The smooth sign tanh(ω / ω_s) of velocities."""
    return np.tanh(omega / model.coulomb_speed)


def _load(model: Model, Y: FloatArray, value: dict[str, float]) -> FloatArray:
    """L (2, N), from the columns of eq. (1) in Y."""
    rigid = [place for place, name in enumerate(model.names) if name in RIGID]
    k = np.array([value[model.names[place]] for place in rigid])
    return np.einsum("aqn,q->an", Y[:, rigid], k)


def _zeros(value: dict[str, float]) -> FloatArray:
    return np.array([value["zero1"], value["zero2"]])


def acceleration(model: Model, c: FloatArray, theta: FloatArray, omega: FloatArray, tau: FloatArray) -> FloatArray:
    """Accelerations that torques give: `torque` solved for θ̈, without the lag.

    Parameters
    ----------
    model : Model
    c : (q,), in `UNITS`
    theta, omega, tau : (2, N), rad, rad/s and N m

    Returns
    -------
    (2, N), rad/s²

    Notes
    -----
    With L = M θ̈ + n the load, D = 1 + e tanh(ω / ω_s) sgn L and R = diag(0, j2), friction and offsets in r,

        (D M + R) θ̈ = τ / (1, 1 + gain2) - r - D n

    The signs of L are those of the torque left for it, and found again until they are their own.
    """
    value = model.values(c)
    k = np.array([value[name] for name in RIGID] + [0.0, 0.0])
    turned = theta + _zeros(value)[:, None]
    left = np.array(tau, dtype=np.float64)
    left[1] /= 1 + value["gain2"]
    for joint in range(2):
        left[joint] -= value[f"k{joint + 6}"] * omega[joint] + value[f"o{joint + 1}"]
    for name, friction in friction_columns(model, omega).items():
        left -= np.array([[value[f"{name}1"]], [value[f"{name}2"]]]) * friction
    n = passive_torque(k, turned, omega)
    m11, m12, m22 = mass_matrix(k, turned)
    if "load" not in model.terms:
        return _solved(m11, m12, m12, m22 + value["j2"], left - n)
    e = np.array([[value["e1"]], [value["e2"]]]) * _sign(model, omega)
    signs = np.sign(left)
    for _ in range(_SIGN_TRIALS):
        D = 1 + e * signs
        alpha = _solved(D[0] * m11, D[0] * m12, D[1] * m12, D[1] * m22 + value["j2"], left - D * n)
        found = np.sign(np.stack([m11 * alpha[0] + m12 * alpha[1], m12 * alpha[0] + m22 * alpha[1]]) + n)
        if np.array_equal(found, signs):
            break
        signs = found
    return alpha


def _solved(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray, right: FloatArray) -> FloatArray:
    """X (2, N) with [[a, b], [c, d]] x = right."""
    return np.stack([d * right[0] - b * right[1], a * right[1] - c * right[0]]) / (a * d - b * c)
