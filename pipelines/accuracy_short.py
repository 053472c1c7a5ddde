"""Where error bars are hardest to keep: short logs, slow held torques, terms that are not there.

    python -m pipelines.accuracy_short --draws 20

Both cases and three random arms without any error but white noise. Coverage counts the 95 %
intervals of k1 … k7 that hold the truth; asked are 92 % or more. With no flag the logs choose the
terms, so that intervals are those after selection; a term that is kept is a false one.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from algid.arm import CONSTANT_NAMES, FloatArray
from algid.estimators import refined, shrunk
from algid.estimators.fit import Fit
from algid.estimators.selection import Selection, select
from algid.estimators.weak import Source, WeakSettings
from algid.identification.model_choice import without_nothing
from algid.model import Model
from algid.settings import Settings
from algid.signals.segments import Segment
from algid.signals.shift import TorqueShift
from algid.synth.excitation import Hold, SampledTorque, wide_multi_sine
from algid.synth.simulator import simulate
from pipelines.accuracy_scenes import case_of

ARMS = ("case1", "case2", "arm1", "arm2", "arm3")
SIGMA_THETA, SIGMA_TAU = 1e-3, 1e-2  # rad, N m
ASKED = 92.0  # %
Row = dict[str, Any]


@dataclass(frozen=True)
class Kind:
    """A row: duration in s, rate in Hz, hold, terms that are given (None: the logs choose),
    constants that count.
    """

    duration: float
    rate: float = 1000.0
    hold: Hold = "foh"
    terms: tuple[str, ...] | None = None
    counted: tuple[str, ...] = CONSTANT_NAMES


KINDS = {
    "1 s": Kind(1.0),
    "2 s": Kind(2.0),
    "10 s": Kind(10.0),
    "10 s, torque held at 100 Hz": Kind(10.0, 100.0, "zoh"),
    "5 s, Coulomb friction in the model, k6 and k7": Kind(
        5.0, terms=("coulomb",), counted=("k6", "k7")
    ),
}


@cache
def _moved(name: str, kind: Kind, seed: int) -> tuple[FloatArray, Segment]:
    """Constants (7,), and the log without noise."""
    arm = case_of(name).arm
    k = arm.constants()
    t = np.arange(round(kind.duration * kind.rate) + 1) / kind.rate
    wide = wide_multi_sine(arm, seed)
    motion = simulate(k, SampledTorque(t, wide(t), "zoh") if kind.hold == "zoh" else wide, t)
    return k, Segment(0.0, 1 / kind.rate, motion.theta, wide(t))


def draw(job: tuple[str, str, int]) -> tuple[list[bool], tuple[str, ...], str]:
    """Which intervals hold the truth, the terms that were kept, and the estimator handed back."""
    name, what, seed = job
    kind = KINDS[what]
    k, exact = _moved(name, kind, sum(name.encode()))
    rng = np.random.default_rng([seed, sum(job[1].encode()), sum(name.encode())])
    theta, tau = (rng.standard_normal(exact.theta.shape) for _ in range(2))
    log = replace(exact, theta=exact.theta + SIGMA_THETA * theta, tau=exact.tau + SIGMA_TAU * tau)
    fit, chosen = _fitted([lambda: [log]], kind)
    places = [CONSTANT_NAMES.index(name) for name in kind.counted]
    inside = np.abs(fit.values[:7] - k)[places] <= (fit.quantile * fit.std[:7])[places]
    return (
        inside.tolist(),
        (*chosen.model.terms, *(("delay",) if chosen.delay else ())),
        fit.estimator,
    )


def _fitted(sources: Sequence[Source], kind: Kind) -> tuple[Fit, Selection]:
    weak = WeakSettings(bandwidth=60.0, shift=TorqueShift(kind.hold == "zoh"))
    if kind.terms is not None:
        return _refined(sources, Selection(Model(kind.terms), delay=False), weak)
    fit, chosen = _refined(sources, select(sources, (), weak), weak)
    fewer = without_nothing(chosen, fit, Settings())
    if fewer != chosen:
        fit, chosen = _refined(sources, fewer, weak)
    return shrunk.fit(
        sources, settings=replace(weak, model=chosen.shapes or chosen.model)
    ) if fit.refuted else fit, chosen


def _refined(
    sources: Sequence[Source], chosen: Selection, weak: WeakSettings
) -> tuple[Fit, Selection]:
    weak = replace(weak, model=chosen.model, estimate_delay=chosen.delay)
    return refined.fit(sources, settings=weak), chosen


def evaluate(draws: int, kinds: Iterable[str] = KINDS) -> list[Row]:
    """Coverage of each row, and of those that choose the share of draws with a false term."""
    rows: list[Row] = []
    with ProcessPoolExecutor(2) as pool:
        for what in kinds:
            found = list(
                pool.map(
                    draw, [(arm, what, seed) for arm in ARMS for seed in range(draws)], chunksize=4
                )
            )
            coverage = 100 * float(np.mean([one for inside, _, _ in found for one in inside]))
            rows.append({"what": f"{what}: coverage, %", "value": coverage, "asked": ASKED})
            if KINDS[what].terms is None:
                false = 100 * float(np.mean([bool(terms) for _, terms, _ in found]))
                rows.append(
                    {"what": f"{what}: draws with a false term, %", "value": false, "asked": None}
                )
            handed = 100 * float(np.mean([estimator != "refined" for _, _, estimator in found]))
            rows.append({"what": f"{what}: handed over, %", "value": handed, "asked": None})
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, default=Path("build/accuracy"))
    parser.add_argument("--draws", type=int, default=40)
    parser.add_argument(
        "--kind", action="append", choices=list(KINDS), help="only this row, or these"
    )
    given = parser.parse_args()
    rows = evaluate(given.draws, given.kind or KINDS)
    given.output.mkdir(parents=True, exist_ok=True)
    (given.output / "short.json").write_text(json.dumps(rows, indent=1))
    for row in rows:
        print(
            f"{row['what']}: {row['value']:.3g}"
            + (f" (asked {row['asked']:g})" if row["asked"] else "")
        )


if __name__ == "__main__":
    main()
