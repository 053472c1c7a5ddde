"""Content of an export: the arm's coefficients, its links, and the source of each number.

k1 = m2 l1 lc2 and k2 = m2 g lc2 leave l1 = g k1 / k2 to a model made of links. Where l1 is known,
the estimates are conditioned on it: with their covariance C and a the gradient of g k1 - l1 k2,

    c' = c - C a (g k1 - l1 k2) / (aᵀ C a),   C' = C - C a aᵀ C / (aᵀ C a)

Of moments off the links' lines k1 and k2 are the sizes |K1| and |K2|, and the step is repeated.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from algid.arm import FloatArray
from algid.base.errors import ResultError, SettingError
from algid.base.text import joined
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
from algid.model import K1, K2, SINES, TERMS, UNITS, Model, length_by_coupling, phasor
from algid.notices import Notice
from algid.options import flag
from algid.results import Estimate, Result


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
class Number:
    """A number of the exported model: who says it (identified, given or chosen), and how."""

    name: str
    value: float
    unit: str
    origin: str

    def __str__(self) -> str:
        return f"{self.name:7} {self.value!r:24} {self.unit:10} {self.origin}"


@dataclass(frozen=True)
class Description:
    """An arm to be written.

    Parameters
    ----------
    name : str, a word of letters, digits and underscores
    source : str, the result's file and estimator
    coefficients : Coefficients
    delay : float or None, s, estimated between torque and angle
    links : two of Link, or None where the format needs none
    rotor1 : float, kg m^2
    turn : float, rad, what is added to θ1 so that it counts from the horizontal
    numbers : where each number comes from
    warnings : what does not fit
    """

    name: str
    source: str
    coefficients: Coefficients
    delay: float | None
    links: tuple[Link, Link] | None
    rotor1: float
    turn: float
    numbers: tuple[Number, ...]
    warnings: tuple[Notice, ...]


def describe(result: Result, file: str, knowns: Knowns, *, links: bool) -> Description:
    """The arm of the result in `file`; with `links`, its links chosen from what is known.

    Raises
    ------
    ResultError
        If the result lacks an estimate, or no arm is like it.
    SettingError
        If what is known leaves no positive mass or inertia.
    """
    lengths = {name: value for name, value in knowns.given.items() if name in ("l1", "l2")}
    given = given_lengths(result) | lengths
    length = given.get("l1")
    if links and length is None:
        by_payload = payload_length(result)
        if by_payload is not None:
            length, _ = by_payload
    coefficients = coefficients_of(result, file, length)
    numbers = _identified(coefficients, result)
    chosen = None
    if links:
        known = Knowns(**(knowns.given | given))
        full = replace(known, l2=given.get("l2", _length(result.payload.get("l2"))))
        l1 = length
        if l1 is None:
            l1 = _first_length(coefficients, file)
        chosen = links_of(coefficients.value, coefficients.model.gravity, l1, full, file)
        numbers += _chosen(chosen, coefficients, known, result)
    delay = None
    if result.delay is not None:
        delay = result.delay.estimate
    return Description(
        name=_name(Path(file)),
        source=f"{file}, estimator {result.estimator}",
        coefficients=coefficients,
        delay=delay,
        links=chosen,
        rotor1=knowns.rotor1 or 0.0,
        turn=turn_of(coefficients.value, coefficients.model.gravity),
        numbers=tuple(numbers),
        warnings=contradictions(result, given),
    )


def _name(file: Path) -> str:
    """The arm's name: its result's, as a word of letters, digits and underscores."""
    if file.name == "result.json":
        file = file.parent
    return re.sub(r"\W|^(?=\d)", "_", file.stem)


def _length(found: Estimate | None) -> float | None:
    if found is None or not found.usable:
        return None
    return found.estimate


def _first_length(coefficients: Coefficients, file: str) -> float:
    gravity = coefficients.model.gravity
    if gravity == 0:
        raise SettingError(
            f"{flag('l1')}: {file}: an arm in a horizontal plane does not tell its length; give "
            f"{flag('l1')}"
        )
    value = coefficients.value
    k1, k2 = value[K1], value[K2]
    l1 = length_by_coupling(value, gravity)
    if l1 is None or l1 <= 0:
        raise ResultError(
            f"{file}: k1 {k1:.4g} and k2 {k2:.4g} make l1 = g k1 / k2 no positive length; give "
            f"{flag('l1')}, or identify it from more informative logs"
        )
    return l1


def _of_first_length(result: Result) -> str:
    """What tells the length of link 1, where it is not given."""
    by_payload, by_constants = payload_length(result), first_length(result)
    if by_payload is not None:
        return f"identified with the payload, ± {result.quantile * by_payload[1]:.2g} (95 %)"
    if by_constants is not None:
        return f"identified, g k1 / k2, ± {result.quantile * by_constants[1]:.2g} (95 %)"
    return "identified, g k1 / k2"


def _identified(coefficients: Coefficients, result: Result) -> list[Number]:
    numbers = []
    for name in coefficients.model.names:
        origin = "identified"
        found = result.parameters.get(name)
        if found is not None and found.status == "FROM_PRIOR":
            origin = "from the prior, not measured"
        if name in coefficients.half:
            origin += f", ± {coefficients.half[name]:.2g} (95 %)"
        if coefficients.conditioned:
            origin += ", conditioned on l1"
        numbers.append(Number(name, coefficients.value[name], UNITS[name], origin))
    numbers.append(Number("g", coefficients.model.gravity, "m/s^2", "given"))
    return numbers


def _chosen(
    links: tuple[Link, Link], coefficients: Coefficients, knowns: Knowns, result: Result
) -> list[Number]:
    """The links' numbers: given, identified by what is given, or chosen."""
    first, second = links
    l1 = "given" if knowns.l1 else _of_first_length(result)
    l2 = m1 = m2 = "chosen, nearest to a uniform link"
    by1, by2, rotor1 = "chosen with the masses", "chosen with m2", "chosen: k5 holds it"
    if knowns.l2:
        l2 = "given"
    elif _length(result.payload.get("l2")):
        l2 = "identified with the payload"
    if knowns.m1 is not None:
        m1 = "given"
    if knowns.m2 is not None:
        m2, by2 = "given", "identified, given m2"
    if knowns.rotor1 is not None:
        rotor1 = "given"
    if coefficients.model.gravity == 0:  # horizontal
        lc1, lc2 = by1, f"{by2}: k1 = m2 l1 lc2"
    else:
        if m1 == m2 == "given":
            by1 = "identified, given m1 and m2"
        lc1, lc2 = f"{by1}: k4 = g (m1 lc1 + m2 l1)", f"{by2}: k2 = g m2 lc2"
    numbers = [
        Number("l1", first.length, "m", l1),
        Number("m1", first.mass, "kg", m1),
        Number("lc1", first.centre, "m", lc1),
        Number("I1", first.inertia, "kg m^2", f"{by1}: k5 = I1 + rotor1 + m1 lc1^2 + m2 l1^2"),
        Number("rotor1", knowns.rotor1 or 0.0, "kg m^2", rotor1),
        Number("l2", second.length, "m", l2),
        Number("m2", second.mass, "kg", m2),
        Number("lc2", second.centre, "m", lc2),
        Number("I2", second.inertia, "kg m^2", f"{by2}: k3 = I2 + m2 lc2^2"),
    ]
    numbers += _aside(links, coefficients)
    return numbers


def _aside(links: tuple[Link, Link], coefficients: Coefficients) -> Iterator[Number]:
    """What the sine parts of the moments mean; nothing of an arm whose links are straight."""
    if not set(SINES) & set(coefficients.model.names):
        return
    for number, link in enumerate(links, start=1):
        origin = f"identified: link {number}'s centre of mass beside its line"
        if number == 2:
            origin += ", or theta2's zero"
        yield Number(f"e{number}", link.aside, "m", origin)
    turn = turn_of(coefficients.value, coefficients.model.gravity)
    yield Number(
        "turn1", turn, "rad", "identified: added to theta1, which counts from gravity then"
    )


def lacking(arm: Description, held: frozenset[str]) -> list[str]:
    """Sentences about the torque's terms that a format, which holds those of `held`, lacks."""
    value, sentences = arm.coefficients.value, []
    for name in arm.coefficients.model.terms:
        if name not in held:
            term = TERMS[name]
            numbers = joined([f"{one} {value[one]:.6g} {term.unit}" for one in term.names])
            sentences.append(f"lacks {term.title}, {term.equation}: {numbers}")
    if arm.delay is not None:
        sentences.append(f"lacks the delay from torque to angle: {arm.delay:.6g} s")
    return sentences


_FRAME = "theta1 from the horizontal, theta2 from link 1, counterclockwise; gravity pulls down;"


def comment(arm: Description, remarks: list[str], before: str) -> str:
    """The comment at the top of a file, with something before each line.

    No text in it ends a comment of C or a string of Python.
    """
    lines = [f"Two-link arm by algid export, from {arm.source}.", f"{_FRAME} SI units.", ""]
    lines += [str(number) for number in arm.numbers]
    if remarks or arm.warnings:
        lines.append("")
    lines += [f"This file {remark}." for remark in remarks]
    lines += [f"Warning: {warning.text}." for warning in arm.warnings]
    text = "\n".join(f"{before}{line}".rstrip() for line in lines)
    return text.replace("*/", "* /").replace("\\", "/").replace('"""', "'''")
