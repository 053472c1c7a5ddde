"""What is checked of a fit, in one table, and notes on what its intervals leave out.

The moments' sine parts mean zeros of the angles, or centres of mass off the links' lines:

======  =====================================  ========  =======
symbol  name                                   shape     unit
======  =====================================  ========  =======
K       phasor of a moment, k + i k_s          scalar    its own
a       its argument                           scalar    rad
======  =====================================  ========  =======

With centres of mass turned by δ off the lines and zeros off by ε: arg K2 − arg K1 = ε1, and arg K1
= δ2 + ε2, whose parts no torque separates. arg K4 − ε1 is where the load of joint 1 lies that
turns with link 1.

**Effort.** A driver may log a torque without gravity, or without any of the arm's. Physics binds
the constants together: with the link lengths l1 and lc2

    k2 = g k1 / l1,   k4 >= g k1 / lc2,   and of a payload   z4 = g z1 / l1

so that an arm whose inertia is known and that weighs nothing, unless both lengths are those of no
arm, is logged without its weight. If the payload's own weight is there, the arm does not move in a
horizontal plane.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from math import remainder, sqrt, tau
from pathlib import PurePath

import numpy as np

from algid import results
from algid.arm import CONSTANT_NAMES
from algid.base.names import named_values, within
from algid.base.significance import NORMAL, SURE, chance
from algid.estimators.combine import of_kind
from algid.estimators.diagnostics import (
    FAR_BEYOND,
    bent,
    broken_bounds,
    constrained,
    contradicted,
    length_by_constants,
    measured,
    payload_distance,
    undriven,
)
from algid.estimators.fit import Fit, alone
from algid.estimators.robust import unshrunk
from algid.identification.by_likelihood import Fitted, finished, problem_of
from algid.identification.known import FAR, contradicting, gain_notes
from algid.identification.recordings import Recording
from algid.identification.series import predictor_of_fit
from algid.identification.validate import predicted_by
from algid.model import (
    FIRST_TERMS,
    K1,
    K2,
    K3,
    K4,
    K5,
    K6,
    K7,
    MOMENTS,
    RIGID,
    SINE_OF,
    SINES,
    names_of,
    phasor,
    phasor_of,
    terms_named,
)
from algid.notices import Notice, Remedy, has_code
from algid.physics.effort import FRICTION
from algid.results.verdict import wrong_length
from algid.settings import Settings

STEEL = 8000.0  # kg/m³
LEAST_SURE = 10.0  # standard deviations that a length has to have
MOST = 0.5  # R² below which most of a torque is not the model's


def doubted(found: Fitted) -> Fitted:
    """The fit with status WEAK_EXCITATION for k1 … k5 where a check doubts them."""
    for check in DOUBTS:
        for notice in check(found):
            marked = found.fit.marked("WEAK_EXCITATION", RIGID)
            found = replace(found, fit=marked.noted(notice))
    return found


def remarks(found: Fitted) -> Iterator[Notice]:
    """What a user should know about a fit."""
    yield from found.fit.notes
    yield from found.fit.unidentifiable
    for check in REMARKS:
        yield from check(found)


def exchanged(fit: Fit) -> float | None:
    """By how many standard deviations the unloaded arm carries more, if by far."""
    for broken in broken_bounds(fit):
        if broken.bound == "m_p >= 0" and (broken.distance or 0.0) > FAR:
            return broken.distance
    return None


def _of_passive_joint(found: Fitted) -> Iterator[Notice]:
    """That the equation of a joint that has no motor does not determine k1 … k5."""
    if any(log.origin.reading.passive for log in found.survey.logs):
        notice = undriven(found.fit, found.problem)
        if notice is not None:
            yield notice


def _of_refuted(found: Fitted) -> Iterator[Notice]:
    """Where the likelihood is refuted, what makes k1 … k5 doubtful: see `contradicted`.

    Of a fit that breaks bounds of physics by far, whether one within them explains the torques as
    well. One that does not stays as sure as it is, so that the contradiction is reported, as logs
    in each other's place are.
    """
    fit, survey = found.fit, found.survey
    wanted = fit.refuted and found.settings.chooses and "BROKEN_BOUND" not in survey.accepted
    if not wanted or exchanged(fit):
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
    predicted = predicted_by(predictor_of_fit(replace(found, fit=lawful)), survey)
    if predicted is None or not predicted.unexplained(MOST):
        yield Notice("HARDLY_DRIVEN", numbers={"case": "bounds", "bounds": far})


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
    numbers, angles = {"case": "no gravity"}, dict[str, tuple[str, ...]](second=(K1,))
    if {K2, K4} <= set(fit.names) - set(fit.absent):
        numbers["case"] = "gravity"
        angles |= {"first": (K2, K1), "load": (K4, K2, K1)}
    for name, moments in angles.items():
        angle, half = np.degrees(_angle(fit, *moments))
        numbers[name] = f"{angle:.3g}° ± {half:.2g}°"
    yield Notice("PHASES", numbers=numbers)


def _of_mass(found: Fitted) -> Iterator[Notice]:
    """Notice of an arm or a payload heavier than a steel cube of link 1's length.

    The arm has m1 lc1 / l1 + m2 = k4 / (g l1).
    """
    fit, by_constants = found.fit, length_by_constants(found.fit)
    if K4 not in fit.names or K4 in fit.absent or by_constants is None:
        return
    length, std = by_constants
    arm, _ = fit.by_name[K4]
    payload, _ = fit.by_name.get("m_p", (0.0, 0.0))
    mass = max(abs(arm) / (fit.shared.model.gravity * length), payload)
    if LEAST_SURE * std < length and mass > STEEL * length**3:
        numbers = {"case": "heavy", "mass": mass, "length": length}
        milli = Remedy({"torque_unit": "mN m"}, "where torques are in mN m")
        yield Notice("OTHER_UNIT", numbers=numbers, remedies=(milli,))


def _of_gains(found: Fitted) -> Iterator[Notice]:
    """That the gains of the two torques differ, where the logs show a difference.

    A prior hides the more of one the larger it is.
    """
    fit = found.fit
    if "gain2" not in fit.names or has_code(fit.notes, "JOINTS_CONTRADICT"):
        return
    free = unshrunk(fit, "gain2")
    gain, std = free.by_name["gain2"]
    half = free.quantile * std
    if abs(gain) > half:
        numbers = {"ratio": 1 + gain, "half": half, "p_value": chance(abs(gain / half))}
        yield Notice("TORQUE_GAIN", numbers={"case": "joints"} | numbers)


def _of_payload(found: Fitted) -> Iterator[Notice]:
    """That the loaded logs show no payload, or none without lengths."""
    fit = found.fit
    if "m_p" not in fit.names:
        return
    low, high = fit.ci95[fit.names.index("m_p")].tolist()
    if np.isinf(high):
        if not fit.shared.lengths:
            yield Notice("LENGTHS_NEEDED")
    elif low < 0 < high:
        yield Notice("NO_PAYLOAD", numbers={"most": high})


def _of_length(found: Fitted) -> Iterator[Notice]:
    """That a given length is not what the logs show.

    l1 is g k1 / k2 of the constants, and both are the payload's.
    """
    fit, free = found.fit, found.fit.with_free_lengths
    given = fit.shared.lengths
    measured = [(name, *free.by_name[name]) for name in within(free.names, given)]
    if "l1" in given and (by_constants := length_by_constants(free)) is not None:
        measured.insert(0, ("l1", *by_constants))
    said = set[str]()
    for name, length, std in measured:
        numbers = contradicting(name, given[name], length, std, fit.quantile)
        if numbers and name not in said:
            said.add(name)
            p_value = chance(numbers["distance"])
            yield Notice("LENGTH_CONTRADICTED", numbers=numbers | {"p_value": p_value})


def by_free_lengths(found: Fitted) -> Fitted:
    """The fit without its given lengths, if one is wrong: that moves k1 … k5 with the payload.

    What the logs show of the payload and of both lengths takes the place of what is given.
    """
    wrong = list(_of_length(found))
    if not (found.fit.shared.payload and wrong_length(wrong)):
        return found
    fit = finished(found.fit.with_free_lengths, found.settings)
    for notice in wrong:
        fit = fit.noted(Notice(notice.code, numbers={**notice.numbers, "case": "left out"}))
    return replace(found, fit=fit)


def _of_arms(found: Fitted) -> Iterator[Notice]:
    """That unloaded and loaded logs are not of one arm, or are exchanged."""
    far = exchanged(found.fit)
    if far:
        yield Notice("LOGS_APART", numbers={"case": "exchanged", "p_value": chance(far)})
    apart = payload_distance(found.fit.with_free_lengths)
    if apart > FAR:
        numbers = {"distance": apart, "p_value": chance(apart)}
        yield Notice("LOGS_APART", numbers={"case": "apart"} | numbers)


ALIKE = 0.01
"""Standard deviation of a constant from log to log, relative, that no error bar need take in."""


def _of_odd_logs(found: Fitted) -> Iterator[Notice]:
    """That logs called alike are not of one arm, by k1 … k5 of each by itself.

    A log is odd that is apart from most of the others. Where those are no majority, nobody knows
    which are right.
    """
    fit, survey = found.fit, found.survey
    for logs, loaded in ((survey.unloaded, False), (survey.loaded, True)):
        own = [one for one, log in zip(fit.each, fit.logs, strict=True) if log.loaded is loaded]
        if len(own) != len(logs) or len(own) < 2:  # of others some were too short
            continue
        rigid = np.flatnonzero(np.isin(own[0].names, RIGID))
        values = np.array([one.values for one in own])[:, rigid]
        std = np.array([one.quantile / NORMAL * one.std for one in own])[:, rigid]
        spread = np.hypot(std, ALIKE * values)
        distance = np.abs(values[:, None] - values) / np.hypot(spread[:, None], spread)
        far = distance.max(axis=2)
        np.fill_diagonal(far, np.inf)
        middle = np.argsort(far, axis=1)[:, (len(own) - 2) // 2]  # of the others
        typical = far[np.arange(len(own)), middle]
        odd, one = np.flatnonzero(typical > FAR), np.argmax(typical)
        if odd.size:
            place, apart = np.argmax(distance[one, middle[one]]), float(typical[one])
            numbers = {
                "case": "odd" if 2 * odd.size < len(own) else "unlike",
                "names": [PurePath(logs[number].name).name for number in odd],
                "name": own[one].names[rigid[place]],
                "values": values[[one, middle[one]], place].tolist(),
                "distance": apart,
                "p_value": chance(apart),
            }
            yield Notice("LOGS_APART", numbers=numbers)


Check = Callable[[Fitted], Iterator[Notice]]
"""Gives notices of a finished fit. What is checked while it is made has its share in
`algid.base.significance` too, and a consequence of its own: another estimate (REFUTED,
INSTRUMENTS), or no result (BROKEN_BOUND)."""
DOUBTS: tuple[Check, ...] = (_of_passive_joint, _of_refuted)
"""Checks after which k1 … k5 have no error bar, in order."""
REMARKS: tuple[Check, ...] = (
    _of_gravity,
    _of_phases,
    _of_gains,
    _of_mass,
    _of_payload,
    _of_length,
    _of_arms,
    _of_odd_logs,
)
"""Checks of which it is only said what they find, in order."""


def fit_notes(fit: results.FitSummary) -> Iterator[Notice]:
    """Notes on the torque's hold, intervals from blocks, the payload's repeatability, and gains."""
    hold = fit.torque_hold
    if hold is not None and hold.half is not None:  # the logs were asked
        if hold.faster:
            known = Remedy({"delay": None}, "half of the controller's period, in s")
            even = Remedy({"torque_hold": "foh"}, "for a torque that is not held")
            yield Notice("TORQUE_HOLD", numbers={"case": "fast controller"}, remedies=(known, even))
        elif not hold.told:
            held = Remedy({"torque_hold": "zoh"}, "for a digital controller that logs what it sets")
            numbers = {"case": "unknown", "half": 1e3 * hold.half}
            yield Notice("TORQUE_HOLD", numbers=numbers, remedies=(held,))
        elif hold.used == "zoh":
            yield Notice("TORQUE_HOLD", numbers={"case": "held", "late": 1e3 * hold.half})
    if fit.intervals == "sandwich":
        yield Notice("REPEATABILITY", numbers={"case": "unknown"})
    if fit.repeatability is not None:
        masses = ", ".join(f"{mass:.4g}" for mass in fit.repeatability.masses)
        low, high = fit.repeatability.ci95
        numbers = {"masses": masses, "std": fit.repeatability.std, "low": low, "high": high}
        yield Notice("REPEATABILITY", numbers={"case": "payload"} | numbers)
    yield from gain_notes(fit)


LEAST_TURN = np.radians(20.0)
"""rad: gravity that is turned by more, beyond its interval, is no base that is not quite level."""
LEAST_CERTAIN = 5.0  # standard deviations of k1 and of k2 that an angle between them needs


def turn_note(fit: Fit, log: Recording) -> Iterator[Notice]:
    """That gravity is turned against θ1 as `log` was read, with the zero that turns it back.

    Where its named zeros lie within the interval of ε1, the nearest is named. Nothing where gravity
    is turned by less than `LEAST_TURN`, and where it may be upside down, which signs make too.
    """
    from algid.inspection.conventions import zeroed

    if not {K1, K2, SINE_OF[K1], SINE_OF[K2]} <= fit.determined:  # of no arm without gravity
        return

    def certain(name: str) -> bool:
        size, std = measured(fit, lambda beta: abs(phasor(fit.shared.model, beta, name)))
        return size > LEAST_CERTAIN * std > 0

    if not (certain(K1) and certain(K2)):
        return
    turn, half = _angle(fit, K2, K1)
    if not abs(turn) - half > LEAST_TURN or abs(turn) + half >= np.pi:
        return
    anyway = Remedy({"accept": "WRONG_ZERO"}, "where the arm is mounted so")
    numbers = {"turn": float(np.degrees(turn))}
    yield Notice("WRONG_ZERO", numbers=numbers, remedies=(zeroed(log.origin, turn, half), anyway))


def _angle(fit: Fit, *moments: str) -> tuple[float, float]:
    """Arg K − arg K' + arg K'' of `moments`, and half its 95 % interval, in rad."""
    angle, slope = fit.shared.phase(fit.values, *moments)
    variance = float(slope @ fit.covariance[: slope.size, : slope.size] @ slope)
    return remainder(angle, tau), fit.quantile * sqrt(max(variance, 0.0))


LONGEST, BOTH_LONG = 5.0, 2.0
"""m: no link is longer, and no two links are."""
NO_DAMPING = 0.02  # of critical damping: less than any joint's friction
NO_ARM = 0.1  # of the loaded arm's inertia: less than any unloaded arm's

Sizes = Mapping[str, tuple[float, float]]
"""Size of each constant, with its sine part where it has one, and how far it may be off: `SURE`
standard deviations. Both are 0 without a column."""


def of_effort(fit: Fit, settings: Settings) -> tuple[Settings, list[Notice]]:
    """The settings with the effort, or without gravity, that the logs of `fit` show.

    With it notices of what was not asked for.
    """
    shown, notices = settings, list[Notice]()
    unloaded, loaded = (
        _sizes(alone(fit.shared, logs)) if (logs := of_kind(fit.logs, kind)) else None
        for kind in (False, True)
    )
    gravity, l1 = fit.shared.model.gravity, fit.shared.lengths.get("l1")
    if gravity > 0:
        # an arm with coupling but no weight, by unloaded logs alone, or else by the fit
        arm = unloaded or _sizes(fit)
        (k1, off1), (k2, off2), (k4, off4) = map(arm.__getitem__, MOMENTS)
        weightless = max(k2 + off2, k4 + off4) < gravity * k1 / (l1 or BOTH_LONG)
        if shown.effort is None and k1 > off1 and weightless:
            shown = shown.but(effort="gravity-compensated")
        if shown.effort == "gravity-compensated" and unloaded and loaded:
            # a payload with inertia about joint 1 but no weight
            z1, z4 = (loaded[name][0] - unloaded[name][0] for name in (K5, K4))
            off1, off4 = (np.hypot(loaded[name][1], unloaded[name][1]) for name in (K5, K4))
            if z1 > off1 and abs(z4) + off4 < gravity * z1 / (l1 or LONGEST):
                shown = shown.but(gravity=0.0)
                notices.append(Notice("GRAVITY_COMPENSATED", numbers={"case": "payload"}))
    if settings.effort is not None:
        return shown, notices
    if shown.effort is not None:
        case = "arm alone"
        remedies = [Remedy({"effort": "gravity-compensated"}, "for such a driver")]
        if not fit.shared.payload or shown.gravity == 0:
            case = "arm"
            remedies.append(Remedy({"gravity": 0}, "for a horizontal plane"))
        numbers = {"case": case}
        notices.append(Notice("GRAVITY_COMPENSATED", numbers=numbers, remedies=tuple(remedies)))
    elif unloaded and loaded and _external(unloaded, loaded):
        notices.append(Notice("EXTERNAL_EFFORT", remedies=(Remedy({"effort": "external"}),)))
    elif _without_friction(fit):
        compensated = Remedy({"effort": "friction-compensated"}, "for such a driver")
        notices.append(Notice("FRICTION_COMPENSATED", remedies=(compensated,)))
    return shown, notices


def _external(unloaded: Sizes, loaded: Sizes) -> bool:
    """Whether unloaded logs have nothing of an arm in their torque, and loaded ones do."""
    size, off = loaded[K5]
    return size > off and all(sum(unloaded[k]) < NO_ARM * loaded[k][0] for k in (K3, K5))


def _without_friction(fit: Fit) -> bool:
    dry = names_of(terms_named(FRICTION[1:]))
    if fit.absent or (fit.shrinkage is None and set(dry) & set(fit.names)):
        return False
    known = _sizes(fit)
    (k3, _), (k4, _), (k5, _) = map(known.__getitem__, (K3, K4, K5))
    most = NO_DAMPING * np.sqrt((k3 + k5) * k4)
    return all(size < off and size + off < most for size, off in (known[K6], known[K7]))


def _sizes(fit: Fit) -> Sizes:
    """Of a fit, also where it leaves a constant open."""
    value = named_values(fit.names, fit.values)
    offs = named_values(fit.names, SURE * np.sqrt(np.maximum(np.diag(fit.covariance), 0.0)))
    known = {name: (abs(phasor_of(value, name)), off) for name, off in offs.items()}
    return dict.fromkeys(CONSTANT_NAMES, (0.0, 0.0)) | known
