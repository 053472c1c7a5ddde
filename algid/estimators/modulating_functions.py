"""The momentum form of the equations of motion on sliding windows (method of modulating functions).

Multiplied by a window φ that vanishes with three derivatives at both ends, and integrated by
parts, eq. (1) needs no acceleration, and a velocity only beside k1:

    ∫φ τ1 = (k5+k3)∫φ'' θ1 + k1[−2∫φ' c2 θ̇1 + ∫φ'' s2] + k3∫φ'' θ2 − k6∫φ' θ1 + k4∫φ cos θ1 + k2∫φ
    cos(θ1+θ2) ∫φ τ2 = k3∫φ''(θ1+θ2) + k1[−∫φ' c2 θ̇1 + ∫φ (θ̇1² + θ̇1 θ̇2) s2] − k7∫φ' θ2 + k2∫φ
    cos(θ1+θ2)

======  =========================================================  ================  ======
symbol  name                                                       shape             unit
======  =========================================================  ================  ======
φ       window s^4 (1 - s)^4, integral 1, and two derivatives      (3, L)            s^-1…
h       samples from a window to the next, L / `OVERLAP`           scalar            1
X       columns of the two equations, the torque's moment last     (2, q + 1, R)     mixed
======  =========================================================  ================  ======

The windows overlap `OVERLAP`-fold. Each signal meets each block of h samples once, in a matrix
product; a window's moment is the sum over its blocks. The cost is O(N), whatever the length of the
window.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache, partial

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from algid.arm import FloatArray, read_only
from algid.estimators.elastic import flexed, turns
from algid.model import (
    Model,
    Motion,
    acting,
    apart,
    differentiate,
    gains,
    link_motion,
    load,
    sensitivity,
    smooth_sign,
    torques_of,
)
from algid.physics.signals import WIDTHS, Expression, Product, Values
from algid.signals.filters import correlate, differentiator, half_length, smoother
from algid.signals.segments import Segment

OVERLAP = 8
_WINDOW = Polynomial([0, 1]) ** 4 * Polynomial([1, -1]) ** 4
_FLEXED = 1e-4  # rad: by how much links are turned for differences
_WINDOW_INTEGRAL = 1 / 630  # Beta(5, 5)

Rest = tuple[float, float]
"""Speeds of the joints in rad/s, RMS over a window, below which one stands."""
Known = dict[Hashable, FloatArray]
"""Cached moments and velocities of one piece, of those that stay valid for another model."""


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows of `length` s every `length / OVERLAP` s on samples `dt` s apart.

    `shift` is the time in s after which a logged torque acts; `bandwidth` in Hz is the
    differentiator's, None where the log's own velocities are used.
    """

    dt: float
    length: float
    shift: float = 0.0
    bandwidth: float | None = 40.0

    @cached_property
    def step(self) -> int:
        """h: samples from a window to the next."""
        return max(1, round(self.length / self.dt / OVERLAP))

    @cached_property
    def whole(self) -> int:
        """Whole samples in the shift."""
        return round(self.shift / self.dt)

    @cached_property
    def margin(self) -> int:
        """Samples before the first and after the last window, a multiple of h."""
        reach = 0 if self.bandwidth is None else half_length(self.dt, self.bandwidth)
        return self.step * -(-max(reach, abs(self.whole)) // self.step)

    @property
    def _own(self) -> Hashable:
        """What of the windows changes the moments of a motion."""
        return self.dt, self.step, self.margin, self.bandwidth

    @property
    def overlap(self) -> int:
        """Samples that consecutive pieces must share, so that no window is lost between them."""
        return 2 * self.margin + (OVERLAP - 1) * self.step

    def count(self, piece: Segment) -> int:
        """R: how many whole windows a piece holds."""
        return max(0, (len(piece) - 2 * self.margin) // self.step - OVERLAP + 1)

    def moments(self, signals: FloatArray, order: int = 0, late: float = 0.0) -> FloatArray:
        """Integrals of φ, φ' or φ'' times each signal, window by window.

        Parameters
        ----------
        signals : (m, n), unit u
        order : of the derivative, 0 … 2
        late : samples by which the signals come later than the windows

        Returns
        -------
        (m, R), with R = n // h - `OVERLAP` + 1 whole windows, unit u over s^`order`
        """
        kernel = _kernels(OVERLAP * self.step, self.dt, late)[order]
        rows = signals.shape[1] // self.step
        blocks = signals[:, : rows * self.step].reshape(signals.shape[0], rows, self.step)
        parts = kernel.reshape(OVERLAP, self.step) @ blocks.swapaxes(1, 2)
        ends = range(rows - OVERLAP + 1, rows + 1)
        return np.sum([parts[:, part, part:end] for part, end in enumerate(ends)], axis=0)

    def equations(
        self,
        model: Model,
        piece: Segment,
        delay: bool = False,
        at: FloatArray | None = None,
        known: Known | None = None,
    ) -> FloatArray:
        """X, the columns of both joints' equations and the torque's moment, window by window.

        Parameters
        ----------
        model : Model
        piece : Segment
        delay : bool
            Whether there is a column for a change of `shift`, last but the torque.
        at : (q,), in `algid.model.UNITS`
            Where terms that are not linear are linearised.
        known : of the same piece and hold of the torque, by windows of any kind
            Moments made before, to be used again; those that are made now join them.

        Returns
        -------
        (2, q + 1, R) or, with the delay, (2, q + 2, R); R = 0 for a piece shorter than a window

        Raises
        ------
        ValueError
            If the log's own velocities are asked for, and there are none.

        Notes
        -----
        Where the torque is bilinear in the coefficients, X is linearised at the coefficients `at`
        (q,) so that least squares on it gives better ones; without `at` the columns of gains and
        of friction by load are nothing. The load is that of `at` (a fixed point, not a
        derivative): least squares settles in a few rounds.
        """
        q, count = len(model.names), self.count(piece)
        if not count:
            return np.zeros((2, q + delay + 1, 0))
        here = np.zeros(q) if at is None else at
        known = {} if known is None else known
        theta = piece.theta[:, self.margin : len(piece) - self.margin]

        def motion() -> Motion:
            # a change of friction's width asks for it again
            omega = self._once(known, "velocity", partial(self.velocities, piece))
            return Motion(theta, omega, omega)

        def acted(order: int) -> FloatArray:
            moments = partial(self.torque_moments, piece.tau, order)
            return self._once(known, (self.shift, order), moments)

        X = self.columns(model, theta.shape[1], motion, known)
        bends: FloatArray | float = 0.0
        if at is not None and acting(model, "elastic"):
            bends = self._bend(X, model, at, motion(), self._acting(piece.tau))
        for share, whole in acting(model, "of_motor"):
            X[:, share] = here[whole] * (X[:, share] - X[:, whole])
        if at is not None and acting(model, "by_load"):
            accelerated = self._accelerated(motion())
            L = load(model, at, accelerated)
            moments = self.moments(np.abs(L) * smooth_sign(model, accelerated.omega))
            for place, joint in acting(model, "by_load"):
                X[joint, place] = moments[joint]
        factor = gains(model, here)[:, None, None]
        X *= factor
        # with the derivative J at c0 of Y c0, τ = Y c0 + J (c - c0) is J c = τ + (J - Y) c0
        made = torques_of(X, here)
        differentiate(model, X, here)
        X += bends * factor
        y = acted(0) + torques_of(X, here) - made
        if model.lag_name is not None:
            X[:, model.names.index(model.lag_name)] = acted(1)
        late = [-acted(1)[:, None]] if delay else []
        return np.concatenate([X, *late, y[:, None]], axis=1)

    def beside(
        self, piece: Segment, made: Callable[[FloatArray, Motion], FloatArray]
    ) -> FloatArray:
        """Moments (2, m, R) of torques (m, 2, n) that are `made` of a piece with a window."""
        theta = piece.theta[:, self.margin : len(piece) - self.margin]
        omega = self.velocities(piece)
        motion = self._accelerated(Motion(theta, omega, omega))
        rows = made(self._acting(piece.tau), motion).swapaxes(0, 1)
        return np.stack([self.moments(own) for own in rows])

    def _accelerated(self, motion: Motion) -> Motion:
        """The motion with the accelerations that its velocities have."""
        return replace(motion, alpha=np.gradient(motion.omega, self.dt, axis=1))

    def _bend(
        self,
        X: FloatArray,
        model: Model,
        c: FloatArray,
        motion: Motion,
        tau: FloatArray,
    ) -> FloatArray:
        """What coefficients change by turning the links behind elastic joints (2, q, R).

        It is found by differences, so that moments need no derivative of the load's rate. The
        links' columns of X get the links' own motion.
        """
        own = list(model.compiled.loads)

        def columns(links: Motion) -> FloatArray:
            return self.columns(model, tau.shape[1], lambda: links, {})[:, own]

        late = np.arange(tau.shape[1]) - (self.shift / self.dt - self.whole)
        acting = np.stack([np.interp(late, np.arange(tau.shape[1]), row) for row in tau])
        motion = flexed(model, c, self._accelerated(motion), self.dt, acting)
        links = link_motion(model, c, motion)
        X[:, own] = columns(links)
        bends = np.zeros((2, len(c), X.shape[2]))
        J = sensitivity(model, c, motion)
        for place, turn in turns(model, c, motion, J, self.dt):
            step = _FLEXED / max(float(np.abs(turn[0]).max()), 1e-300)
            theta, omega = links.theta + step * turn[0], links.omega + step * turn[1]
            moved = columns(Motion(theta, omega, omega)) - X[:, own]
            bends[:, place] += np.einsum("aqr,q->ar", moved, apart(model, c)[own]) / step
        return bends

    def _acting(self, torques: FloatArray) -> FloatArray:
        """Torques (m, n) that act where a piece's windows are, of all (m, N) of the piece."""
        first = self.margin - self.whole
        return torques[:, first : torques.shape[1] - self.margin - self.whole]

    def torque_moments(self, torques: FloatArray, order: int = 0) -> FloatArray:
        """Integrals (m, R) of φ or φ' times torques (m, N) of a piece that holds a window."""
        return self.moments(self._acting(torques), order, self.shift / self.dt - self.whole)

    def _once(self, known: Known, what: Hashable, make: Callable[[], FloatArray]) -> FloatArray:
        """What is `known` of a piece by these windows, or is made now."""
        key = self._own, what
        if key not in known:
            known[key] = make()
        return known[key]

    def columns(
        self, model: Model, samples: int, motion: Callable[[], Motion], known: Known
    ) -> FloatArray:
        """Moments (2, q, R) of the columns of τ = d²s/dt² + dp/dt + f: ∫φ″ s - ∫φ′ p + ∫φ f.

        Along a `motion` of so many samples, made where moments are not `known`.
        """
        X = np.zeros((2, len(model.names), samples // self.step - OVERLAP + 1))
        values = cache(lambda: Values(motion(), model))

        def moment(order: int, product: Product) -> FloatArray:
            return self.moments(np.full((1, samples), values().of(product)), order)

        for order, by_joint in enumerate(model.compiled.parts):
            for rows, weighted in zip(X, by_joint, strict=True):
                for product, pairs in weighted.items():
                    # a window's integral is one, its derivatives' are nothing
                    own: FloatArray | float = float(order == 0)
                    if product:
                        widths = tuple(getattr(model, name) for name in _widths(product))
                        made = partial(moment, order, product)
                        own = self._once(known, (order, product, widths), made)[0]
                    for place, factor in pairs:
                        rows[place] += (-1) ** order * factor * own
        return X

    def moving(self, piece: Segment, rest: Rest | None) -> NDArray[np.bool_]:
        """In which windows (2, R) a joint is no slower than its `rest`, if one is given."""
        if rest is None:
            return np.ones((2, self.count(piece)), dtype=bool)
        return self.square_speeds(piece) >= np.square(rest)[:, None]

    def square_speeds(self, piece: Segment) -> FloatArray:
        """Each joint's squared velocity (2, R) in (rad/s)², averaged over `equations` windows."""
        if not self.count(piece):
            return np.zeros((2, 0))
        return self.moments(self.velocities(piece) ** 2)

    def velocities(self, piece: Segment) -> FloatArray:
        """Velocities (2, n) where the piece's windows are: the log's own, or below the bandwidth.

        Raises
        ------
        ValueError
            If there are to be the log's own, and it has none.
        """
        if self.bandwidth is not None:
            return self._passed(piece, differentiator(self.dt, self.bandwidth))
        if piece.omega is None:
            raise ValueError("the log has no velocities: give the differentiator's bandwidth")
        return piece.omega[:, self.margin : len(piece) - self.margin]

    def angles(self, piece: Segment) -> FloatArray:
        """Angles (2, n) where the piece's windows are, below the bandwidth if there is one."""
        if self.bandwidth is not None:
            return self._passed(piece, smoother(self.dt, self.bandwidth))
        return piece.theta[:, self.margin : len(piece) - self.margin]

    def _passed(self, piece: Segment, kernel: FloatArray) -> FloatArray:
        first = self.margin - kernel.size // 2
        return correlate(piece.theta[:, first : len(piece) - first], kernel)


@cache
def _widths(product: Product) -> list[str]:
    """The widths of friction that a product depends on."""
    leaves = Expression({product: 1.0}).leaves
    return [name for name, width in WIDTHS.items() if width in leaves]


@lru_cache(maxsize=32)
def _kernels(length: int, dt: float, offset: float) -> FloatArray:
    """φ, φ' and φ'' (3, L) at the samples plus `offset` samples, times dt, in 1, 1/s and 1/s²."""
    s = np.clip((np.arange(length) + offset) / length, 0, 1)
    window = _WINDOW / _WINDOW_INTEGRAL
    span = length * dt
    return read_only(
        np.stack([window.deriv(order)(s) * dt / span ** (order + 1) for order in range(3)])
    )


EPS = float(np.finfo(np.float64).eps)
ROUNDINGS = 4.0  # of the largest product: more make the sums of products uncertain
MOTORLESS = 0.1
"""Least residual of a joint without a motor (bearing, cables), as a share of the driven one's."""


def row_weights(gram: FloatArray, v: FloatArray, rows: int | FloatArray) -> FloatArray:
    """Inverse residual variance (..., 2) of a row of each joint.

    Parameters
    ----------
    gram : (..., 2, m, m)
        Gram matrices of the columns by joint, the torque last; of several logs at once.
    v : (m,)
        What makes a residual of the columns: the coefficients with their sign turned, and 1 for
        the torque.
    rows : int or (..., 2)

    Notes
    -----
    What products of columns leave of a residual's squares cannot be below the rounding of the
    products, and counts as that; and never below 1e-12 of the torque. The joint with the larger
    torque sets that measure: a joint without a motor has none, and its load is of the size of the
    other's. Constants that are nothing solve the equation of a joint without a motor exactly, and
    the better it is solved the more it would weigh: its residual counts as `MOTORLESS` of the
    other's at least.
    """
    least = ROUNDINGS * EPS * (np.abs(gram) @ np.abs(v)) @ np.abs(v)
    squares = np.maximum((gram @ v) @ v, least)
    driven = gram[..., -1, -1] > 0
    alone = np.sum(driven, axis=-1, keepdims=True) == 1
    each = np.where(driven, squares / np.maximum(rows, 1), 0.0)
    of_motorless = MOTORLESS**2 * each.max(axis=-1, keepdims=True) * rows
    squares = np.where(alone & ~driven, np.maximum(squares, of_motorless), squares)
    torque = gram[..., -1, -1].max(axis=-1, keepdims=True)
    return np.asarray(rows / np.maximum(squares, 1e-24 * torque + 1e-300))
