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
from algid.model import K1, K2, K4, SINE_OF, SINES, phasor
from algid.notices import Notice


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
        return Notice("PHASES", numbers=numbers, note=True)
    return Notice("PHASE", numbers=numbers, note=True)


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
    variance = max(float(slope @ fit.covariance @ slope), 0.0)
    half = float(np.degrees(fit.quantile * np.sqrt(variance)))
    return f"{turned:.3g}° ± {half:.2g}°"
