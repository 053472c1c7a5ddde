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
from algid.base.errors import ResultError
from algid.exports.links import Knowns, Link, links_of, turn_of
from algid.identification.known import (
    by_constants,
    contradictions,
    covariance_of,
    given_lengths,
    model_of,
    payload_length,
    torque_constants,
    untold,
    with_error_bar,
    wrong_inertia,
)
from algid.model import K1, K2, SINE_OF, Model, length_by_coupling, phasor
from algid.notices import Notice
from algid.options import flag
from algid.results import Result


def _conditioned(
    model: Model, c: FloatArray, C: FloatArray, l1: float
) -> tuple[FloatArray, FloatArray]:
    """Coefficients and covariance under g |K1| = l1 |K2|, by Newton's steps.

    Without sine parts one is enough.
    """
    place, a = model.compiled.place, np.zeros(c.size)  # the gradient of g |K1| - l1 |K2|
    for _ in range(_STEPS):
        wrong = 0.0
        for name, factor in ((K1, model.gravity), (K2, -l1)):
            K, sine = phasor(model, c, name), place.get(SINE_OF[name])
            size = K.real if sine is None else abs(K)  # a straight arm's moment has its sign
            wrong += factor * size
            unit = K / size if size else 1
            a[place[name]] = factor * unit.real
            if sine is not None:
                a[sine] = factor * unit.imag
        toward = C @ a
        if not a @ toward > 0:  # no error bars: the moments are equally wrong for their size
            toward = c**2 * a
        c = c - toward * wrong / (a @ toward)
    spread = a @ C @ a
    return c, C - np.outer(C @ a, a @ C) / spread if spread > 0 else C


_STEPS = 8
"""Each squares what is left of the error."""


@dataclass(frozen=True)
class Description:
    """An arm to be written.

    Parameters
    ----------
    name : str, a word of letters, digits and underscores
    source : str, the result's file and estimator
    result : Result
    model : Model, of its torque
    value : its coefficients by name, zero for those that the model lacks
    half : half their 95 % intervals, where known
    conditioned : bool, whether l1 moved them
    known : Knowns, of the user and of the result's own call
    links : two of Link, or None where the format needs none
    turn : float, rad, what is added to θ1 so that it counts from the horizontal
    told : str, what tells the length of link 1 where it is not known
    weighed : bool, whether the payload tells that of link 2
    warnings : what does not fit
    word : str, what the numbers are: identified, or drawn
    """

    name: str
    source: str
    result: Result
    model: Model
    value: Mapping[str, float]
    half: Mapping[str, float]
    conditioned: bool
    known: Knowns
    links: tuple[Link, Link] | None
    turn: float
    told: str
    weighed: bool
    warnings: tuple[Notice, ...]
    word: str = "identified"


def describe(result: Result, file: str, knowns: Knowns, *, links: bool) -> Description:
    """The arm of the result in `file`; with `links`, its links chosen from what is known.

    Raises
    ------
    ResultError
        If the result lacks an estimate, or no arm is like it.
    SettingError
        If what is known leaves no positive mass or inertia.
    """
    model, known = model_of(result), given_lengths(result) | {**knowns}
    if K2 in untold(result, model):
        model = replace(model, gravity=0.0)  # as its driver has it: nothing of the weight is known
    l1, told, second = known.get("l1"), ", g k1 / k2", result.payload.get("l2")
    tied = {"l2": second.estimate} if second and second.usable and second.estimate else {}
    if links and l1 is None:
        by_payload = payload_length(result)
        if by_payload is not None:
            l1, told = by_payload[0], " with the payload"
        by = by_payload or by_constants(result)
        told += "" if by is None else f", ± {result.quantile * by[1]:.2g} (95 %)"
    c = torque_constants(result, model, "unloaded", file)
    sure = with_error_bar(result, model.names)
    C = covariance_of(result, model.names, sure)
    conditioned = l1 is not None and model.gravity > 0
    if l1 is not None and conditioned:
        c, C = _conditioned(model, c, C, l1)
    value = model.values(c)
    half = result.quantile * np.sqrt(np.maximum(np.diag(C), 0.0))
    wrong = wrong_inertia(value)
    if wrong is not None:
        mend = f"check {flag('l1')}" if conditioned else "identify it from more informative logs"
        raise ResultError(f"{file}: {wrong}, so that masses would come out negative; {mend}")
    chosen = None
    if links:
        l1 = l1 or length_by_coupling(value, model.gravity) or 0.0
        if l1 <= 0:
            raise ResultError(
                f"{file}: k1 {value[K1]:.4g}, k2 {value[K2]:.4g} and g {model.gravity:g} make "
                f"l1 = g k1 / k2 no positive length; give {flag('l1')}"
            )
        chosen = links_of(value, model.gravity, l1, tied | known, file)
    folder = Path(file).parent if Path(file).name == "result.json" else Path(file)
    return Description(
        name=re.sub(r"\W|^(?=\d)", "_", folder.stem or "arm"),
        source=f"{file}, estimator {result.estimator}",
        result=result,
        model=model,
        value=value,
        half={name: half[model.names.index(name)] for name in sure},
        conditioned=conditioned,
        known=known,
        links=chosen,
        turn=turn_of(value),
        told=told,
        weighed=bool(tied),
        warnings=contradictions(result, known),
    )
