"""What is checked of a fit, in one table, and notes on what its intervals leave out.

The moments' sine parts mean zeros of the angles, or centres of mass off the links' lines:

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

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from algid import results
from algid.arm import FloatArray
from algid.base.significance import chance
from algid.base.units import TORQUE
from algid.estimators.diagnostics import (
    FAR_BEYOND,
    bent,
    broken_bounds,
    constrained,
    length_by_constants,
    payload_distance,
)
from algid.estimators.excitation import contradicted, undriven
from algid.estimators.fit import Fit, solved_anew
from algid.estimators.prediction import PredictionScore
from algid.estimators.robust import unshrunk
from algid.identification.by_likelihood import Fitted
from algid.identification.known import FAR, contradicting
from algid.identification.passes import problem_of
from algid.identification.recordings import Recording
from algid.identification.series import predictor_of_fit
from algid.identification.validate import prediction, scores
from algid.model import FIRST_TERMS, K1, K2, K4, RIGID, SINE_OF, SINES, phasor
from algid.notices import Notice, Remedy, has_code

STEEL, AIR = 8000.0, 1.2  # kg/m³
LEAST_SURE = 10.0  # standard deviations that a length has to have
MOST = 0.5
"""R² below which most of a torque is not the model's."""


def doubted(found: Fitted) -> Fitted:
    """The fit with status WEAK_EXCITATION for k1 … k5 where a check doubts them."""
    for check in CHECKS:
        if check.consequence == "doubt":
            for notice in check.find(found):
                marked = found.fit.marked("WEAK_EXCITATION", RIGID)
                found = replace(found, fit=marked.noted(notice))
    return found


def remarks(found: Fitted) -> Iterator[Notice]:
    """What a user should know about a fit."""
    yield from found.fit.notes
    yield from found.fit.unidentifiable
    for check in CHECKS:
        if check.consequence == "remark":
            yield from check.find(found)


def exchanged(fit: Fit) -> float | None:
    """By how many standard deviations the unloaded arm carries more, if by far."""
    for broken in broken_bounds(fit):
        if broken.bound == "m_p >= 0" and (broken.distance or 0.0) > FAR:
            return broken.distance
    return None


def _of_passive_joint(found: Fitted) -> Iterator[Notice]:
    """That the equation of a joint that has no motor does not determine k1 … k5."""
    if any(log.origin.reading.passive for log in found.survey.logs):
        notice = undriven(found.fit, problem_of(found.survey, found.settings, found.chosen))
        if notice is not None:
            yield notice


def _of_refuted(found: Fitted) -> Iterator[Notice]:
    """Where the likelihood is refuted, what makes k1 … k5 doubtful: see `contradicted`.

    Of a fit that breaks bounds of physics by far, whether one within them explains the torques as
    well. One that does not stays as sure as it is, so that the contradiction is reported, as logs
    in each other's place are.
    """
    fit, survey = found.fit, found.survey
    if not (fit.refuted and found.settings.chooses) or exchanged(fit):
        return
    if "BROKEN_BOUND" in survey.accepted:
        return
    far = [one.bound for one in broken_bounds(fit) if (one.distance or 0.0) > FAR_BEYOND]
    if not far:
        common = replace(found.chosen, model=replace(found.chosen.model, terms=FIRST_TERMS))
        notice = contradicted(fit, problem_of(survey, found.settings, common))
        if notice is not None:
            yield notice
        return
    lawful = constrained(fit)
    if not lawful.converged:
        return
    total = sum(scores(predictor_of_fit(replace(found, fit=lawful)), survey), PredictionScore())
    predicted = prediction(total)
    if predicted is None or not predicted.unexplained(MOST):
        yield Notice("HARDLY_DRIVEN", numbers={"case": "bounds", "bounds": far})


def torque_unit(logs: Sequence[Recording]) -> float | None:
    """N m of the one unit that all torques were read in.

    None where they differ, or an offset in N m or a PD law's gains do not follow the unit.
    """
    units = set()
    for log in logs:
        reading = log.origin.reading
        for joint in (1, 2):
            channel = reading.channels.get(f"tau{joint}")
            if joint == reading.passive:
                continue
            if channel is None:
                units.add("N m")
            elif channel.offset:
                return None
            else:
                units.add(channel.unit)
    if len(units) != 1:
        return None
    return TORQUE.get(units.pop())


def _of_gravity(found: Fitted) -> Iterator[Notice]:
    """That the torque is said to be without gravity."""
    shared = found.fit.shared
    if shared.model.gravity == 0:
        needed = shared.payload and not shared.lengths
        yield Notice(
            "GRAVITY_COMPENSATED",
            numbers={"case": "stated"},
            remedies=(Remedy({"l1": None}, "a length tells its mass"),) if needed else (),
        )


def _of_phases(found: Fitted) -> Iterator[Notice]:
    """The phases in degrees with their 95 % intervals, of an arm whose links are not straight.

    A shrunk fit has every term: there the links are straight where the sine parts are together
    consistent with nothing.
    """
    fit = found.fit
    if set(SINES).isdisjoint(fit.names) or (fit.shrinkage is not None and not bent(fit)):
        return
    second, of_second = _argument(fit, K1)
    numbers = {"case": "no gravity", "second": _in_degrees(fit, second, of_second)}
    if {K2, K4} <= set(fit.names) - set(fit.absent):
        whole, of_whole = _argument(fit, K2)
        load, of_load = _argument(fit, K4)
        first, of_first = whole - second, of_whole - of_second
        numbers["case"] = "gravity"
        numbers["first"] = _in_degrees(fit, first, of_first)
        numbers["load"] = _in_degrees(fit, load - first, of_load - of_first)
    yield Notice("PHASES", numbers=numbers)


def _of_mass(found: Fitted) -> Iterator[Notice]:
    """Notice of an arm heavier than steel cubes of its links: m1 lc1 / l1 + m2 = k4 / (g l1).

    A smaller unit of torque scales every constant alike, so that the fit shows what it would give.
    """
    fit, unit = found.fit, torque_unit(found.survey.logs)
    by_constants = length_by_constants(fit)
    if K4 not in fit.names or K4 in fit.absent or by_constants is None:
        return
    length, std = by_constants
    if not LEAST_SURE * std < length:
        return
    mass = abs(float(fit.values[fit.names.index(K4)])) / (fit.shared.model.gravity * length)
    if mass > STEEL * length**3:
        remedies: tuple[Remedy, ...] = ()
        if (
            unit is not None
            and fit.prior is None
            and fit.converged
            and not list(broken_bounds(fit))
        ):
            lighter = mass * TORQUE["mN m"] / unit
            if AIR * length**3 <= lighter <= STEEL * length**3:
                remedies = (Remedy({"torque_unit": "mN m"}, "where torques are in mN m"),)
        numbers = {"mass": mass, "length": length}
        yield Notice("OTHER_UNIT", numbers={"case": "heavy"} | numbers, remedies=remedies)


def _of_gains(found: Fitted) -> Iterator[Notice]:
    """That the gains of the two torques differ, where the logs show a difference.

    A prior hides the more of one the larger it is.
    """
    fit = found.fit
    if "gain2" not in fit.names or has_code(fit.notes, "JOINTS_CONTRADICT"):
        return
    free = unshrunk(fit, "gain2")
    place = free.names.index("gain2")
    gain, half = float(free.values[place]), free.quantile * float(free.std[place])
    if abs(gain) > half:
        numbers = {"ratio": 1 + gain, "half": half, "p_value": chance(abs(gain / half))}
        yield Notice("TORQUE_GAIN", numbers={"case": "joints"} | numbers)


def _of_payload(found: Fitted) -> Iterator[Notice]:
    """That the loaded logs show no payload, or none without lengths."""
    fit = found.fit
    if "m_p" not in fit.names:
        return
    place = fit.names.index("m_p")
    low, high = fit.ci95[place].tolist()
    if np.isfinite(high) and low < 0 < high:
        yield Notice("NO_PAYLOAD", numbers={"most": high})
    elif np.isinf(high) and not fit.shared.lengths:
        yield Notice("LENGTHS_NEEDED")


def _of_length(found: Fitted) -> Iterator[Notice]:
    """That a given length is not what the logs show.

    l1 is g k1 / k2 of the constants, and both are the payload's where the same likelihoods are
    solved without the given ones.
    """
    fit = found.fit
    given, measured = fit.shared.lengths, list[tuple[str, float, float]]()
    if "l1" in given and (by_constants := length_by_constants(fit)) is not None:
        measured.append(("l1", *by_constants))
    if given and fit.shared.payload:
        free = solved_anew(fit, replace(fit.shared, lengths={}), fit.prior, fit.shrinkage)
        by_name = zip(free.names, free.values.tolist(), free.std.tolist(), strict=True)
        measured += [one for one in by_name if one[0] in given]
    said = set[str]()
    for name, length, std in measured:
        numbers = contradicting(name, given[name], length, std, fit.quantile)
        if numbers and name not in said:
            said.add(name)
            p_value = chance(numbers["distance"])
            yield Notice("LENGTH_CONTRADICTED", numbers=numbers | {"p_value": p_value})


def _of_arms(found: Fitted) -> Iterator[Notice]:
    """That unloaded and loaded logs are not of one arm, or are exchanged."""
    far = exchanged(found.fit)
    if far:
        yield Notice("LOGS_APART", numbers={"case": "exchanged", "p_value": chance(far)})
    apart = payload_distance(found.fit)
    if apart is not None and apart > FAR:
        numbers = {"distance": apart, "p_value": chance(apart)}
        yield Notice("LOGS_APART", numbers={"case": "apart"} | numbers)


@dataclass(frozen=True)
class Check:
    """One check of a fit.

    Parameters
    ----------
    code : of its notices
    find : callable
        Gives them.
    consequence : "doubt" or "remark"
        Whether k1 … k5 have no error bar then, or it is only said.
    """

    code: str
    find: Callable[[Fitted], Iterator[Notice]]
    consequence: Literal["doubt", "remark"] = "remark"


CHECKS = (
    Check("HARDLY_DRIVEN", _of_passive_joint, "doubt"),
    Check("JOINTS_CONTRADICT", _of_refuted, "doubt"),
    Check("GRAVITY_COMPENSATED", _of_gravity),
    Check("PHASES", _of_phases),
    Check("TORQUE_GAIN", _of_gains),
    Check("OTHER_UNIT", _of_mass),
    Check("NO_PAYLOAD", _of_payload),
    Check("LENGTH_CONTRADICTED", _of_length),
    Check("LOGS_APART", _of_arms),
)
"""Checks of a finished fit, in order. What is checked while it is made has its share in
`algid.base.significance` too, and a consequence of its own: another estimate (NOT_WHITE, REFUTED,
INSTRUMENTS), or no result (BROKEN_BOUND)."""


def fit_notes(fit: results.FitSummary) -> Iterator[Notice]:
    """Notes on the torque's hold, intervals from blocks, the payload's repeatability, and gains."""
    if fit.torque_hold is not None:
        yield from _of_hold(fit.torque_hold)
    if fit.intervals == "sandwich":
        yield Notice("REPEATABILITY", numbers={"case": "unknown"})
    if fit.repeatability is not None:
        masses = ", ".join(f"{mass:.4g}" for mass in fit.repeatability.masses)
        low, high = fit.repeatability.ci95
        numbers = {"masses": masses, "std": fit.repeatability.std, "low": low, "high": high}
        yield Notice("REPEATABILITY", numbers={"case": "payload"} | numbers)
    gain = fit.torque_gain
    if gain is not None and (gain.estimate is None or gain.ci95 is None):
        yield Notice("TORQUE_GAIN", numbers={"case": "unknown"})
    elif gain is not None and gain.ci95 is not None:
        numbers = {"gain": gain.estimate, "low": gain.ci95[0], "high": gain.ci95[1]}
        gears = Remedy(
            {"tau1.torque_constant": None, "tau2.torque_constant": None}, "set them, or gear_ratio"
        )
        yield Notice("TORQUE_GAIN", numbers={"case": "known"} | numbers, remedies=(gears,))


def _of_hold(hold: results.TorqueHold) -> Iterator[Notice]:
    """That logs show a held torque, or leave it open."""
    if hold.told is None or hold.half is None:
        return
    if hold.faster:
        known = Remedy({"delay": None}, "half of the controller's period, in s")
        even = Remedy({"torque_hold": "foh"}, "for a torque that is not held")
        yield Notice("TORQUE_HOLD", numbers={"case": "fast controller"}, remedies=(known, even))
    elif not hold.told:
        held = Remedy({"torque_hold": "zoh"}, "for a digital controller that logs what it sets")
        yield Notice(
            "TORQUE_HOLD", numbers={"case": "unknown", "half": 1e3 * hold.half}, remedies=(held,)
        )
    elif hold.used == "zoh":
        yield Notice("TORQUE_HOLD", numbers={"case": "held", "late": 1e3 * hold.half})


LEAST_TURN = np.radians(20.0)
"""rad: gravity that is turned by more, beyond its interval, is no base that is not quite level."""
LEAST_CERTAIN = 5.0  # standard deviations of k1 and of k2 that an angle between them needs


def turn_note(fit: Fit, log: Recording) -> Iterator[Notice]:
    """That gravity is turned against θ1 as `log` was read, with the zero that turns it back.

    Where its named zeros lie within the interval of ε1, the nearest is named. Nothing where gravity
    is turned by less than `LEAST_TURN`, and where it may be upside down, which signs make too.
    """
    from algid.inspection.conventions import zeroed

    names = set(fit.names) - set(fit.absent)
    if not {K1, K2, SINE_OF[K1], SINE_OF[K2]} <= names or fit.shared.model.gravity == 0:
        return
    if min(_certainty(fit, K1), _certainty(fit, K2)) < LEAST_CERTAIN:
        return
    (second, of_second), (whole, of_whole) = _argument(fit, K1), _argument(fit, K2)
    turn = float(np.remainder(whole - second + np.pi, 2 * np.pi) - np.pi)
    half = _half(fit, of_whole - of_second)
    if not abs(turn) - half > LEAST_TURN or abs(turn) + half >= np.pi:
        return
    anyway = Remedy({"accept": "WRONG_ZERO"}, "where the arm is mounted so")
    numbers = {"turn": float(np.degrees(turn))}
    yield Notice("WRONG_ZERO", numbers=numbers, remedies=(zeroed(log.origin, turn, half), anyway))


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
