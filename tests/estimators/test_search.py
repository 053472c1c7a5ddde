"""The search for terms from within: its parabola, its reasons, and its sums against fits made
directly.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from algid.arm import FloatArray
from algid.estimators import weak
from algid.estimators.selection import CHOICE, _lowest, select
from algid.estimators.term_grams import Grams, Training
from algid.estimators.weak import Source, WeakSettings
from algid.model import EVERY_TERM, Model, names_of
from algid.signals.segments import Segment

from .conftest import Bench

SETTINGS = WeakSettings(bandwidth=60.0)


def _rubbing(bench: Bench, coulomb: float, loaded: bool = False) -> Segment:
    log = bench.log(loaded, 1e-4)
    motion = bench.burdened if loaded else bench.bare
    return replace(log, tau=log.tau + coulomb * np.tanh(motion.omega / 0.05))


def test_the_lowest_of_a_parabola_is_its_bottom_and_of_none_the_least_value() -> None:
    x = np.array([-1.0, -0.2, 0.5, 1.7, 2.0])
    assert _lowest(x, list(3 * (x - 0.4) ** 2 + 7)) == pytest.approx(0.4)
    assert _lowest(x, [1.0, 2.0, 3.0, 4.0, 5.0]) == -1.0
    assert _lowest(x, [5.0, 4.0, 3.0, 2.0, 1.0]) == 2.0
    even = np.arange(5.0)
    assert _lowest(even, [9.0, 2.0, 2.0, 9.0, 9.0]) == pytest.approx(1.5)  # of two alike the middle
    assert _lowest(x, [1.0, 1.0, 1.0, 1.0, 1.0]) == -1.0


def test_friction_below_nothing_contradicts_physics(bench: Bench) -> None:
    """Drives that push with the motion are told by the log as surely as friction is.

    They are not taken for it.
    """
    pushed = _rubbing(bench, -0.1)
    chosen = select([lambda: [pushed]], [], SETTINGS, candidates=("coulomb",))
    (trial,) = chosen.trials
    assert (trial.kept, trial.reason) == (False, "left out: its value would contradict physics")
    assert min(trial.evidence, trial.prediction) > 0
    assert chosen.model.terms == ()
    told = select([lambda: [pushed]], [], SETTINGS, candidates=(), kept=("coulomb",))
    assert told.model.terms == ("coulomb",)  # asked for is asked for


def test_a_term_that_needs_another_has_no_meaning_alone(bench: Bench) -> None:
    chosen = select(
        [lambda: [bench.log(sigma=1e-3)]], [], SETTINGS, candidates=("stribeck", "coulomb")
    )
    reasons = {trial.term: trial.reason for trial in chosen.trials}
    assert reasons["stribeck"] == "left out: no meaning without coulomb"
    assert reasons["coulomb"].startswith("left out: ")


def test_a_torque_that_acts_late_or_early_is_a_delay_and_no_lag(bench: Bench) -> None:
    log = bench.log(sigma=1e-4)
    late = replace(log, theta=log.theta[:, :-6], tau=log.tau[:, 6:], omega=None)
    early = replace(log, theta=log.theta[:, 6:], tau=log.tau[:, :-6], omega=None)
    found = {}
    for name, shifted in (("late", late), ("early", early)):
        chosen = select([partial(list, [shifted])], [], SETTINGS, candidates=("delay",))
        found[name] = (
            chosen.delay,
            chosen.model.terms,
            chosen.trials[0].term,
            chosen.trials[0].kept,
        )
    assert found["late"] == (True, (), "delay", True)
    # a lag would lag the more the faster the torque
    assert found["early"] == (
        True,
        (),
        "delay",
        True,
    )


def test_a_joint_without_a_motor_has_no_gain_to_choose(bench: Bench) -> None:
    log = bench.log(sigma=1e-3)
    passive = replace(log, tau=log.tau * np.array([[1.0], [0.0]]))
    chosen = select([lambda: [passive]], [], SETTINGS, candidates=("gain", "rotor"))
    assert [trial.term for trial in chosen.trials] == ["rotor"]
    assert "gain" in CHOICE


def _grams(
    bench: Bench, model: Model, kinds: tuple[bool, ...]
) -> tuple[Grams, dict[bool, FloatArray]]:
    """Gram matrices of all columns, and the coefficients that the weak estimator gives for each
    kind by itself.
    """
    settings = replace(SETTINGS, model=model)
    logs = {kind: _rubbing(bench, 0.1, kind) for kind in kinds}
    training = [Training.of(partial(list, [log]), kind) for kind, log in logs.items()]
    grams = Grams(training, settings, {False: {}, True: {}})
    alone = {}
    for kind, log in logs.items():
        normal = weak.normal_equations(partial(list, [log]), replace(settings, estimate_delay=True))
        assert normal is not None
        alone[kind] = weak.solve([normal])[0]
    return grams, alone


def test_one_kind_of_log_has_the_coefficients_of_its_weak_fit(bench: Bench) -> None:
    model = Model(("coulomb", "offset", "rotor"), coulomb_speed=0.05)
    grams, alone = _grams(bench, model, (False,))
    found = grams.coefficients((*model.terms, "delay"))
    np.testing.assert_allclose(
        [found[False][name] for name in grams.names], alone[False], rtol=1e-5, atol=1e-6
    )
    assert found[True] == found[False]  # of a kind that there is none of
    assert {name: found[False][name] for name in ("f1", "f2")} == pytest.approx(
        {"f1": 0.1, "f2": 0.1}, rel=0.05
    )
    without = grams.coefficients(("offset",))
    assert [without[False][name] for name in ("f1", "f2", "j2", "delay")] == [0.0] * 4


def test_both_kinds_share_friction_and_keep_their_own_inertia(bench: Bench) -> None:
    model = Model(("coulomb",), coulomb_speed=0.05)
    grams, alone = _grams(bench, model, (False, True))
    found = grams.coefficients((*model.terms, "delay"))
    for name in ("k6", "k7", "f1", "f2", "delay"):
        assert found[False][name] == found[True][name]
    for kind in (False, True):
        rigid = [found[kind][name] for name in ("k1", "k2", "k3", "k4", "k5")]
        np.testing.assert_allclose(rigid, alone[kind][:5], rtol=0.02)
    assert found[True]["k4"] - found[False]["k4"] == pytest.approx(
        bench.payload * 9.81 * bench.arm.l1, rel=0.02
    )


def test_a_term_that_is_there_predicts_what_was_left_out_and_is_far_from_nothing(
    bench: Bench,
) -> None:
    """Wald's statistic by the plain covariance is by how much the squares grow where the term
    goes.
    """
    model = Model(("coulomb", "offset"), coulomb_speed=0.05)
    grams, _ = _grams(bench, model, (False,))
    assert grams.held_out == "blocks"
    assert grams.held_out_squares(("coulomb",)) < 0.01 * grams.held_out_squares(())
    assert grams.held_out_squares(("coulomb", "offset")) > 0.9 * grams.held_out_squares(
        ("coulomb",)
    )

    def squares(terms: tuple[str, ...]) -> float:
        asked = set(names_of(EVERY_TERM[term] for term in terms))
        kept = [n for n, name in enumerate(grams.names) if name[0] == "k" or name in asked]
        G = grams._total
        own = G[np.ix_(kept, kept)]
        return float(G[-1, -1] - G[kept, -1] @ np.linalg.solve(own, G[kept, -1]))

    plain = squares(()) - squares(("coulomb",))
    wald, count, stretches = grams.wald(("coulomb",), ("coulomb",))
    assert count == 2
    assert wald <= plain * (1 + 1e-9)  # the smaller of two
    assert wald > 100
    assert 2 < stretches < 60
    nothing, *_ = grams.wald(("offset",), ("coulomb", "offset"))
    assert nothing < 15  # χ² of two degrees: beyond once in 1800


def test_three_logs_of_a_kind_are_left_out_one_by_one(bench: Bench) -> None:
    log = bench.log(sigma=1e-3)
    parts: list[Source] = [
        partial(list, [log.part(first, first + 1300)]) for first in (0, 1300, 2600)
    ]
    chosen = select(parts, [], SETTINGS, candidates=("offset",))
    assert chosen.held_out == "logs"
    assert select(parts[:2], [], SETTINGS, candidates=("offset",)).held_out == "blocks"
