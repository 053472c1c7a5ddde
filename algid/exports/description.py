"""Content of an export: the arm's coefficients, its links, and the source of each number.

k1 = m2 l1 lc2 and k2 = m2 g lc2 leave l1 = g k1 / k2 to a model made of links. Where l1 is known,
the estimates are conditioned on it: with their covariance C and a the gradient of g k1 - l1 k2,

    c' = c - C a (g k1 - l1 k2) / (aᵀ C a),   C' = C - C a aᵀ C / (aᵀ C a)

Of moments off the links' lines k1 and k2 are the sizes |K1| and |K2|, and the step is repeated.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from algid.arm import FloatArray
from algid.base.errors import ResultError, SettingError
from algid.exports.links import Knowns, Link, links_of, turn_of
from algid.identification.known import (
    contradictions,
    covariance_of,
    first_length,
    given_lengths,
    has_error_bar,
    model_of,
    payload_length,
    torque_constants,
    wrong_inertia,
)
from algid.model import K1, K2, SINES, Model, length_by_coupling, phasor
from algid.notices import Notice
from algid.options import flag
from algid.results import Result


@dataclass(frozen=True)
class Coefficients:
    """The torque's model, its coefficients by name, and half their 95 % intervals where known.

    `value` holds a zero for every coefficient that the model lacks; `conditioned` says whether l1
    moved them.
    """

    model: Model
    value: Mapping[str, float]
    half: Mapping[str, float]
    conditioned: bool = False


def coefficients_of(result: Result, file: str, l1: float | None = None) -> Coefficients:
    """Coefficients of the result in `file`, conditioned on link 1's length `l1` in m if given.

    Raises
    ------
    ResultError
        If a coefficient has no estimate, or no arm has such an inertia matrix.
    """
    model = model_of(result)
    c = torque_constants(result, model, "unloaded", file)
    known = [name for name in model.names if has_error_bar(result, name)]
    C = covariance_of(result, model.names, known)
    conditioned = l1 is not None and model.gravity > 0
    if l1 is not None and conditioned:
        c, C = _conditioned(model, c, C, l1)
    value = model.values(c)
    half = result.quantile * np.sqrt(np.maximum(np.diag(C), 0.0))
    halves = dict(zip(model.names, half.tolist(), strict=True))
    wrong = wrong_inertia(value)
    if wrong is not None:
        mend = "identify it from more informative logs"
        if conditioned:
            mend = f"check {flag('l1')}"
        raise ResultError(f"{file}: {wrong}, so that masses would come out negative; {mend}")
    return Coefficients(model, value, {name: halves[name] for name in known}, conditioned)


def _conditioned(
    model: Model, c: FloatArray, C: FloatArray, l1: float
) -> tuple[FloatArray, FloatArray]:
    """Coefficients and covariance under g |K1| = l1 |K2|, which is linear without sine parts."""
    for _ in range(_STEPS):
        wrong, a = _mismatch(model, c, l1)
        if abs(wrong) <= _ROUNDING * l1 * abs(phasor(model, c, K2)):
            break
        toward = C @ a
        if not a @ toward > 0:  # no error bars: the moments are equally wrong for their size
            toward = c**2 * a
        c = c - toward * wrong / (a @ toward)
    _, a = _mismatch(model, c, l1)
    spread = a @ C @ a
    if spread > 0:
        C = C - np.outer(C @ a, a @ C) / spread
    return c, C


_STEPS, _ROUNDING = 20, 1e-15
"""Newton's, of which a plane needs one, and what of l1 |K2| is rounding."""


def _mismatch(model: Model, c: FloatArray, l1: float) -> tuple[float, FloatArray]:
    """How far g |K1| is from l1 |K2|, and the gradient of their difference (q,)."""
    a = np.zeros(c.size)
    wrong = 0.0
    sines = {of: own for own, of in SINES.items() if own in model.names}
    for name, factor in ((K1, model.gravity), (K2, -l1)):
        K = phasor(model, c, name)
        if name not in sines:
            wrong += factor * K.real
            a[model.names.index(name)] = factor
            continue
        size = max(abs(K), 1e-300)
        wrong += factor * size
        a[model.names.index(name)] = factor * K.real / size
        a[model.names.index(sines[name])] = factor * K.imag / size
    return wrong, a


@dataclass(frozen=True)
class Description:
    """An arm to be written.

    Parameters
    ----------
    name : str, a word of letters, digits and underscores
    source : str, the result's file and estimator
    coefficients : Coefficients
    known : Knowns, of the user and of the result's own call
    delay : float or None, s, estimated between torque and angle
    links : two of Link, or None where the format needs none
    turn : float, rad, what is added to θ1 so that it counts from the horizontal
    told : str, what tells the length of link 1 where it is not known
    weighed : bool, whether the payload tells that of link 2
    warnings : what does not fit
    from_prior : names of the coefficients that are a prior's
    word : str, what the numbers are: identified, or drawn
    """

    name: str
    source: str
    coefficients: Coefficients
    known: Knowns
    delay: float | None
    links: tuple[Link, Link] | None
    turn: float
    told: str
    weighed: bool
    warnings: tuple[Notice, ...]
    from_prior: tuple[str, ...] = ()
    word: str = "identified"

    @property
    def rotor1(self) -> float:
        """Of joint 1, kg m^2: zero where it is not known."""
        return self.known.rotor1 or 0.0


def describe(result: Result, file: str, knowns: Knowns, *, links: bool) -> Description:
    """The arm of the result in `file`; with `links`, its links chosen from what is known.

    Raises
    ------
    ResultError
        If the result lacks an estimate, or no arm is like it.
    SettingError
        If what is known leaves no positive mass or inertia.
    """
    known = Knowns(**(given_lengths(result) | knowns.given))
    lengths = {name: one for name, one in known.given.items() if name in ("l1", "l2")}
    l1, told, second = known.l1, ", g k1 / k2", result.payload.get("l2")
    weighed = second is not None and second.usable and bool(second.estimate)
    if links and l1 is None:
        by_payload, by_constants = payload_length(result), first_length(result)
        if by_payload is not None:
            l1, told = by_payload[0], " with the payload"
        by = by_payload or by_constants
        if by is not None:
            told += f", ± {result.quantile * by[1]:.2g} (95 %)"
    coefficients = coefficients_of(result, file, l1)
    value, gravity = coefficients.value, coefficients.model.gravity
    chosen = None
    if links:
        if l1 is None:
            l1 = _first_length(value, gravity, file)
        full = known
        if known.l2 is None and second is not None and second.usable:
            full = replace(known, l2=second.estimate)
        chosen = links_of(value, gravity, l1, full, file)
    found = result.parameters.items()
    path = Path(file)
    if path.name == "result.json":
        path = path.parent
    return Description(
        name=re.sub(r"\W|^(?=\d)", "_", path.stem),
        source=f"{file}, estimator {result.estimator}",
        coefficients=coefficients,
        known=known,
        delay=None if result.delay is None else result.delay.estimate,
        links=chosen,
        turn=turn_of(value, gravity),
        told=told,
        weighed=weighed,
        warnings=contradictions(result, lengths),
        from_prior=tuple(name for name, one in found if one.status == "FROM_PRIOR"),
    )


def _first_length(value: Mapping[str, float], gravity: float, file: str) -> float:
    if gravity == 0:
        raise SettingError(
            f"{flag('l1')}: {file}: an arm in a horizontal plane does not tell its length; give "
            f"{flag('l1')}"
        )
    l1 = length_by_coupling(value, gravity)
    if l1 is None or l1 <= 0:
        raise ResultError(
            f"{file}: k1 {value[K1]:.4g} and k2 {value[K2]:.4g} make l1 = g k1 / k2 no positive "
            f"length; give {flag('l1')}, or identify it from more informative logs"
        )
    return l1
