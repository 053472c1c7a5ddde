"""Meaning of the moments' sine parts: zeros of the angles, centres of mass off the links' lines.

======  =====================================  ========  =======
symbol  name                                   shape     unit
======  =====================================  ========  =======
K       phasor of a moment, k + i k_s          scalar    its own
a       its argument                           scalar    rad
slope   ∂a/∂β                                  (Q,)      mixed
======  =====================================  ========  =======

With centres of mass turned by δ off the lines and zeros off by ε: arg K2 − arg K1 = ε1, and arg K1
= δ2 + ε2, whose parts no torque separates. arg K4 − ε1 is where the load of joint 1 lies that
turns with link 1.
"""

from __future__ import annotations

import numpy as np

from algid.arm import FloatArray
from algid.estimators.diagnostics import bent
from algid.estimators.fit import Fit
from algid.identification.recordings import Recording
from algid.model import K1, K2, K4, SINE_OF, SINES, phasor
from algid.notices import Notice, Remedy


def phase_note(fit: Fit) -> Notice | None:
    """The phases in degrees with their 95 % intervals; None of an arm whose links are straight.

    A shrunk fit has every term: there the links are straight where the sine parts are together
    consistent with nothing.
    """
    if not set(SINES) & set(fit.names):
        return None
    if fit.shrinkage is not None and not bent(fit):
        return None
    second, of_second = _argument(fit, K1)
    numbers = {"second": _in_degrees(fit, second, of_second)}
    if {K2, K4} <= set(fit.names) - set(fit.absent):
        whole, of_whole = _argument(fit, K2)
        load, of_load = _argument(fit, K4)
        first, of_first = whole - second, of_whole - of_second
        numbers["first"] = _in_degrees(fit, first, of_first)
        numbers["load"] = _in_degrees(fit, load - first, of_load - of_first)
        return Notice("PHASES", numbers={"case": "gravity"} | numbers)
    return Notice("PHASES", numbers={"case": "no gravity"} | numbers)


LEAST_TURN = np.radians(20.0)
"""rad: gravity that is turned by more, beyond its interval, is no base that is not quite level."""
LEAST_SURE = 5.0  # standard deviations of k1 and of k2 that an angle between them needs


def turn_note(fit: Fit, log: Recording) -> Notice | None:
    """That gravity is turned against θ1 as `log` was read, with the zero that turns it back.

    Where its named zeros lie within the interval of ε1, the nearest is named. None where gravity is
    turned by less than `LEAST_TURN`, and where it may be upside down, which signs make too.
    """
    from algid.inspection.conventions import zeroed

    names = set(fit.names) - set(fit.absent)
    if not {K1, K2, SINE_OF[K1], SINE_OF[K2]} <= names or fit.shared.model.gravity == 0:
        return None
    if min(_certainty(fit, K1), _certainty(fit, K2)) < LEAST_SURE:
        return None
    (second, of_second), (whole, of_whole) = _argument(fit, K1), _argument(fit, K2)
    turn = float(np.remainder(whole - second + np.pi, 2 * np.pi) - np.pi)
    half = _half(fit, of_whole - of_second)
    if not abs(turn) - half > LEAST_TURN or abs(turn) + half >= np.pi:
        return None
    anyway = Remedy({"accept": "WRONG_ZERO"}, "where the arm is mounted so")
    numbers = {"turn": float(np.degrees(turn))}
    return Notice("WRONG_ZERO", numbers=numbers, remedies=(zeroed(log.origin, turn, half), anyway))


def _certainty(fit: Fit, name: str) -> float:
    """Size of the moment `name` in its standard deviations."""
    places = [fit.names.index(name), fit.names.index(SINE_OF[name])]
    K = fit.values[places]
    size = float(np.linalg.norm(K))
    variance = float(K @ fit.covariance[np.ix_(places, places)] @ K)
    if not np.all(np.isfinite(fit.std[places])) or variance <= 0:
        return 0.0
    return size**2 / float(np.sqrt(variance))


def _argument(fit: Fit, name: str) -> tuple[float, FloatArray]:
    """Argument of the moment `name` and its slope (Q,)."""
    K = phasor(fit.shared.model, fit.values[: len(fit.shared.model.names)], name)
    slope = np.zeros(len(fit.names))
    square = max(abs(K) ** 2, 1e-300)
    slope[fit.names.index(name)] = -K.imag / square
    slope[fit.names.index(SINE_OF[name])] = K.real / square
    return float(np.angle(K)), slope


def _in_degrees(fit: Fit, angle: float, slope: FloatArray) -> str:
    turned = float(np.degrees(np.remainder(angle + np.pi, 2 * np.pi) - np.pi))
    return f"{turned:.3g}° ± {np.degrees(_half(fit, slope)):.2g}°"


def _half(fit: Fit, slope: FloatArray) -> float:
    """Half the 95 % interval of what has this slope (Q,)."""
    return fit.quantile * float(np.sqrt(max(float(slope @ fit.covariance @ slope), 0.0)))
