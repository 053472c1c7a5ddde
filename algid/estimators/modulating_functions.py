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

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache

import numpy as np
from numpy.polynomial import Polynomial

from algid.arm import FloatArray
from algid.estimators.elastic import flexed, turns
from algid.model import (
    Model,
    Motion,
    acting,
    apart,
    gains,
    inertial,
    link_motion,
    load,
    sensitivity,
    smooth_sign,
)
from algid.physics.signals import WIDTHS, Expression, Product, Values
from algid.signals.filters import correlate, differentiator, half_length
from algid.signals.segments import Segment

OVERLAP = 8
_WINDOW = Polynomial([0, 1]) ** 4 * Polynomial([1, -1]) ** 4
_FLEXED = 1e-4  # rad: by how much links are turned for differences
_WINDOW_INTEGRAL = 1 / 630  # Beta(5, 5)

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

    def kernels(self, offset: float = 0.0) -> FloatArray:
        """φ, φ' and φ'' at the samples plus `offset` samples, times dt: weights of a quadrature.

        Returns
        -------
        (3, L), in 1, 1/s and 1/s²
        """
        return _kernels(OVERLAP * self.step, self.dt, offset)

    @cached_property
    def _plain(self) -> FloatArray:
        return self.kernels()

    @cached_property
    def _shifted(self) -> FloatArray:
        return self.kernels(self.shift / self.dt - self.whole)

    def moments(self, signals: FloatArray, kernel: FloatArray) -> FloatArray:
        """Integrals of a kernel times each signal, window by window.

        Parameters
        ----------
        signals : (m, n), unit u
        kernel : (L,), of `kernels`

        Returns
        -------
        (m, R), with R = n // h - `OVERLAP` + 1 whole windows, unit u times the kernel's
        """
        rows = signals.shape[1] // self.step
        blocks = signals[:, : rows * self.step].reshape(signals.shape[0], rows, self.step)
        parts = kernel.reshape(OVERLAP, self.step) @ blocks.swapaxes(1, 2)
        wanted = rows - OVERLAP + 1
        result = np.zeros((signals.shape[0], wanted))
        for part in range(OVERLAP):
            result += parts[:, part, part : part + wanted]
        return result

    def equations(
        self,
        model: Model,
        piece: Segment,
        delay: bool,
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
        size = len(model.names) + delay + 1
        margin = self.margin
        if (len(piece) - 2 * margin) // self.step < OVERLAP:
            return np.zeros((2, size, 0))
        here = np.zeros(len(model.names)) if at is None else at
        known = {} if known is None else known
        tau = self._acting(piece.tau)
        theta = piece.theta[:, margin : len(piece) - margin]
        X = np.zeros((2, size, (len(piece) - 2 * margin) // self.step - OVERLAP + 1))
        speed = (self._own, "velocity")  # a change of friction's width asks for it again

        def motion() -> Motion:
            omega = known[speed] = known[speed] if speed in known else self._velocity(piece)
            return Motion(theta, omega, omega)

        self._fill(X, model, motion, theta.shape[1], known)
        bends = None
        if at is not None and acting(model, "elastic"):
            bends = self._bend(X, model, at, motion(), tau)
        for share, whole in acting(model, "of_motor"):
            X[:, share] = here[whole] * (X[:, share] - X[:, whole])
            if bends is not None:
                bends[:, whole] += here[share] / (here[whole] or 1.0) * X[:, share]
        if at is not None and acting(model, "by_load"):
            omega = motion().omega
            L = load(model, at, Motion(theta, omega, np.gradient(omega, self.dt, axis=1)))
            for place, joint in acting(model, "by_load"):
                dissipated = np.abs(L[joint]) * smooth_sign(model, omega[joint])
                X[joint, place] = self.moments(dissipated[None], self._plain[0])[0]
        X *= gains(model, here)[:, None, None]
        X[:, -1] = self._of_torque(tau, 0, known)
        if at is not None:
            _linearise_bilinear(X, model, at)
        if at is not None and bends is not None:
            bends *= gains(model, at)[:, None, None]
            X[:, : len(at)] += bends
            X[:, -1] += np.einsum("j,ajr->ar", at, bends)
        slope = delay or model.lag_name is not None
        tau_slope = self._of_torque(tau, 1, known) if slope else 0.0
        if model.lag_name is not None:
            X[:, model.names.index(model.lag_name)] = tau_slope
        if delay:
            X[:, -2] = -tau_slope
        return X

    def beside(
        self, piece: Segment, made: Callable[[FloatArray, Motion], Sequence[FloatArray]]
    ) -> FloatArray:
        """Moments (2, m, R) of what is `made` of torques and motion of a piece with a window."""
        theta = piece.theta[:, self.margin : len(piece) - self.margin]
        omega = self._velocity(piece)
        motion = Motion(theta, omega, np.gradient(omega, self.dt, axis=1))
        rows = np.stack(made(self._acting(piece.tau), motion), axis=1)
        return np.stack([self.moments(own, self._plain[0]) for own in rows])

    def columns(self, model: Model, motion: Motion) -> FloatArray:
        """Moments (2, q, R) of the model's columns along a motion with velocities, by windows."""
        samples = motion.theta.shape[1]
        X = np.zeros((2, len(model.names), samples // self.step - OVERLAP + 1))
        self._fill(X, model, lambda: motion, samples, {})
        return X

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
        own, links_own = list(inertial(model)), apart(model, c)[list(inertial(model))]
        late = np.arange(tau.shape[1]) - (self.shift / self.dt - self.whole)
        acting = np.stack([np.interp(late, np.arange(tau.shape[1]), row) for row in tau])
        alpha = np.gradient(motion.omega, self.dt, axis=1)
        motion = flexed(model, c, replace(motion, alpha=alpha), self.dt, acting)
        links = link_motion(model, c, motion)
        X[:, own] = self.columns(model, links)[:, own]
        bends = np.zeros((2, len(c), X.shape[2]))
        J = sensitivity(model, c, motion)
        for place, turn in turns(model, c, motion, J, self.dt):
            step = _FLEXED / max(float(np.abs(turn[0]).max()), 1e-300)
            theta, omega = links.theta + step * turn[0], links.omega + step * turn[1]
            moved = self.columns(model, Motion(theta, omega, omega))[:, own] - X[:, own]
            bends[:, place] += np.einsum("aqr,q->ar", moved, links_own) / step
        return bends

    def _acting(self, torques: FloatArray) -> FloatArray:
        """Torques (m, n) that act where a piece's windows are, of all (m, N) of the piece."""
        first = self.margin - self.whole
        return torques[:, first : torques.shape[1] - self.margin - self.whole]

    def torque_moments(self, torques: FloatArray) -> FloatArray:
        """Integrals (m, R) of φ times torques (m, N) of a piece that holds a window."""
        return self.moments(self._acting(torques), self._shifted[0])

    def _of_torque(self, tau: FloatArray, order: int, known: Known) -> FloatArray:
        """Moments (2, R) of the torques (2, n) by φ or φ', as late as they act."""
        key = (self._own, self.shift, order)
        if key not in known:
            known[key] = self.moments(tau, self._shifted[order])
        return known[key]

    def _fill(
        self,
        X: FloatArray,
        model: Model,
        motion: Callable[[], Motion],
        samples: int,
        known: Known,
    ) -> None:
        """Write moments of the columns of τ = d²s/dt² + dp/dt + f to X: ∫φ″ s - ∫φ′ p + ∫φ f."""
        own = self._own

        def key(order: int, product: Product) -> Hashable:
            widths = tuple(getattr(model, name) for name in _widths(product))
            return own, order, product, widths

        values: Values | None = None
        for order, (one, two) in enumerate(model.compiled.parts):
            products = [product for product in {**one, **two} if product]
            missing = [product for product in products if key(order, product) not in known]
            if missing:
                values = values or Values(motion(), model)
                signals = np.empty((len(missing), samples))
                for signal, product in zip(signals, missing, strict=True):
                    signal[:] = values.of(product)
                moments = self.moments(signals, self._plain[order])
                known.update(zip([key(order, one) for one in missing], moments, strict=True))
            for rows, weighted in zip(X, (one, two), strict=True):
                for product, pairs in weighted.items():
                    # a window's integral is one, its derivatives' are nothing
                    moment = known[key(order, product)] if product else float(order == 0)
                    for place, factor in pairs:
                        rows[place] += (-1) ** order * factor * moment

    def square_speeds(self, piece: Segment) -> FloatArray:
        """Each joint's squared velocity (2, R) in (rad/s)², averaged over `equations` windows."""
        if (len(piece) - 2 * self.margin) // self.step < OVERLAP:
            return np.zeros((2, 0))
        return self.moments(self._velocity(piece) ** 2, self._plain[0])

    def _velocity(self, piece: Segment) -> FloatArray:
        inner = slice(self.margin, len(piece) - self.margin)
        if self.bandwidth is None:
            if piece.omega is None:
                raise ValueError("the log has no velocities: give the differentiator's bandwidth")
            return piece.omega[:, inner]
        reach = half_length(self.dt, self.bandwidth)
        kernel = differentiator(self.dt, self.bandwidth)
        return correlate(
            piece.theta[:, self.margin - reach : len(piece) - self.margin + reach], kernel
        )


@cache
def _widths(product: Product) -> list[str]:
    """The widths of friction that a product depends on."""
    leaves = Expression({product: 1.0}).leaves
    return [name for name, width in WIDTHS.items() if width in leaves]


@lru_cache(maxsize=32)
def _kernels(length: int, dt: float, offset: float) -> FloatArray:
    s = np.clip((np.arange(length) + offset) / length, 0, 1)
    span = length * dt
    window = _WINDOW / _WINDOW_INTEGRAL
    kernels = np.stack([window(s), window.deriv()(s), window.deriv(2)(s)])
    for order in range(3):
        kernels[order] /= span ** (order + 1)
    kernels *= dt
    kernels.setflags(write=False)
    return kernels


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
    v : (m,) or (k, m), then the weights are (k, ..., 2)
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
    V = np.atleast_2d(v).T
    least = ROUNDINGS * EPS * np.sum(np.abs(V) * (np.abs(gram) @ np.abs(V)), axis=-2)
    squares = np.moveaxis(np.maximum(np.sum(V * (gram @ V), axis=-2), least), -1, 0)
    squares = squares.reshape(v.shape[:-1] + squares.shape[1:])
    driven = gram[..., -1, -1] > 0
    alone = np.sum(driven, axis=-1, keepdims=True) == 1
    each = np.where(driven, squares / np.maximum(rows, 1), 0.0)
    of_motorless = MOTORLESS**2 * each.max(axis=-1, keepdims=True) * rows
    squares = np.where(alone & ~driven, np.maximum(squares, of_motorless), squares)
    torque = gram[..., -1, -1].max(axis=-1, keepdims=True)
    return np.asarray(rows / np.maximum(squares, 1e-24 * torque + 1e-300))


def _linearise_bilinear(X: FloatArray, model: Model, at: FloatArray) -> None:
    """Complete X, made at `at`, by the gains' columns, and the torque by the linearisation's part.

    With Y the regressor at c0 and J the derivative there, τ = Y c0 + J (c - c0) is J c = τ + (J -
    Y) c0; J and Y differ in the columns of gains alone.
    """
    factor, moved = gains(model, at), []
    for place, joint in acting(model, "gains"):
        X[joint, place] = X[joint, : len(at)].T @ at / factor[joint]
        moved.append(place)
    X[:, -1] += np.einsum("j,ajr->ar", at[moved], X[:, moved])
