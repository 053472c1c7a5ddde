"""Two short motions of the paper's first case, without and with its payload, shared by the
estimators' tests.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pytest

from algid.arm import Arm, FloatArray
from algid.estimators.problem import Problem, Source
from algid.signals.segments import Segment
from algid.synth.cases import load_case
from algid.synth.excitation import wide_multi_sine
from algid.synth.simulator import SimulatedMotion, simulate

DT = 1e-3


@dataclass(frozen=True, eq=False)
class Bench:
    """The arm, its payload in kg and the exact motions."""

    arm: Arm
    payload: float
    bare: SimulatedMotion
    burdened: SimulatedMotion

    @property
    def truth(self) -> FloatArray:
        """k1 … k7, m_p, l1, l2."""
        return np.concatenate([self.arm.constants(), [self.payload, self.arm.l1, self.arm.l2]])

    def log(self, loaded: bool = False, sigma: float = 0.0, seed: int = 0) -> Segment:
        """A log with noise of `sigma` rad on the angles and 10 `sigma` N m on the torques."""
        rng = np.random.default_rng([seed, loaded])
        motion = self.burdened if loaded else self.bare
        theta = motion.theta + sigma * rng.standard_normal(motion.theta.shape)
        tau = motion.tau + 10 * sigma * rng.standard_normal(motion.tau.shape)
        return Segment(0.0, DT, theta, tau, motion.omega)


def problem_of(*unloaded: Segment, loaded: Sequence[Segment] = (), **known: Any) -> Problem:
    """Logs of a segment each, and what is known of them."""

    def sources(logs: Sequence[Segment]) -> list[Source]:
        return [partial(list, [log]) for log in logs]

    return Problem(sources(unloaded), sources(loaded), **known)


@pytest.fixture(scope="session")
def bench() -> Bench:
    case = load_case("case1")
    k = case.arm.constants()
    loaded = case.arm.constants(case.payload)
    t = np.arange(4001) * DT
    return Bench(
        case.arm,
        case.payload,
        simulate(k, wide_multi_sine(case.arm, 3), t),
        simulate(loaded, wide_multi_sine(case.arm, 4), t),
    )
