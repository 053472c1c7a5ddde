"""Which wrong conventions of a log are noticed, and by what: `make conventions`.

Each arm is simulated with and without friction, its log spoiled by one mistake and identified with
no flag. A row passes where a right log is called right, and where a wrong one has failed (exit 3)
and the convention that is named brings the constants back. A zero that is off by less than 45°,
sensors that fail, and logs in each other's place must be named by their code, never be Good, and
have failed where an error is beyond `FAR` of its own σ. Rows that no log can tell stand at the end.
Writes `conventions.md` into the output folder.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

from algid.arm import CONSTANT_NAMES, FloatArray, with_payload
from algid.base.errors import LogError
from algid.base.verdict import GRADE_WORDS
from algid.estimators.convention_search import judge
from algid.estimators.conventions import AS_READ
from algid.identification.identify import identify
from algid.inspection.conventions import judged, mend
from algid.log import Log, Origin, Reading
from algid.results import Result
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import SimulatedMotion, simulate
from pipelines.accuracy_scenes import case_of

ARMS = ("case1", "case2", "arm21", "arm22", "arm23")
RATE, DURATION = 1000.0, 5.0
SIGMA_THETA, SIGMA_TAU = 3e-4, 1e-2  # rad, N m
COULOMB = 0.05  # of the largest torque, where there is friction
ALIKE = 0.02  # of the constant: a mend brings it back

Pair = tuple[FloatArray, FloatArray]
Spoil = Callable[[FloatArray, FloatArray], Pair]


def _pair(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.stack([a, b])


ROWS: dict[str, Spoil] = {
    "nothing": lambda th, ta: (th, ta),
    "all signs": lambda th, ta: (-th, -ta),
    "θ2 off by 180°": lambda th, ta: (_pair(th[0], th[1] + np.pi), ta),
    "both torques": lambda th, ta: (th, -ta),
    "both angles": lambda th, ta: (-th, ta),
    "τ1": lambda th, ta: (th, _pair(-ta[0], ta[1])),
    "τ2": lambda th, ta: (th, _pair(ta[0], -ta[1])),
    "θ1": lambda th, ta: (_pair(-th[0], th[1]), ta),
    "θ2": lambda th, ta: (_pair(th[0], -th[1]), ta),
    "joint 1": lambda th, ta: (_pair(-th[0], th[1]), _pair(-ta[0], ta[1])),
    "joint 2": lambda th, ta: (_pair(th[0], -th[1]), _pair(ta[0], -ta[1])),
    "joints swapped": lambda th, ta: (th[::-1], ta[::-1]),
    "torques swapped": lambda th, ta: (th, ta[::-1]),
    "θ2 absolute": lambda th, ta: (_pair(th[0], th[0] + th[1]), ta),
    "angles × 3": lambda th, ta: (3 * th, ta),
    "θ1 × 9.6": lambda th, ta: (_pair(9.6 * th[0], th[1]), ta),
    "motor 2 at the base": lambda th, ta: (th, _pair(ta[0] - ta[1], ta[1])),
    "zero hanging": lambda th, ta: (_pair(th[0] + np.pi / 2, th[1]), ta),
    "zero upright": lambda th, ta: (_pair(th[0] - np.pi / 2, th[1]), ta),
    "zero of θ2 off by 90°": lambda th, ta: (_pair(th[0], th[1] + np.pi / 2), ta),
}


def _without_five_percent(theta: FloatArray, tau: FloatArray) -> Pair:
    """Samples lost, and the time of the others made from their numbers."""
    kept = np.random.default_rng(5).random(theta.shape[1]) > 0.05
    return theta[:, kept], tau[:, kept]


def _dead_for_a_second(theta: FloatArray, tau: FloatArray) -> Pair:
    dead = tau.copy()
    dead[1, 1000:2000] = 0.0
    return theta, dead


def _turned(theta: FloatArray, tau: FloatArray) -> Pair:
    """The zero of θ1 off by less than what another convention is taken for."""
    return _pair(theta[0] + np.radians(40), theta[1]), tau


SPOILED: dict[str, tuple[Spoil, str]] = {
    "zero of θ1 off by 40°": (_turned, "PHASES"),
    "5 % of the samples lost, time renumbered": (_without_five_percent, "LOST_SAMPLES"),
    "τ2 dead for 1 s": (_dead_for_a_second, "SENSOR_FAULT"),
}
"""What installation, sensors and recorders do to a log, and the code that tells it."""
EXCHANGED = "loaded and unloaded exchanged"
FAR = 10.0  # σ
INVISIBLE: dict[str, Spoil] = {
    "torques × 6": lambda th, ta: (th, 6 * ta),
    "torques ÷ 6": lambda th, ta: (th, ta / 6),
}


def motion_of(name: str, *, loaded: bool = False) -> tuple[FloatArray, SimulatedMotion]:
    """Constants (7,) of an arm by name, and its motion under a wide torque, with half of link 2's
    mass or without.
    """
    arm = case_of(name).arm
    t = np.arange(round(DURATION * RATE) + 1) / RATE
    k = arm.constants()
    moved = with_payload(k, arm.payload_constants(0.5 * arm.m2)) if loaded else k
    return k, simulate(moved, wide_multi_sine(arm, sum(name.encode()) + loaded), t)


def log_of(motion: SimulatedMotion, spoil: Spoil, *, friction: bool, seed: int = 0) -> Log:
    """The log of a motion by noisy sensors, spoiled.

    The motors overcome Coulomb friction where there is some.
    """
    rng = np.random.default_rng(seed)
    tau = motion.tau
    if friction:
        tau = tau + COULOMB * np.abs(tau).max(axis=1, keepdims=True) * np.tanh(motion.omega / 0.02)
    theta = motion.theta + SIGMA_THETA * rng.standard_normal(tau.shape)
    read = spoil(theta, tau + SIGMA_TAU * rng.standard_normal(tau.shape))
    return Log(
        np.round(motion.t[: read[0].shape[1]] * 1e9).astype(np.int64),
        *read,
        Origin("arm.csv", "csv", {}),
    )


def mended(log: Log, k: FloatArray) -> bool:
    """Whether the convention that is named brings the constants of inertia and gravity back."""
    judged = judge(log.theta, log.tau, 1 / RATE)
    if judged is None or not judged.alone or judged.best.convention == AS_READ:
        return False
    return bool(np.allclose(judged.best.k[:5], k[:5], rtol=ALIKE, atol=ALIKE * k[:5].max()))


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


def row(
    name: str, spoil: Spoil, arm: str, k: FloatArray, motion: SimulatedMotion, *, friction: bool
) -> tuple[str, bool]:
    """A line of the table, and whether it passes."""
    log = log_of(motion, spoil, friction=friction)
    named = mend(log, judged(log))
    words = "" if named is None else f"{named.words}: `{' '.join(named.remedy.flags)}`"
    try:
        result = identify(log, report=False)
    except LogError as refusal:  # exit 2: a scale that no joint has
        right = name == "nothing" or name in INVISIBLE
        return _line(name, arm, friction, "", "Refused", str(refusal).partition(": ")[2], not right)
    found = result.verdict
    if name == "nothing" or name in INVISIBLE:
        passed = named is None and found.grade != "failed"
    elif name in SPOILED:
        passed, words = _noticed(result, SPOILED[name][1], k), SPOILED[name][1]
    else:
        passed = found.grade == "failed" and named is not None and mended(log, k)
    return _line(
        name, arm, friction, f"{furthest(result, k):.3g}", GRADE_WORDS[found.grade], words, passed
    )


def _noticed(result: Result, code: str, k: FloatArray) -> bool:
    """Whether a result names `code`, is not Good, and has no error beyond `FAR` without having
    failed.
    """
    level = result.verdict.grade
    named = any(notice.code == code for notice in result.notices)
    return named and level != "good" and (level == "failed" or furthest(result, k) <= FAR)


def _line(
    name: str, arm: str, friction: bool, far: str, level: str, words: str, passed: bool
) -> tuple[str, bool]:
    cells = (name, arm, "yes" if friction else "no", far, level, words)
    return f"| {' | '.join(cells)} | {'yes' if passed else 'NO'} |", passed


def exchanged(arm: str, k: FloatArray, *, friction: bool) -> tuple[str, bool]:
    """The row of a loaded and an unloaded log in each other's place.

    a joint may turn as often as it will.
    """
    turning = Origin("arm.csv", "csv", {}, reading=Reading(accepted=("DEGREES",)))
    loaded, unloaded = (
        replace(
            log_of(motion_of(arm, loaded=kind)[1], ROWS["nothing"], friction=friction, seed=kind),
            origin=turning,
        )
        for kind in (True, False)
    )
    result = identify(loaded, unloaded, report=False)
    passed = _noticed(result, "LOGS_APART", k)
    far, level = f"{furthest(result, k):.3g}", GRADE_WORDS[result.verdict.grade]
    return _line(EXCHANGED, arm, friction, far, level, "LOGS_APART", passed)


def lines_of(arm: str) -> list[tuple[str, bool]]:
    """The lines of one arm, and whether each passes."""
    k, motion = motion_of(arm)
    rows = {**ROWS, **{name: spoil for name, (spoil, _) in SPOILED.items()}, **INVISIBLE}
    found = []
    for friction in (False, True):
        found += [
            row(name, spoil, arm, k, motion, friction=friction) for name, spoil in rows.items()
        ]
        found.append(exchanged(arm, k, friction=friction))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", nargs="+", default=ARMS)
    parser.add_argument("-o", "--output", type=Path, default=Path("build/conventions"))
    arguments = parser.parse_args()
    lines = [
        "| spoiled | arm | friction | error, σ | verdict | named | passes |",
        "|---|---|---|---|---|---|---|",
    ]
    failed = 0
    with ProcessPoolExecutor(2) as pool:
        for found in pool.map(lines_of, arguments.arms):
            for line, passed in found:
                lines.append(line)
                failed += not passed
                print(line, flush=True)
    arguments.output.mkdir(parents=True, exist_ok=True)
    summary = f"{len(lines) - 2 - failed} of {len(lines) - 2} rows pass."
    (arguments.output / "conventions.md").write_text(
        "\n".join([*lines, "", summary, ""]), encoding="utf-8"
    )
    print(summary)
    raise SystemExit(failed > 0)


if __name__ == "__main__":
    main()
