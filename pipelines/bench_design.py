"""What a designed motion is worth, and whether its error bars come true: `make bench-design`.

Both cases of the paper and five random arms, within ± 1.2 rad, 3 rad/s and twice the torque of the
loaded arm's weight, 10 s. Beside each design stand random Fourier motions scaled to the same
limits, and the motion with the least condition number (the peers' criterion) within them. Then the
campaign is rehearsed: a controller follows the motion on the true arm, the logs get noise, and the
errors of what `refined` finds are set over the error bars predicted, with the true arm as prior
and with priors whose masses are 20 % wrong. Writes `design.md` and `design.json`.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from algid.arm import Arm, FloatArray, with_payload
from algid.designs.belief import Asked, asked_for
from algid.designs.campaign import Campaign, plan
from algid.designs.information import Experiment, Information, Slopes
from algid.designs.limits import Limits, resting
from algid.designs.optimise import Stage, kept, optimise
from algid.designs.position import JUDGED_RATE, PositionProblem
from algid.designs.prior import KnownBefore, of_case
from algid.estimators import refined
from algid.estimators.whitening import NoiseLevels
from algid.signals.segments import Segment
from algid.synth.cases import Case
from algid.synth.follow import Reference, follow
from pipelines.accuracy_scenes import case_of

NAMES = ("case1", "case2", "arm1", "arm2", "arm3", "arm4", "arm5")
DURATION, RATE = 10.0, 1000.0
NOISE = NoiseLevels(np.full(2, 1e-3), np.full(2, 1e-2))
HANGING = np.array([-np.pi / 2, 0.0])
WRONG = ((1.2, 1.2, 0.8), (1.2, 0.8, 1.2), (0.8, 1.2, 0.8), (0.8, 0.8, 1.2))  # of m1, m2, m_p
Row = dict[str, Any]
Job = tuple[str, tuple[float, float, float] | None, int]


def limits_of(case: Case) -> Limits:
    """± 1.2 rad about hanging, 3 rad/s, and twice the weight's torque of the true arm with its
    payload.
    """
    k = with_payload(case.arm.constants(), case.arm.payload_constants(case.payload))
    weight = np.array([k[3] + k[1], k[1]])
    return Limits(
        low=HANGING - 1.2,
        high=HANGING + 1.2,
        speed=np.full(2, 3.0),
        acceleration=np.full(2, np.inf),
        torque=2 * weight,
        height=-np.inf,
        lengths=np.array([case.arm.l1, case.arm.l2]),
    )


def wrong(case: Case, m1: float, m2: float, m_p: float) -> Case:
    """The case with its masses, and the inertias with them, multiplied."""
    arm: Arm = case.arm
    arm = replace(arm, m1=m1 * arm.m1, I1=m1 * arm.I1, m2=m2 * arm.m2, I2=m2 * arm.I2)
    return replace(case, arm=arm, payload=m_p * case.payload)


def campaign_of(prior: Case, limits: Limits) -> Campaign:
    """The campaign that is planned for a prior within limits."""
    known = of_case(prior, prior.name, True, KnownBefore())
    experiment = Experiment(known.belief.shared, (1, 1), NOISE, RATE)
    return Campaign(
        experiment, known.belief, limits, asked_for(known.belief, None, prior.name), DURATION
    )


class LeastConditionNumber(PositionProblem):
    """The peers' criterion: the condition number of the stacked regressor, its columns as they
    are.
    """

    def criterion(self, slopes: Slopes, _stage: Stage) -> tuple[float, FloatArray]:
        figure, slope = self._condition(slopes)
        return figure, np.einsum("aqn,caqn->cn", slope, slopes.dY)

    def score(self, x: FloatArray) -> float:
        return self._condition(self.slopes(x, JUDGED_RATE))[0]

    @staticmethod
    def _condition(slopes: Slopes) -> tuple[float, FloatArray]:
        """Logarithm of the condition number and its derivative by Y (2, q, N)."""
        values, vectors = np.linalg.eigh(np.einsum("aqn,arn->qr", slopes.Y, slopes.Y))
        A = (
            np.outer(vectors[:, -1], vectors[:, -1]) / values[-1]
            - np.outer(vectors[:, 0], vectors[:, 0]) / values[0]
        )
        return 0.5 * float(np.log(values[-1] / values[0])), np.einsum("qr,arn->aqn", A, slopes.Y)


def problem_of(kind: Callable[..., PositionProblem], campaign: Campaign) -> PositionProblem:
    limits = campaign.limits.within(campaign.margin)
    loads = [campaign.belief.load(loaded) for loaded in campaign.experiment.kinds]
    rest = resting(limits, campaign.experiment.shared.model, loads)
    return kind(
        campaign.experiment, campaign.belief, limits, campaign.asked, campaign.duration, rest
    )


def bound(campaign: Campaign, slopes: Slopes) -> float:
    """The largest relative bound of a motion."""
    asked: Asked = campaign.asked
    return asked.largest(Information(campaign.experiment, campaign.belief.mean, slopes).S)


def worth(name: str, randoms: int) -> Row:
    """The largest relative bound of the design, of random motions, and of the least condition
    number.
    """
    case = case_of(name)
    campaign = campaign_of(case, limits_of(case))
    began, cpu = time.monotonic(), time.process_time()
    design = plan(campaign)
    took, used = time.monotonic() - began, time.process_time() - cpu
    problem = problem_of(PositionProblem, campaign)
    rng = np.random.default_rng(7)
    scaled = (kept(problem, problem.random(rng), JUDGED_RATE, 0.999) for _ in range(randoms))
    bounds = np.array([bound(campaign, problem.slopes(x, JUDGED_RATE)) for x in scaled])
    peer = problem_of(LeastConditionNumber, campaign)
    conditioned = optimise(peer, RATE, seed=0).x
    return {
        "arm": name,
        "design_percent": 100 * design.largest,
        "random_median_percent": 100 * float(np.median(bounds)),
        "random_best_percent": 100 * float(bounds.min()),
        "condition_percent": 100 * bound(campaign, peer.slopes(conditioned, JUDGED_RATE)),
        "over_random": design.largest / float(np.median(bounds)),
        "seconds": took,
        "cpu_seconds": used,
    }


def rehearsed(name: str, error: tuple[float, float, float] | None, draws: int) -> Row:
    """Errors over the error bars predicted (draws, Q), and the largest usage of any limit by the
    true arm.
    """
    case = case_of(name)
    limits = limits_of(case)
    prior = case if error is None else wrong(case, *error)
    design = plan(campaign_of(prior, limits))
    k, t = case.arm.constants(), design.t
    followed = Reference(
        t, design.motion.theta, design.motion.omega, design.torque[False], design.torque[True]
    )
    motions = []
    for loaded in (False, True):
        own = with_payload(k, case.arm.payload_constants(case.payload * loaded))
        motions.append(follow(own, followed, t, k, loaded, None))
    truth = np.concatenate([k, [case.payload, case.arm.l1, case.arm.l2]])
    rng = np.random.default_rng(
        [sum(name.encode()), 0 if error is None else 1 + WRONG.index(error)]
    )
    errors = [_identified(motions, rng) - truth for _ in range(draws)]
    return {
        "arm": name,
        "wrong": error is not None,
        "names": list(design.names),
        "z": (np.array(errors) / design.std).tolist(),
        "used": max(_used(limits, motion) for motion in motions),
    }


def _identified(motions: list[Any], rng: np.random.Generator) -> FloatArray:
    logs = [
        Segment(
            0.0,
            1 / RATE,
            motion.theta + NOISE.theta[:, None] * rng.standard_normal(motion.theta.shape),
            motion.tau + NOISE.tau[:, None] * rng.standard_normal(motion.tau.shape),
        )
        for motion in motions
    ]
    return refined.fit([lambda: [logs[0]]], [lambda: [logs[1]]]).values


def _used(limits: Limits, motion: Any) -> float:
    """The largest share of a limit that a true motion uses: angles, velocities, torques."""
    half = 0.5 * (limits.high - limits.low)
    shares = (
        np.abs(motion.theta - limits.middle[:, None]) / half[:, None],
        np.abs(motion.omega) / limits.speed[:, None],
        np.abs(motion.tau) / limits.torque[:, None],
    )
    return float(max(share.max() for share in shares))


def ratios(rows: list[Row]) -> dict[str, float]:
    """RMS over all draws of each parameter's error over its predicted standard deviation."""
    z = np.concatenate([np.array(row["z"]) for row in rows])
    return dict(zip(rows[0]["names"], np.sqrt(np.mean(z**2, axis=0)).tolist(), strict=True))


def main() -> None:
    """Run the benchmark; exit 1 where a figure is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", default=",".join(NAMES))
    parser.add_argument("--draws", type=int, default=100)
    parser.add_argument("--randoms", type=int, default=100)
    parser.add_argument("-o", "--out", type=Path, default=Path("build/bench-design"))
    options = parser.parse_args()
    names = options.arms.split(",")
    with ProcessPoolExecutor(2) as pool:
        values = list(pool.map(partial(worth, randoms=options.randoms), names))
        jobs: list[Job] = [(name, None, options.draws) for name in names] if options.draws else []
        jobs += [
            (name, error, -(-options.draws // len(WRONG)))
            for name in names
            for error in WRONG
            if options.draws
        ]
        rehearsals = list(pool.map(_rehearsed, jobs))
    figures = judged(values, rehearsals)
    options.out.mkdir(parents=True, exist_ok=True)
    text = markdown(values, rehearsals, figures)
    (options.out / "design.md").write_text(text, encoding="utf-8")
    content = {"worth": values, "rehearsed": rehearsals, "figures": figures}
    (options.out / "design.json").write_text(json.dumps(content, indent=1), encoding="utf-8")
    print(text)
    raise SystemExit(0 if all(figure["reached"] for figure in figures) else 1)


def _rehearsed(job: Job) -> Row:
    return rehearsed(*job)


def judged(values: list[Row], rehearsals: list[Row]) -> list[Row]:
    """Each figure asked for beside what was measured."""
    figures = [
        _figure(
            "largest bound over the random motions' median",
            0.5,
            max(row["over_random"] for row in values),
        ),
        _figure(
            "largest bound over that of the least condition number",
            1.0,
            max(row["design_percent"] / row["condition_percent"] for row in values),
        ),
        _figure("processor seconds of a design", 60.0, max(row["cpu_seconds"] for row in values)),
    ]
    if rehearsals:
        right, off = (
            ratios([row for row in rehearsals if not row["wrong"]]),
            ratios([row for row in rehearsals if row["wrong"]]),
        )
        figures += [
            _figure(
                "error over predicted ±, all arms, most (true prior)", 1.1, max(right.values())
            ),
            _figure(
                "error over predicted ±, all arms, least (true prior), inverted",
                1 / 0.9,
                1 / min(right.values()),
            ),
            _figure("error over predicted ±, most (masses 20 % wrong)", 1.3, max(off.values())),
            _figure(
                "share of a limit used by any true arm", 1.0, max(row["used"] for row in rehearsals)
            ),
        ]
    return figures


def _figure(what: str, asked: float, measured: float) -> Row:
    return {"figure": what, "at_most": asked, "measured": measured, "reached": measured <= asked}


def markdown(values: list[Row], rehearsals: list[Row], figures: list[Row]) -> str:
    """The tables as text."""
    lines = ["| figure | asked | measured | |", "|---|---|---|---|"]
    lines += [
        f"| {row['figure']} | ≤ {row['at_most']:.3g} | {row['measured']:.3g} | "
        f"{'✓' if row['reached'] else 'missed'} |"
        for row in figures
    ]
    lines += [
        "",
        "| arm | design, % | random median, % | random best, % | least condition, % | cpu, s |",
    ]
    lines += ["|---|---|---|---|---|---|"]
    columns = (
        "design_percent",
        "random_median_percent",
        "random_best_percent",
        "condition_percent",
        "cpu_seconds",
    )
    lines += [
        f"| {row['arm']} | " + " | ".join(f"{row[name]:.3g}" for name in columns) + " |"
        for row in values
    ]
    for wrongly, title in ((False, "true prior"), (True, "masses 20 % wrong")):
        rows = [row for row in rehearsals if row["wrong"] == wrongly]
        if not rows:
            continue
        lines += [
            "",
            f"Error over predicted ±, {title}:",
            "",
            f"| arm | {' | '.join(rows[0]['names'])} | limit used |",
        ]
        lines += ["|---" * (len(rows[0]["names"]) + 2) + "|"]
        for name in dict.fromkeys(row["arm"] for row in rows):
            own = [row for row in rows if row["arm"] == name]
            shown = " | ".join(f"{value:.2f}" for value in ratios(own).values())
            lines.append(f"| {name} | {shown} | {max(row['used'] for row in own):.3f} |")
        pooled = " | ".join(f"{value:.2f}" for value in ratios(rows).values())
        lines.append(f"| all | {pooled} | {max(row['used'] for row in rows):.3f} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
