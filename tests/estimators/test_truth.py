"""Every kind of estimate, alone and together with the others, against a simulated arm with drives.

The arms move side by side by `pipelines.simulator`, which shares no equation with algid.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import pytest

from algid.arm import with_payload
from algid.estimators import instruments, refined, weak
from algid.estimators.fit import Fit
from algid.estimators.problem import WeakSettings
from algid.model import TERMS as MODEL_TERMS
from algid.model import Model
from algid.signals.segments import Segment
from algid.signals.shift import TorqueShift
from algid.synth.cases import load_case
from algid.synth.excitation import wide_multi_sine
from pipelines.simulator import Arms, swung
from tests.estimators.conftest import problem_of

DT, DURATION, SUBSTEPS = 2e-3, 5.0, 2
TERMS = ("", "delay", "hold", "offset", "coulomb", "rotor", "delay hold offset coulomb rotor")
TRUE = {"f1": 0.15, "f2": 0.08, "o1": 0.05, "o2": -0.03, "j2": 0.01, "delay": 7.5 * DT}
SIGMA = 1e-4  # rad; ten times as much in N m


@dataclass(frozen=True)
class Case:
    """What a log's arm and sensors have beside eq. (1), and its angles and torques (2, N) without
    noise.
    """

    terms: str
    theta: np.ndarray
    tau: np.ndarray

    def log(self, seed: int) -> Segment:
        noise = np.random.default_rng(seed).standard_normal((2, *self.theta.shape)) * SIGMA
        return Segment(0.0, DT, self.theta + noise[0], self.tau + 10 * noise[1])


def _true(name: str, terms: str) -> float:
    kind = {"f": "coulomb", "o": "offset", "j": "rotor", "d": "delay"}[name[0]]
    return TRUE[name] if kind in terms else 0.0


@pytest.fixture(scope="module")
def cases() -> dict[tuple[str, bool], Case]:
    """Logs by terms and whether a payload is carried, integrated side by side."""
    jobs = [(terms, loaded) for terms in TERMS for loaded in (False, True)]
    case = load_case("case1")
    k = case.arm.constants()
    loaded_k = with_payload(k, case.arm.payload_constants(case.payload))
    constants = np.array([loaded_k if loaded else k for _, loaded in jobs]).T
    f1, f2, o1, o2, j2 = (
        np.array([_true(name, terms) for terms, _ in jobs])
        for name in ("f1", "f2", "o1", "o2", "j2")
    )
    arms = Arms(constants, coulomb=np.stack([f1, f2]), width=0.2, rotor=np.stack([0 * j2, j2]))
    torque = wide_multi_sine(case.arm, 5)
    count, h = round(DURATION / DT), DT / SUBSTEPS
    # the torque at the start, middle and end of each step: smooth, or held since the sample before
    steps = np.arange(count * SUBSTEPS)[:, None] * h + np.array([0, 0.5, 1]) * h
    applied = np.empty((len(steps), 3, 2, len(jobs)))
    for place, (terms, _) in enumerate(jobs):
        at = steps - _true("delay", terms)
        if "hold" in terms:
            at = np.repeat(np.floor(at[:, 1:2] / DT + 1e-9) * DT, 3, axis=1)
        applied[..., place] = torque(at.ravel()).reshape(2, *at.shape).transpose(1, 2, 0)
    applied -= np.stack([o1, o2])
    now = 0

    def begin(half: int, _: np.ndarray) -> None:
        nonlocal now
        now = half // 2

    def acting(half: int, _: np.ndarray) -> np.ndarray:
        return np.asarray(applied[now, half - 2 * now])

    states, _ = swung(
        lambda half, x: arms.rate(x, acting(half, x)),
        acting,
        arms.hanging(),
        len(steps),
        h,
        sampled=begin,
    )
    tau = torque(np.arange(count) * DT)
    theta = states[::SUBSTEPS, :2]
    return {job: Case(job[0], theta[..., place].T, tau) for place, job in enumerate(jobs)}


def _fit(estimator: str, terms: str, *unloaded: Segment, loaded: Sequence[Segment] = ()) -> Fit:
    model = Model(tuple(term for term in terms.split() if term in MODEL_TERMS))
    hold: Literal["foh", "zoh"] = "zoh" if "hold" in terms else "foh"
    delay = "delay" in terms
    settings = WeakSettings(model, shift=TorqueShift(hold == "zoh"), estimate_delay=delay)
    known = problem_of(*unloaded, loaded=loaded, settings=settings)
    if estimator != "refined":
        return (weak if estimator == "weak" else instruments).fit(known)
    return refined.fit(known)


def _truth(fit: Fit) -> np.ndarray:
    case = load_case("case1")
    arm = dict(zip(("k1", "k2", "k3", "k4", "k5", "k6", "k7"), case.arm.constants(), strict=True))
    known = {**TRUE, **arm, "m_p": case.payload, "l1": case.arm.l1, "l2": case.arm.l2}
    return np.array([known[name] for name in fit.names])


@pytest.mark.parametrize("payload", [False, True])
@pytest.mark.parametrize("terms", TERMS)
@pytest.mark.parametrize("estimator", ["weak", "instruments", "refined"])
def test_every_kind_of_estimate_is_the_truth_within_its_error(
    cases: dict[tuple[str, bool], Case], estimator: str, terms: str, payload: bool
) -> None:
    logs = [cases[terms, False].log(seed) for seed in (1, 2)]
    fit = _fit(estimator, terms, *logs, loaded=[cases[terms, True].log(3)] * payload)
    assert fit.estimator == estimator
    assert set(fit.status) == {"OK"}
    truth = _truth(fit)
    # 20 parameters at most, of Student's t with 100 degrees or more: beyond 5 σ once in 30,000
    # such fits
    assert np.all(np.abs(fit.values - truth) < 5 * fit.std)
    assert np.all(fit.std < 0.05 * np.abs(truth))  # an error bar that says something


@pytest.mark.parametrize("estimator", ["weak", "refined"])
@pytest.mark.parametrize("samples", [10, 25])
def test_long_delays_are_found_by_both_estimators(
    cases: dict[tuple[str, bool], Case], estimator: str, samples: int
) -> None:
    log = cases["", False].log(1)
    late = replace(log, theta=log.theta[:, :-samples], tau=log.tau[:, samples:])  # 20 and 50 ms
    fit = _fit(estimator, "delay", late)
    assert fit.estimator == estimator
    assert abs(fit.values[-1] - samples * DT) < 5 * fit.std[-1]


def _arrays(thing: object) -> Iterator[np.ndarray]:
    for value in vars(thing).values():
        for item in value if isinstance(value, tuple) else (value,):
            if isinstance(item, np.ndarray):
                yield item
            elif hasattr(item, "__dict__") and type(item).__module__.startswith("algid.estimators"):
                yield from _arrays(item)


def test_nothing_that_a_fit_hands_out_can_be_written_to(
    cases: dict[tuple[str, bool], Case],
) -> None:
    log = cases["", False].log(1)
    for estimator in ("weak", "refined"):
        found = list(_arrays(_fit(estimator, "delay", log)))
        assert len(found) >= 6  # values, covariance, travel; the log's c0, S, g
        assert not any(array.flags.writeable for array in found)
    assert not any(array.flags.writeable for array in (log.theta, log.tau, log.part(0, 9).theta))
