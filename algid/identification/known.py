"""What an earlier result knows of its arm: model, constants and prior, torque shift, lengths."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from math import isclose
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import numpy as np

from algid.arm import FloatArray
from algid.base.criteria import SAME_LENGTH
from algid.base.errors import ResultError, SettingError
from algid.base.names import outside, vector, within
from algid.base.significance import CERTAIN, sigmas
from algid.estimators.combine import Prior
from algid.estimators.parametrisation import BODY_PARAMETERS, Shared
from algid.estimators.whitening import NoiseLevels
from algid.model import (
    K1,
    K2,
    K3,
    K5,
    SINE_OF,
    Model,
    length_by_coupling,
    phasor_of,
    without_delay,
)
from algid.notices import Notice, Remedy
from algid.options import flag
from algid.physics.effort import absent
from algid.physics.signals import widths_of
from algid.results import FitSummary, LogSummary, Result
from algid.settings import DEFAULTS, Settings
from algid.signals.differences import TorqueShift

if TYPE_CHECKING:
    from algid.identification.recordings import Role
    from algid.profile import Profile

FAR = sigmas(CERTAIN)  # beyond which two statements contradict each other
SENSORS = ("theta1", "theta2", "tau1", "tau2")
"""Channels whose noise a result has."""


def model_of(result: Result) -> Model:
    """The torque's model behind a result.

    A result that names none was made with what its settings ask for.
    """
    settings, model = Settings.of(result.settings), result.torque_model
    if model is None:
        return Model(without_delay(settings.terms), settings.gravity)
    return Model(tuple(model.terms), settings.gravity, **widths_of(model))


def reused(profile: Profile | None, earlier: Result, file: str) -> Profile:
    """The user's profile of the logs, completed by what was said of those of the earlier result.

    Raises
    ------
    SettingError
        If another gravity is stated than that of the earlier result, whose `file` is named.
    """
    from algid.profile import Profile, lasting, over

    known = lasting(earlier.profile)
    settings = Settings.of(earlier.settings)  # as its logs showed them
    for name in ("gravity", "effort"):
        if (shown := getattr(settings, name)) != DEFAULTS[name] or name in known:
            known[name] = shown
    meant = over(profile, known) or Profile()
    # of a driver that compensates the weights of arm and payload nothing has any
    weightless = meant.effort == "gravity-compensated" and meant.gravity == 0
    if meant.gravity != settings.gravity and not weightless:
        raise SettingError(
            f"{flag('gravity')}: {file} has its arm under {settings.gravity:g} m/s², found "
            f"{meant.gravity:g}; leave it out, or identify the arm anew"
        )
    return meant


def as_logged(result: Result, profile: Profile) -> Result:
    """The result with the effort and the gravity that a profile states of the logs to predict."""
    stated = {"effort": profile.effort, "gravity": profile.gravity}
    return result.model_copy(update={"settings": result.settings | stated})


def untold(result: Result, model: Model) -> tuple[str, ...]:
    """What of the arm's `model` torques as the result's driver logs them do not hold."""
    return absent(Settings.of(result.settings).effort, model.names)


def shift_of(result: Result) -> TorqueShift:
    """After how long a logged torque acts: hold, and delay."""
    delay = None if result.delay is None else result.delay.estimate
    return Settings.of(result.settings).torque_shift(delay)


def prior_of(result: Result, model: Model, file: str | None = None) -> Prior:
    """What an earlier result knows of the arm's `model`.

    Where it is wrong, its `file` is named, or its log.

    Raises
    ------
    ResultError
        If its estimator gives no error bars, or it does not determine all constants of the model.
    """
    file = file or result.log.path
    if result.fit is None:
        raise ResultError(
            f"{file}: the result of {flag('estimator')} {result.estimator} has no error bars; "
            f"identify with {flag('estimator')} refined or weak, or use {flag('estimator')} paper "
            "here too"
        )
    names = outside(model.names, untold(result, model))
    missing = outside(names, within(result.fit.covariance_names, result.parameters))
    if missing:
        raise ResultError(
            f"{file}: the result has no {', '.join(missing)}; use the flags it was made with"
        )
    covariance = result.fit.covariance_of(names)
    mean = vector(names, values_of(result), otherwise=np.nan)
    if not np.isfinite([*covariance, mean]).all():
        raise ResultError(
            f"{file}: the result leaves constants undetermined; identify from more logs first"
        )
    return Prior.of(names, mean, covariance)


def noise_of(result: Result) -> NoiseLevels | None:
    """Noise of the logs behind a result; None unless all four levels are known and above zero."""
    if result.fit is None:
        return None
    levels = vector(SENSORS, result.fit.noise, otherwise=0.0)
    if levels.min() <= 0:
        return None
    return NoiseLevels(*levels.reshape(2, 2))


def torque_constants(result: Result, model: Model, role: Role, file: str) -> FloatArray:
    """Coefficients of the model's columns for a log of that role, from the result of that file.

    Raises
    ------
    ResultError
        If one of them has no estimate.
    """
    known = values_of(result) | dict.fromkeys(untold(result, model), 0.0) | given_lengths(result)
    loaded = role == "loaded"
    shared = Shared(model, payload=loaded, body=within(BODY_PARAMETERS, known))
    for name in outside(shared.names, known):
        raise ResultError(
            f"{file}: the result has no {name}; identify it from logs that determine it"
        )
    return shared.coefficients(vector(shared.names, known), loaded)


def values_of(result: Result) -> dict[str, float]:
    """The estimates of a result by name, without those that its logs leave open."""
    every = result.estimates.items()
    return {name: one.estimate for name, one in every if one.estimate is not None}


def given_lengths(result: Result) -> dict[str, float]:
    """The link lengths in m that the result was made with: not one that it identifies instead."""
    lengths = Settings.of(result.settings).lengths
    return {name: lengths[name] for name in outside(lengths, result.payload)}


def wrong_inertia(values: Mapping[str, float]) -> str | None:
    """That no arm has the inertia matrix of these constants, in words; None where one has.

    Constants are NaN where they are not known.
    """
    k1, k3, k5 = abs(phasor_of(values, K1)), values[K3], values[K5]
    # eq. (2): det M = k3 k5 − k1² wherever joint 2 is turned by half a turn or not at all
    if not (k3 <= 0 or k3 * k5 <= k1**2):
        return None
    return (
        f"its inertia matrix is not positive definite (k1 {k1:.3g}, k3 {k3:.3g}, k5 {k5:.3g} kg m²)"
    )


def with_error_bar(result: Result, names: Iterable[str]) -> tuple[str, ...]:
    """Those of the names whose estimate is sound, and in the result's covariance, in order."""
    known = () if result.fit is None else result.fit.covariance_names
    sound = {name for name, one in result.estimates.items() if one.usable and one.std is not None}
    return within(names, sound.intersection(known))


def covariance_of(result: Result, names: Sequence[str], uncertain: Collection[str]) -> FloatArray:
    """Covariance (n, n) of the parameters `names`: zero for those that are not `uncertain`.

    Raises
    ------
    ResultError
        If the result does not know it.
    """
    covariance = np.zeros((len(names), len(names)))
    if result.fit is not None:
        unsure = np.isin(names, list(uncertain))
        known = result.fit.covariance_of(names)
        covariance = np.where(unsure & unsure[:, None], known, covariance)
    if np.isnan(covariance).any():
        of = ", ".join(within(names, uncertain))
        raise ResultError(f"{result.log.path}: its result has no covariance of {of}; identify anew")
    return covariance


def by_constants(result: Result) -> tuple[float, float, dict[str, float]] | None:
    """l1 = g |K1| / |K2| and its standard deviation in m, and its derivatives by the constants.

    None if the result leaves it open.

    K = k + i ks are the moments as phasors. Of an arm whose links are straight l1 has the sign of
    k1 / k2, so that a wrong one shows.
    """
    gravity = Settings.of(result.settings).gravity
    names = with_error_bar(result, (K1, K2, SINE_OF[K1], SINE_OF[K2]))
    value = {name: result.parameters[name].estimate or 0.0 for name in names}
    l1 = length_by_coupling(value, gravity) if {K1, K2} <= set(names) else None
    if l1 is None or result.fit is None:
        return None
    slopes = dict[str, float]()
    for name, power in ((K1, 1), (K2, -1)):
        slope_of = power * l1 / phasor_of(value, name).conjugate()
        slopes |= {name: slope_of.real, SINE_OF[name]: slope_of.imag}
    slope = vector(names, slopes)
    std = float(np.sqrt(slope @ result.fit.covariance_of(names) @ slope))
    return l1, std, {name: slopes[name] for name in names}


def payload_length(result: Result) -> tuple[float, float] | None:
    """The payload's l1 and its standard deviation in m, if more precise than `by_constants`."""
    l1 = result.payload.get("l1")
    if l1 is None or l1.estimate is None or not l1.std or not l1.usable:
        return None
    other = by_constants(result)
    if other is not None and other[0] > 0 and other[1] <= l1.std:
        return None
    return l1.estimate, l1.std


def gain_notes(fit: FitSummary | None) -> Iterator[Notice]:
    """What a payload of known mass says of the torques' gain, and so of all masses of a result."""
    gain = None if fit is None else fit.torque_gain
    if gain is None:
        return
    if gain.estimate is None or gain.ci95 is None:
        yield Notice("TORQUE_GAIN", numbers={"case": "unknown"})
        return
    # a gain that is off by what scales, as rulers, differ is none
    off = abs(gain.estimate - 1) > max(FAR * (gain.std or 0.0), SAME_LENGTH)
    gears = Remedy(
        {"tau1.torque_constant": None, "tau2.torque_constant": None}, "set them, or gear_ratio"
    )
    low, high = gain.ci95
    numbers = {"gain": gain.estimate, "low": low, "high": high, "case": "off" if off else "known"}
    yield Notice("TORQUE_GAIN", numbers=numbers, remedies=(gears,))


def contradictions(result: Result, lengths: Mapping[str, float]) -> tuple[Notice, ...]:
    """What is known against a result: the gain of its torques, and given lengths.

    These contradict those that it was made with, or identified: the payload's, or l1 = g k1 / k2.
    """
    stated, of_arm = given_lengths(result), by_constants(result)
    identified = {name: (one.estimate, one.std) for name, one in result.payload.items()}
    if of_arm is not None:
        identified["l1"] = of_arm[:2]
    notices = [one for one in gain_notes(result.fit) if not one.note]
    for name, given in lengths.items():
        numbers: dict[str, Any] = {}
        estimate, std = identified.get(name, (None, None))
        if name not in stated:
            if estimate is not None and std:
                numbers = contradicting(name, given, estimate, std, result.quantile)
        elif not isclose(given, stated[name], rel_tol=SAME_LENGTH):
            numbers = {"case": "stated", "name": name, "given": given, "stated": stated[name]}
        if numbers:
            notices.append(Notice("LENGTH_CONTRADICTED", numbers=numbers))
    return tuple(notices)


def contradicting(
    name: str, given: float, estimate: float, std: float, quantile: float
) -> dict[str, Any]:
    """The numbers of a given length that contradicts an estimate; empty where it does not."""
    off = abs(given - estimate)
    if not off > FAR * std:
        return {}
    numbers: dict[str, Any] = {"case": "identified", "name": name, "given": given}
    distance = off / std if std else np.inf
    return numbers | {"estimate": estimate, "half": quantile * std, "distance": distance}


def read_otherwise(logs: Sequence[LogSummary], earlier: Result, file: str) -> list[Notice]:
    """Warnings of logs read otherwise than those of an earlier result, which `file` holds."""
    before = earlier.log.reading
    if before is None:
        return []
    notices = []
    for log in logs:
        differences = sorted(log.reading.differences(before)) if log.reading else []
        if differences:
            numbers = {"case": "reading", "file": file, "differences": ", ".join(differences)}
            name = PurePath(log.path).name
            notices.append(Notice("OTHER_ARM", numbers=numbers, logs=(name,)))
    return notices
