"""Error bars where the evidence that chose the terms was refuted: as wide as if nothing had been left out."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import algid
from algid.estimators import weak
from algid.estimators.diagnostics import joints_apart
from algid.estimators.fit import Fit
from algid.estimators.hedged import hedged
from algid.estimators.weak import WeakSettings
from algid.log import Log
from algid.model import Model
from algid.notices import Notice
from algid.results import Status
from algid.settings import Settings
from algid.synth.sensors import Sensors

from .conftest import Bench

REFUTED = Notice("REFUTED", numbers={"kept": "weak"})
EVERY = WeakSettings(model=Model(("coulomb", "offset", "rotor")), estimate_delay=True)


def _general(fit: Fit, larger: Fit) -> np.ndarray:
    return np.array([larger.std[larger.names.index(name)] for name in fit.names])


def test_no_error_bar_is_narrower_than_with_every_common_term(bench: Bench) -> None:
    log = bench.log(sigma=1e-3)
    fit = replace(weak.fit([lambda: [log]]), notes=(REFUTED,))
    found = hedged(fit, [lambda: [log]], [], WeakSettings())
    larger = weak.fit([lambda: [log]], settings=EVERY)
    np.testing.assert_allclose(found.std, np.maximum(fit.std, _general(fit, larger)), rtol=1e-9)
    assert np.any(found.std > 1.2 * fit.std)  # or the test would not tell
    np.testing.assert_array_equal(found.values, fit.values)
    assert found.quantile == fit.quantile
    size, wide = np.outer(fit.std, fit.std), np.outer(found.std, found.std)
    np.testing.assert_allclose(found.covariance / wide, fit.covariance / size, atol=1e-12)  # correlations stay
    assert [note.code for note in found.notes] == ["REFUTED", "WIDER_MODEL"]
    assert found.notes[1].numbers["terms"] == ["coulomb", "offset", "rotor", "delay"]
    rubbing = WeakSettings(model=Model(("coulomb",)))
    known = hedged(replace(weak.fit([lambda: [log]], settings=rubbing), notes=(REFUTED,)), [lambda: [log]], [], rubbing)
    assert known.notes[1].numbers["terms"] == ["offset", "rotor", "delay"]


def test_a_fit_with_every_term_and_one_of_four_logs_stay_as_they_are(bench: Bench) -> None:
    log = bench.log(sigma=1e-3)
    fit = weak.fit([lambda: [log]], settings=EVERY)
    np.testing.assert_allclose(hedged(fit, [lambda: [log]], [], EVERY).std, fit.std, rtol=1e-12)
    four = [lambda part=part: [log.part(part, part + 1000)] for part in range(0, 4000, 1000)]
    together = weak.fit(four)
    assert hedged(together, four, [], WeakSettings()) is together


def test_what_the_larger_model_leaves_open_keeps_its_error_bar(bench: Bench) -> None:
    rest = bench.log(sigma=1e-3)
    still = replace(rest, theta=np.stack([rest.theta[0], np.full(len(rest), 0.3)]))
    fit = replace(weak.fit([lambda: [still]]), notes=(REFUTED,))
    larger = weak.fit([lambda: [still]], settings=EVERY)
    found = hedged(fit, [lambda: [still]], [], WeakSettings())
    assert "NOT_IDENTIFIABLE" in larger.status
    for place, name in enumerate(fit.names):
        if larger.status[larger.names.index(name)] != "OK":
            assert found.covariance[place, place] == pytest.approx(fit.covariance[place, place])
    assert np.all(np.isfinite(found.covariance))


def _slow_error(log: Log) -> Log:
    t = (log.stamp_ns - log.stamp_ns[0]) * 1e-9
    return replace(log, tau=log.tau + 0.02 * np.sign(np.sin(2 * np.pi * 1.3 * t)), omega=None)


def test_a_refuted_log_is_hedged_where_it_chose_its_terms_itself() -> None:
    log, _ = algid.synthesise("case1", duration=4.0, excitation="wide", sensors=Sensors(1e-4, 1e-3))
    log = _slow_error(log)
    chosen = algid.identify(log, settings=Settings())
    assert chosen.fit is not None
    terms = chosen.fit.model.terms if chosen.fit.model else []
    told = algid.identify(log, settings=Settings(model=",".join(terms) or "plain"))
    own = [name for name in ("k1", "k2", "k3", "k4", "k5") if chosen.parameters[name].status is Status.OK]
    assert own
    stds = np.array([[one.parameters[name].std for name in own] for one in (chosen, told)], dtype=np.float64)
    assert np.all(stds[0] >= stds[1] * (1 - 1e-9))
    assert np.any(stds[0] > 1.05 * stds[1])
    assert "WIDER_MODEL" in [notice.code for notice in chosen.notices]
    assert "WIDER_MODEL" not in [notice.code for notice in told.notices]


def _statuses(fit: Fit) -> dict[str, str]:
    return dict(zip(fit.names, fit.status, strict=True))


@pytest.mark.parametrize("idle", [0, 1])
def test_a_joint_that_is_hardly_driven_is_told_by_the_other(bench: Bench, idle: int) -> None:
    """Of one joint a fiftieth of the torque is left: it tells a fiftieth of each constant, the other the truth."""
    share = np.ones((2, 1))
    share[idle] = 0.02
    log = bench.log(sigma=1e-4)
    normal = weak.normal_equations(lambda: [replace(log, tau=log.tau * share)], WeakSettings())
    assert normal is not None
    names = WeakSettings().model.names
    apart = joints_apart([normal], Model())
    assert apart is not None
    truth = dict(zip(names, bench.truth[:7], strict=True))
    np.testing.assert_allclose([apart.first, apart.second], truth[apart.name] * share[:, 0], rtol=0.02)
    sound = weak.normal_equations(lambda: [log], WeakSettings())
    assert sound is not None
    assert joints_apart([sound], Model()) is None


def test_constants_that_the_joints_contradict_are_not_ok(bench: Bench) -> None:
    log = bench.log(sigma=1e-4)
    idle = replace(log, tau=log.tau * np.array([[1.0], [0.02]]))
    fit = replace(weak.fit([lambda: [idle]]), notes=(REFUTED,))
    found = hedged(fit, [lambda: [idle]], [], WeakSettings())
    assert _statuses(fit) == dict.fromkeys(fit.names, "OK")
    assert _statuses(found) == {name: "OK" if name in ("k6", "k7") else "WEAK_EXCITATION" for name in fit.names}
    (doubt,) = (note for note in found.notes if note.code == "JOINTS_CONTRADICT")
    assert re.match(r"joint 1 by itself tells k\d as [\d.]+ \S.* and joint 2 as .*: one of them is hardly", doubt.text)
    np.testing.assert_array_equal(found.values, fit.values)


def test_a_loaded_log_is_held_against_itself(bench: Bench) -> None:
    """The joints of the loaded log agree about the loaded arm: that the arm alone differs is no contradiction."""
    bare, burdened = bench.log(sigma=1e-4), bench.log(True, 1e-4)
    sources = [lambda: [bare]], [lambda: [burdened]]
    assert set(hedged(weak.fit(*sources), *sources, WeakSettings()).status) == {"OK"}
    idle = replace(burdened, tau=burdened.tau * np.array([[0.02], [1.0]]))
    wrong = [lambda: [bare]], [lambda: [idle]]
    assert "WEAK_EXCITATION" in hedged(weak.fit(*wrong), *wrong, WeakSettings()).status


def test_a_refuted_log_in_which_a_joint_stood_still_is_not_ok(bench: Bench) -> None:
    log = bench.log(sigma=1e-4)
    tremble = 1e-3 * np.sin(40 * log.t)  # backlash, say: told well enough to be determined
    still = replace(log, theta=np.stack([log.theta[0], 0.3 + tremble]))
    fit = weak.fit([lambda: [still]])
    found = hedged(fit, [lambda: [still]], [], WeakSettings())
    assert "joint 2 never moved: give a log in which both joints do" in [note.text for note in found.notes]
    assert not [
        name for name, word in _statuses(found).items() if name in ("k1", "k2", "k3", "k4", "k5") and word == "OK"
    ]
    with_motion = hedged(weak.fit([lambda: [log]]), [lambda: [log]], [], WeakSettings())
    assert with_motion.notes == ()
