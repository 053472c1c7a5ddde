"""Moments whose centres of mass lie off the links' lines, as size and angle: K = |K| exp(i a).

======  =====================  ======  =======
symbol  name                   shape   unit
======  =====================  ======  =======
K       moment, k + i k_s      scalar  its own
a       its angle              scalar  rad
C       covariance of k, k_s   (2, 2)  own²
======  =====================  ======  =======

To first order the size's variance is uᵀ C u and the angle's vᵀ C v / |K|², with u along K and v
across it.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray
from algid.base.text import resolved, significant
from algid.model import SINES
from algid.results import Result


@dataclass(frozen=True)
class Moment:
    """A moment as size and angle in degrees, with standard deviations, None where not known.

    `quantile` is half a 95 % interval in standard deviations.
    """

    size: float
    std: float | None
    angle: float
    angle_std: float | None
    unit: str
    quantile: float

    @property
    def half(self) -> float | None:
        """Half the 95 % interval of the size."""
        return None if self.std is None else self.quantile * self.std

    @property
    def angle_text(self) -> str:
        """The angle with half its 95 % interval, in degrees."""
        half = None if self.angle_std is None else self.quantile * self.angle_std
        return f"{resolved(self.angle, self.angle_std)}° ± {significant(half, 2)}°"


def moments(result: Result) -> dict[str, Moment]:
    """By name of its cosine part each moment that has a phase.

    None of straight arms, nor where the phases are shrunk to nothing.
    """
    shrunk: list[str] = []
    if result.torque_model is not None:
        shrunk = result.torque_model.shrunk
    by_name = {}
    for sine, name in SINES.items():
        if sine not in shrunk:
            moment = _moment(result, name, sine)
            if moment is not None:
                by_name[name] = moment
    return by_name


def _moment(result: Result, name: str, sine: str) -> Moment | None:
    """The moment of a cosine part `name` and its sine part; None where one is not known."""
    cosine_part, sine_part = result.parameters.get(name), result.parameters.get(sine)
    if cosine_part is None or cosine_part.estimate is None:
        return None
    if sine_part is None or sine_part.estimate is None:
        return None
    K = complex(cosine_part.estimate, sine_part.estimate)
    C = _covariance(result, name, sine)
    std = angle_std = None
    if C is not None and K:
        along = np.array([K.real, K.imag]) / abs(K)
        across = np.array([-K.imag, K.real]) / abs(K)
        std = math.sqrt(max(float(along @ C @ along), 0.0))
        angle_std = math.degrees(math.sqrt(max(float(across @ C @ across), 0.0)) / abs(K))
    angle = math.degrees(cmath.phase(K))
    return Moment(abs(K), std, angle, angle_std, cosine_part.unit, result.quantile)


def _covariance(result: Result, *names: str) -> FloatArray | None:
    """Their covariance (2, 2); None where one has no error bar."""
    if result.fit is None:
        return None
    C: FloatArray = result.fit.covariance_of(names)
    if not np.isfinite(C).all():
        return None
    return C
