"""The load that bends elastic joints, and its rates, along a motion.

    L = τ - friction - rotors,   or   L = f(θ - h L, ω - h dL/dt, α - h d²L/dt²)

where no torque is to be used: f are the links' inverse dynamics, and substitution converges below a
joint's resonance. The rates are those of local polynomials of degree `_DEGREE` (Savitzky & Golay
1964), at the ends of the last whole window's: with `_REACH` they follow L below some 9 Hz, without
noise of the angles twice as far.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np

from algid.arm import FloatArray
from algid.estimators.combine import Prior, joined
from algid.model import (
    Model,
    Motion,
    acting,
    apart,
    gains,
    inertia,
    link_motion,
    load,
    summed,
    torque,
)
from algid.physics.signals import Values
from algid.signals.filters import correlate

_ROTOR = 0.5  # a motor's share of the inertia that its joint feels, before any log
_ROUNDS = 6
_STIFF = 80.0  # rad/s: of slower joints substitution takes the load no further than it converges
_DEGREE = 6
_REACH = 0.125  # s, of a window to either side


def with_rotors(known: Prior | None, model: Model) -> Prior | None:
    """What is known, and that a motor's share of an inertia is some half at most."""
    shares = tuple(model.names[share] for share, _ in acting(model, "of_motor"))
    if not shares or (known is not None and not set(shares).isdisjoint(known.names)):
        return known
    size = len(shares)
    return joined(known, Prior(shares, np.zeros(size), np.eye(size) / _ROTOR**2))


def flexed(
    model: Model, c: FloatArray, motion: Motion, dt: float, tau: FloatArray | None = None
) -> Motion:
    """The motion with what bends elastic joints at the coefficients `c` (q,).

    Parameters
    ----------
    model : Model
    c : (q,)
    motion : Motion of N samples, `dt` s apart
    tau : (2, N), N m, optional
        Torques that acted: what of them is no friction and moves no motor passes the joints. None
        takes the load of the links' own motion, by repeated substitution.
    """
    if not acting(model, "elastic"):
        return motion
    reach = 0.5 * _REACH
    if tau is None:
        soft = 0.0
        for place, joint in acting(model, "elastic"):
            swung = inertia(model, c, motion.theta)[joint, joint]
            soft = max(soft, float(np.max(c[place] * swung)))
        reach = _REACH * max(1.0, _STIFF * np.sqrt(soft))
    for _ in range(_ROUNDS if tau is None else 1):
        through = load(model, c, link_motion(model, c, motion))
        if tau is not None:
            through = through + (tau - torque(model, c, motion)) / gains(model, c).reshape(2, -1)
        motion = replace(motion, load=_rates(through, dt, reach))
    return motion


def turns(
    model: Model, c: FloatArray, motion: Motion, J: FloatArray, dt: float
) -> Iterator[tuple[int, FloatArray]]:
    """Places of coefficients, and the links' angles and rates (3, 2, N) per unit of each.

    A compliance turns them by the load, what a motor does not pass on by less load,

        ∂(θ - h L)/∂h = -L,   ∂(θ - h L)/∂c = h ∂(τ - L)/∂c

    Parameters
    ----------
    model, c, dt : as of `flexed`
    motion : Motion with a load
    J : (2, q, N), `algid.model.sensitivity`
    """
    assert motion.load is not None
    compliance = np.zeros((2, 1))
    for place, joint in acting(model, "elastic"):
        compliance[joint] = c[place]
        turn = np.zeros_like(motion.load)
        turn[:, joint] = -motion.load[:, joint]
        yield place, turn
    if not np.any(compliance):  # a rigid joint turns its link by no other coefficient
        return
    beside = {at: J[:, at] for at in set(range(len(model.names))).difference(model.compiled.loads)}
    for share, whole in acting(model, "of_motor"):
        if c[whole] == 0:  # of nothing no motor has a share
            continue
        of_rotor = J[:, whole] + (1 - c[share]) / c[whole] * J[:, share]
        beside |= {share: c[whole] * of_rotor, whole: c[share] * of_rotor}
    for at, column in beside.items():
        if np.any(column):
            held = column / gains(model, c).reshape(2, -1)
            yield at, compliance * _rates(held, dt, 0.5 * _REACH)


def with_bends(model: Model, c: FloatArray, motion: Motion, J: FloatArray, dt: float) -> FloatArray:
    """J (2, q, N), in place, with what coefficients change by turning the links: see `turns`."""
    if motion.load is None:
        return J
    factor, of_links = gains(model, c).reshape(2, -1), Values(link_motion(model, c, motion), model)
    P = np.zeros((3, 2, 2, motion.theta.shape[1]))
    for where, weighted in model.compiled.of_load.partials.items():
        P[where] = summed(weighted, apart(model, c), of_links)
    for place, turn in list(turns(model, c, motion, J, dt)):
        J[:, place] += factor * np.einsum("oabn,obn->an", P, turn)
    return J


def _rates(x: FloatArray, dt: float, seconds: float) -> FloatArray:
    """Signals (2, N), smoothed, and their first two derivatives (3, 2, N).

    Windows reach `seconds` to either side. Zero where the signals are shorter than one.
    """
    reach = max(_DEGREE // 2, round(seconds / dt))
    samples = x.shape[1]
    if samples < 2 * reach + 1:
        return np.zeros((3, *x.shape))
    rates = np.empty((3, *x.shape))
    for own, window in zip(rates, _windows(reach) / dt ** np.arange(3)[:, None, None], strict=True):
        own[:, reach : samples - reach] = correlate(x, window[reach])
        own[:, :reach] = x[:, : 2 * reach + 1] @ window[:reach].T
        own[:, samples - reach :] = x[:, -2 * reach - 1 :] @ window[reach + 1 :].T
    return rates


@lru_cache(maxsize=8)
def _windows(reach: int) -> FloatArray:
    """What a window's samples count for in the rates (3, 2 reach + 1, 2 reach + 1) at each one."""
    powers = np.vander(np.arange(-reach, reach + 1) / reach, _DEGREE + 1, increasing=True)
    to_powers = np.linalg.pinv(powers)
    slope = np.diag(np.arange(1, _DEGREE + 1) / reach, 1)  # of a polynomial, by its coefficients
    return np.stack(
        [powers @ to_powers, powers @ slope @ to_powers, powers @ slope @ slope @ to_powers]
    )
