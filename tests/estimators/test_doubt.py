"""Constants of which no error bar stands: a joint stood still, or the joints contradict each
other.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from algid.estimators import doubt, weak
from algid.estimators.diagnostics import joints_apart
from algid.estimators.doubt import doubted
from algid.estimators.fit import Fit
from algid.estimators.weak import WeakSettings
from algid.model import Model
from algid.notices import Notice

from .conftest import Bench

REFUTED = Notice("REFUTED", numbers={"kept": "weak"})


def _statuses(fit: Fit) -> dict[str, str]:
    return dict(zip(fit.names, fit.status, strict=True))


@pytest.mark.parametrize("idle", [0, 1])
def test_a_joint_that_is_hardly_driven_is_told_by_the_other(bench: Bench, idle: int) -> None:
    """Of one joint a fiftieth of the torque is left: it tells a fiftieth of each constant, the
    other the truth.
    """
    share = np.ones((2, 1))
    share[idle] = 0.02
    log = bench.log(sigma=1e-4)
    normal = weak.normal_equations(lambda: [replace(log, tau=log.tau * share)], WeakSettings())
    assert normal is not None
    names = WeakSettings().model.names
    apart = joints_apart([normal], Model())
    assert apart is not None
    truth = dict(zip(names, bench.truth[:7], strict=True))
    np.testing.assert_allclose(
        [apart.first, apart.second], truth[apart.name] * share[:, 0], rtol=0.02
    )
    sound = weak.normal_equations(lambda: [log], WeakSettings())
    assert sound is not None
    assert joints_apart([sound], Model()) is None


def test_constants_that_the_joints_contradict_are_not_ok(bench: Bench) -> None:
    log = bench.log(sigma=1e-4)
    idle = replace(log, tau=log.tau * np.array([[1.0], [0.02]]))
    fit = replace(weak.fit([lambda: [idle]]), notes=(REFUTED,))
    found = doubted(fit, [lambda: [idle]], [], WeakSettings())
    assert _statuses(fit) == dict.fromkeys(fit.names, "OK")
    assert _statuses(found) == {
        name: "OK" if name in ("k6", "k7") else "WEAK_EXCITATION" for name in fit.names
    }
    (contradiction,) = (note for note in found.notes if note.code == "JOINTS_CONTRADICT")
    assert re.match(
        r"k\d is [\d.]+ \S.* from joint 1's equation alone and .* from joint 2's: one of them is",
        contradiction.text,
    )
    np.testing.assert_array_equal(found.values, fit.values)


@pytest.mark.parametrize(("share", "told"), [(0.02, True), (0.5, False)])
def test_a_joint_that_is_driven_in_no_log_is_told_where_the_other_does_not_contradict(
    bench: Bench, share: float, told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(doubt, "joints_apart", lambda *_: None)
    log = bench.log(sigma=1e-4)
    idle = replace(log, tau=log.tau * np.array([[1.0], [share]]))
    fit = replace(weak.fit([lambda: [idle]]), notes=(REFUTED,))
    notes = doubted(fit, [lambda: [idle]], [], WeakSettings()).notes[1:]
    assert [note.code for note in notes] == ["HARDLY_DRIVEN"] * told
    assert all("joint 2 has less than 10 % of the other's torque" in note.text for note in notes)


def test_a_loaded_log_is_held_against_itself(bench: Bench) -> None:
    """The joints of the loaded log agree about the loaded arm: that the arm alone differs is no
    contradiction.
    """
    bare, burdened = bench.log(sigma=1e-4), bench.log(True, 1e-4)
    sources = [lambda: [bare]], [lambda: [burdened]]
    assert set(doubted(weak.fit(*sources), *sources, WeakSettings()).status) == {"OK"}
    idle = replace(burdened, tau=burdened.tau * np.array([[0.02], [1.0]]))
    wrong = [lambda: [bare]], [lambda: [idle]]
    assert "WEAK_EXCITATION" in doubted(weak.fit(*wrong), *wrong, WeakSettings()).status


def test_a_refuted_log_in_which_a_joint_stood_still_is_not_ok(bench: Bench) -> None:
    log = bench.log(sigma=1e-4)
    tremble = 1e-3 * np.sin(40 * log.t)  # backlash, say: told well enough to be determined
    still = replace(log, theta=np.stack([log.theta[0], 0.3 + tremble]))
    fit = weak.fit([lambda: [still]])
    found = doubted(fit, [lambda: [still]], [], WeakSettings())
    assert "joint 2 never moved: give a log in which both joints do" in [
        note.text for note in found.notes
    ]
    assert not [
        name
        for name, word in _statuses(found).items()
        if name in ("k1", "k2", "k3", "k4", "k5") and word == "OK"
    ]
    with_motion = doubted(weak.fit([lambda: [log]]), [lambda: [log]], [], WeakSettings())
    assert with_motion.notes == ()
