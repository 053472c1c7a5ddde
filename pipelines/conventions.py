"""Which wrong conventions of a log are noticed, and by what: `make conventions`.

Each arm is simulated with and without friction, its log spoiled by one mistake and identified with
no flag. A row passes where a right log is called right, and where a wrong one has failed (exit 3)
and the convention that is named brings the constants back. A zero that is off by less than 45°,
sensors that fail, and logs in each other's place must be named by their code, never be Good, and
have failed where an error is beyond `FAR` of its own σ. Of scales of the torque no log can tell.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from algid.arm import CONSTANT_NAMES, FloatArray
from algid.base.errors import LogError
from algid.estimators.conventions import AS_READ
from algid.identification.identify import identify
from algid.inspection.conventions import judged as conventions_of
from algid.inspection.conventions import mend
from algid.log import ChannelReading, Log, Origin, Reading
from algid.results import Result
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import SimulatedMotion, simulate
from pipelines.accuracy_scenes import case_of
from pipelines.experiment import Seen, count, experiment, grid, words

ARMS = ("case1", "case2", "arm21", "arm22", "arm23")
RATE, DURATION = 1000.0, 5.0
SIGMA_THETA, SIGMA_TAU = 3e-4, 1e-2  # rad, N m
COULOMB = 0.05  # of the largest torque, where there is friction
ALIKE = 0.02  # of the constant: a mend brings it back

Spoil = Callable[..., tuple[FloatArray, ...]]
"""What is made of θ1, θ2, τ1, τ2."""


SPOILS: dict[str, Spoil] = {
    "nothing": lambda a, b, s, t: (a, b, s, t),
    "all signs": lambda a, b, s, t: (-a, -b, -s, -t),
    "θ2 off by 180°": lambda a, b, s, t: (a, b + np.pi, s, t),
    "both torques": lambda a, b, s, t: (a, b, -s, -t),
    "both angles": lambda a, b, s, t: (-a, -b, s, t),
    "τ1": lambda a, b, s, t: (a, b, -s, t),
    "τ2": lambda a, b, s, t: (a, b, s, -t),
    "θ1": lambda a, b, s, t: (-a, b, s, t),
    "θ2": lambda a, b, s, t: (a, -b, s, t),
    "joint 1": lambda a, b, s, t: (-a, b, -s, t),
    "joint 2": lambda a, b, s, t: (a, -b, s, -t),
    "joints swapped": lambda a, b, s, t: (b, a, t, s),
    "torques swapped": lambda a, b, s, t: (a, b, t, s),
    "θ2 absolute": lambda a, b, s, t: (a, a + b, s, t),
    "angles × 3": lambda a, b, s, t: (3 * a, 3 * b, s, t),
    "θ1 × 9.6": lambda a, b, s, t: (9.6 * a, b, s, t),
    "motor 2 at the base": lambda a, b, s, t: (a, b, s - t, t),
    "zero hanging": lambda a, b, s, t: (a + np.pi / 2, b, s, t),
    "zero upright": lambda a, b, s, t: (a - np.pi / 2, b, s, t),
    "zero of θ2 off by 90°": lambda a, b, s, t: (a, b + np.pi / 2, s, t),
    # what a plain log becomes where a profile says what is not so
    "said to be absolute": lambda a, b, s, t: (a, b - a, s, t),
    "said to be driven from the base": lambda a, b, s, t: (a, b, s + t, t),
    "said to be in degrees": lambda a, b, s, t: (np.radians(a), np.radians(b), s, t),
    "said to be geared": lambda a, b, s, t: (a / 50, b, s, t),
    # what installation, sensors and recorders do to a log
    "zero of θ1 off by 40°": lambda a, b, s, t: (a + np.radians(40), b, s, t),
    "5 % of the samples lost, time renumbered": lambda *channels: _pierced(channels),
    "τ2 dead for 1 s": lambda a, b, s, t: (a, b, s, np.r_[t[:1000], 0 * t[1000:2000], t[2000:]]),
    "torques × 6": lambda a, b, s, t: (a, b, 6 * s, 6 * t),
    "torques ÷ 6": lambda a, b, s, t: (a, b, s / 6, t / 6),
}
_DEGREES = ChannelReading("theta", "deg", "profile", np.pi / 180)
SAID = {
    "said to be absolute": Reading(second_angle="absolute"),
    "said to be driven from the base": Reading(drive="base"),
    "said to be in degrees": Reading(dict.fromkeys(("theta1", "theta2"), _DEGREES)),
    "said to be geared": Reading({"theta1": ChannelReading("theta1", "rad", "profile", 1 / 50)}),
}
"""How such a log was read."""
NOTICED = {
    "zero of θ1 off by 40°": "PHASES",
    "5 % of the samples lost, time renumbered": "LOST_SAMPLES",
    "τ2 dead for 1 s": "SENSOR_FAULT",
}
"""The code that tells a mistake which no convention undoes."""
EXCHANGED = "loaded and unloaded exchanged"
INVISIBLE = ("torques × 6", "torques ÷ 6")
FAR = 10.0  # σ


def _pierced(channels: tuple[FloatArray, ...]) -> tuple[FloatArray, ...]:
    kept = np.random.default_rng(5).random(channels[0].size) > 0.05
    return tuple(channel[kept] for channel in channels)


def motion_of(name: str, *, loaded: bool = False) -> tuple[FloatArray, SimulatedMotion]:
    """Constants (7,) of an arm by name, and its motion under a wide torque, with half of link 2's
    mass or without.
    """
    arm = case_of(name).arm
    t = np.arange(round(DURATION * RATE) + 1) / RATE
    k = arm.constants()
    moved = arm.constants(0.5 * arm.m2) if loaded else k
    return k, simulate(moved, wide_multi_sine(arm, sum(name.encode()) + loaded), t)


def log_of(motion: SimulatedMotion, title: str, friction: int, seed: int = 0) -> Log:
    """The log of a motion by noisy sensors, spoiled by the mistake of that name.

    The motors overcome Coulomb friction where there is some.
    """
    rng = np.random.default_rng(seed)
    tau = motion.tau
    if friction:
        tau = tau + COULOMB * np.abs(tau).max(axis=1, keepdims=True) * np.tanh(motion.omega / 0.02)
    theta = motion.theta + SIGMA_THETA * rng.standard_normal(tau.shape)
    tau = tau + SIGMA_TAU * rng.standard_normal(tau.shape)
    a, b, s, t = SPOILS[title](*theta, *tau)
    stamps = np.round(motion.t[: a.size] * 1e9).astype(np.int64)
    origin = Origin("arm.csv", "csv", {}, reading=SAID.get(title, Reading()))
    return Log(stamps, np.stack([a, b]), np.stack([s, t]), origin)


def mended(log: Log, k: FloatArray) -> bool:
    """Whether the convention that is named brings the constants of inertia and gravity back."""
    judged = conventions_of(log)
    if judged is None or not judged.alone or judged.best.convention == AS_READ:
        return False
    found = list(judged.best.constants.values())
    return bool(np.allclose(found[:5], k[:5], rtol=ALIKE, atol=ALIKE * k[:5].max()))


def furthest(result: Result, k: FloatArray) -> float:
    """Largest error of k1 … k7 in its own standard deviations; of moments, that of their size.

    A zero that is off turns a moment's phase, and leaves its size.
    """
    far = [0.0]
    for name, true in zip(CONSTANT_NAMES, k, strict=True):
        one, across = result.parameters[name], result.parameters.get(f"{name}s")
        if not one.estimate or not one.std:
            continue
        size, std = abs(one.estimate), one.std
        if across is not None and across.estimate and across.std:
            size = float(np.hypot(one.estimate, across.estimate))
            parts = (one.estimate * one.std, across.estimate * across.std)
            std = float(np.hypot(*parts)) / size
        far.append(abs(size * np.sign(one.estimate) - true) / std)
    return max(far)


def draw(title: str, arm: str, number: int) -> Seen:
    """What is said of a spoiled log, every second with friction, and whether it passes."""
    if title == EXCHANGED:
        return exchanged(arm, number)
    k, motion = motion_of(arm)
    log = log_of(motion, title, number)
    named = mend(log.origin, conventions_of(log))
    right = title == "nothing" or title in INVISIBLE
    try:
        result = identify(log, report=False)
    except LogError as refusal:  # exit 2: a scale that no joint has
        return _seen(arm, number, f"Refused, {str(refusal).partition(': ')[2]}", not right)
    grade = result.verdict.grade
    if right:
        passed = named is None and grade != "failed"
    elif title in NOTICED:
        passed = _noticed(result, NOTICED[title], k)
    else:
        passed = grade == "failed" and named is not None and mended(log, k)
    flags = "" if named is None else f", {' '.join(named.remedies[0].flags)}"
    return _seen(arm, number, f"{grade}, {furthest(result, k):.3g} σ{flags}", passed)


def _seen(arm: str, number: int, told: str, passed: bool) -> Seen:
    failing = [] if passed else [f"({arm}, {number}: {told})"]
    return {"passes": [passed], "not": failing, "told": [told]}


def _noticed(result: Result, code: str, k: FloatArray) -> bool:
    """Whether a result names `code`, is not Good, and has no error beyond `FAR` without having
    failed.
    """
    level = result.verdict.grade
    named = any(notice.code == code for notice in result.notices)
    return named and level != "good" and (level == "failed" or furthest(result, k) <= FAR)


def exchanged(arm: str, number: int) -> Seen:
    """A loaded and an unloaded log in each other's place; a joint may turn as often as it will."""
    turning = Origin("arm.csv", "csv", {}, reading=Reading(accepted=("DEGREES",)))
    loaded, unloaded = (
        replace(
            log_of(motion_of(arm, loaded=kind)[1], "nothing", number, seed=kind),
            origin=turning,
        )
        for kind in (True, False)
    )
    result, k = identify(loaded, unloaded, report=False), motion_of(arm)[0]
    told = f"{result.verdict.grade}, {furthest(result, k):.3g} σ"
    return _seen(arm, number, told, _noticed(result, "LOGS_APART", k))


if __name__ == "__main__":
    rows = {title: (title,) for title in (*SPOILS, EXCHANGED)}
    columns = {"of": lambda seen: str(len(seen["passes"])), "pass": count("passes")}
    columns["does not"] = words("not")
    every = experiment("conventions", __doc__, grid(rows, ARMS), draw, columns, draws=2)
    raise SystemExit(not all(every["passes"]))
