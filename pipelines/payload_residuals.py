"""Payloads weighed on the residuals of real arms: is none found none, and are injected ones inside
their intervals?

    python -m pipelines.payload_residuals ../shared/data --draws 100

A log of a real arm keeps its angles; its torque is made anew: what the model that its logs chose
gives for that motion, with a payload's share where there is one, and the real residual, resampled
in blocks of `BLOCK` s from all the arm's logs (Künsch 1989). Each draw has as many unloaded as
loaded logs, its own blocks in each, and is identified with no flag but the link lengths. Asked:
without a payload |m_p| ≤ 2 σ in 93 % or more, and payloads inside their 95 % intervals in 90 to 98
%.

Of the double pendulum each draw takes four runs at random, two of each kind; of the industrial
arm, of which there are two logs with one joint moving in each, both for both kinds.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from algid.arm import FloatArray
from algid.estimators import weak
from algid.estimators.parametrisation import Shared
from algid.estimators.prediction import PredictionFilter, motion_of
from algid.estimators.selection import select
from algid.estimators.weak import Source, WeakSettings
from algid.identification.by_likelihood import run_fit
from algid.identification.model_choice import choose_model
from algid.identification.source import LogSource, open_sources
from algid.identification.survey import Survey
from algid.log import Log, Origin
from algid.model import torque
from algid.notices import Notice
from algid.readers import open_log
from algid.runtime import one_blas_thread
from algid.settings import Settings
from algid.signals.filters import butterworth
from algid.signals.segments import Segment, segments
from pipelines.accuracy_dfki import run

BLOCK = 1.0  # s
INJECTED = (0.05, 0.1, 0.2, 0.5, 1.0)
"""Payloads over the mass at the tip that the arm's own weight is worth."""
Row = dict[str, Any]


@dataclass(frozen=True, eq=False)
class RealArm:
    """Logs of one arm, and by log what its model explains of the torque (2, N) and the rest.

    `slopes` are the torques (2, N) that a payload of 1 kg adds; `lengths` of the links in m;
    `mass` in kg is that at the tip which weighs as much as the arm; `taken` of the logs make a
    draw.
    """

    name: str
    logs: tuple[Segment, ...]
    explained: tuple[FloatArray, ...]
    residuals: tuple[FloatArray, ...]
    slopes: tuple[FloatArray, ...]
    lengths: tuple[float, float]
    mass: float
    taken: int


@cache
def arms(folder: Path) -> tuple[RealArm, ...]:
    """The double pendulum of the DFKI and two joints of a Kinova Gen3."""
    runs = tuple(run(path) for path in sorted((folder / "dfki" / "C1_sysid").glob("*.csv")))
    kinova = tuple(_even(path) for path in sorted((folder / "kinova_gen3").glob("joint_*.csv")))
    return _explained("dfki", runs, (0.2, 0.3), 4), _explained("kinova", kinova, (0.42, 0.314), 2)


def _even(path: Path) -> Segment:
    return max(segments([open_log(path).whole()]), key=len)


def _explained(
    name: str, logs: tuple[Segment, ...], lengths: tuple[float, float], taken: int
) -> RealArm:
    sources: list[Source] = [lambda log=log: [log] for log in logs]  # type: ignore[misc]
    settings = WeakSettings(bandwidth=60.0)
    model = select(sources, (), settings).model
    fit = weak.fit(sources, settings=replace(settings, model=model))
    by = PredictionFilter()
    motions = [
        motion_of(butterworth(log.theta, log.dt, by.motion, by.order), log.dt) for log in logs
    ]
    explained = tuple(torque(model, fit.values, motion) for motion in motions)
    shared = Shared(model, payload=True, lengths={"l1": lengths[0], "l2": lengths[1]})
    loaded = shared.coefficients(np.append(fit.values, 1.0), loaded=True) - fit.values
    slopes = tuple(
        torque(model, fit.values + loaded, motion) - tau
        for motion, tau in zip(motions, explained, strict=True)
    )
    cut = [round(by.dropped / log.dt) for log in logs]
    residuals = tuple(
        (log.tau - tau)[:, edge:-edge] for log, tau, edge in zip(logs, explained, cut, strict=True)
    )
    value = dict(zip(fit.names, fit.values, strict=True))
    mass = max(value["k4"] / lengths[0], value["k2"] / lengths[1]) / model.gravity
    return RealArm(name, logs, explained, residuals, slopes, lengths, float(mass), taken)


def drawn(arm: RealArm, place: int, payload: float, rng: np.random.Generator) -> Log:
    """One log with its torque made anew: see the module's text."""
    log = arm.logs[place]
    tau = (
        arm.explained[place] + payload * arm.slopes[place] + _resampled(arm, len(log), log.dt, rng)
    )
    stamps = np.round(np.arange(len(log)) * log.dt * 1e9).astype(np.int64)
    return Log(stamps, log.theta, tau, Origin(f"{arm.name}-{place}", "csv", {}))


def _resampled(arm: RealArm, length: int, dt: float, rng: np.random.Generator) -> FloatArray:
    block = round(BLOCK / dt)
    parts = []
    for _ in range(-(-length // block)):
        pool = arm.residuals[rng.choice(len(arm.residuals), p=_shares(arm))]
        first = int(rng.integers(pool.shape[1] - block + 1))
        parts.append(pool[:, first : first + block])
    return np.concatenate(parts, axis=1)[:, :length]


def _shares(arm: RealArm) -> FloatArray:
    sizes = np.array([residual.shape[1] for residual in arm.residuals], dtype=np.float64)
    return sizes / sizes.sum()


def weighed(job: tuple[Path, str, int, float]) -> tuple[float, float, float]:
    """Error of m_p, its standard deviation and half its interval, in kg."""
    folder, name, seed, share = job
    arm = next(one for one in arms(folder) if one.name == name)
    rng = np.random.default_rng([seed, round(1e3 * share)])
    mass = share * arm.mass
    places = rng.permutation(len(arm.logs))[: arm.taken]
    half = arm.taken // 2
    kinds = (places[:half], places[half:]) if len(arm.logs) >= arm.taken > 2 else (places, places)
    unloaded, loaded = (
        [drawn(arm, int(place), payload, rng) for place in kind]
        for kind, payload in zip(kinds, (0.0, mass), strict=True)
    )
    settings = Settings(l1=arm.lengths[0], l2=arm.lengths[1])
    sources = [
        *open_sources(unloaded, "unloaded", None, 9.81),
        *open_sources(loaded, "loaded", None, 9.81),
    ]
    survey = _Unexamined(sources)
    with one_blas_thread():
        fit, _, _ = run_fit(survey, settings, choose_model(survey, settings), None)
    place = fit.names.index("m_p")
    return (
        float(fit.values[place]) - mass,
        float(fit.std[place]),
        float(fit.quantile * fit.std[place]),
    )


class _Unexamined(Survey):
    """Logs without the named checks: signs and zeros of these are known, and the checks take half
    of the time.
    """

    def _checked(
        self,
        log: LogSource,  # noqa: ARG002
        begin: Log,  # noqa: ARG002
        *,
        whole: bool,  # noqa: ARG002
    ) -> tuple[Notice, ...]:
        return ()


def evaluate(folder: Path, draws: int, names: Sequence[str] = ("dfki", "kinova")) -> list[Row]:
    """A row an arm without payload, and one with payloads."""
    rows: list[Row] = []
    for name in names:
        jobs = [
            (folder, name, seed, share)
            for seed in range(draws)
            for share in (0.0, INJECTED[seed % len(INJECTED)])
        ]
        with ProcessPoolExecutor(2) as pool:
            found = np.array(list(pool.map(weighed, jobs)))
        none, some = found[::2], found[1::2]
        finite = 100 * float(np.mean(np.isfinite(found[:, 1])))
        near = 100 * float(np.mean(np.abs(none[:, 0]) <= 2 * none[:, 1]))
        inside = 100 * float(np.mean(np.abs(some[:, 0]) <= some[:, 2]))
        rows += [
            {"what": f"{name}: payload told as a number, %", "value": finite, "asked": 100.0},
            {
                "what": f"{name}: without payload |m_p| within 2 σ, % (93 or more)",
                "value": near,
                "asked": 93.0,
            },
            {
                "what": f"{name}: injected payloads inside, % (90 to 98)",
                "value": inside,
                "asked": 90.0,
            },
            {
                "what": f"{name}: median σ of m_p, kg",
                "value": float(np.median(found[:, 1])),
                "asked": None,
            },
        ]
    return rows


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--draws", type=int, default=100)
    parser.add_argument("--arm", action="append", choices=("dfki", "kinova"), help="only this arm")
    given = parser.parse_args()
    for row in evaluate(given.folder, given.draws, given.arm or ("dfki", "kinova")):
        print(f"{row['what']}: {row['value']:.3g}")


if __name__ == "__main__":
    main()
