"""Instruments against least squares where an unmodelled torque drives the motion, and where none does."""

from __future__ import annotations

from functools import partial

import numpy as np

from algid.estimators import instruments, refined, weak
from algid.estimators.refined import RefinedSettings
from algid.estimators.weak import Source, WeakSettings
from pipelines.accuracy_scenes import random_arm
from pipelines.disturbance import logs

from .conftest import Bench


def test_instruments_undo_most_of_what_a_disturbance_does() -> None:
    arm = random_arm(1)[0]
    sources: list[Source] = [partial(list, [log]) for log in logs(arm, 3, 21)]
    least = weak.fit(sources)
    found = instruments.fit(sources, start=least)
    assert found.estimator == "instruments"
    truth = arm.constants()
    inertias = [0, 2, 4]
    bias = (least.values / truth - 1)[inertias]
    assert np.all(bias < -0.05)  # attenuated
    assert np.all(np.abs(found.values / truth - 1)[inertias] < 0.6 * np.abs(bias))
    apart = instruments.endogeneity(sources, [], WeakSettings(), least)
    assert apart is not None
    assert apart > instruments.ENDOGENEOUS


def test_without_a_disturbance_both_agree(bench: Bench) -> None:
    sources: list[Source] = [partial(list, [bench.log(sigma=1e-3, seed=seed)]) for seed in range(2)]
    apart = instruments.endogeneity(sources, [], WeakSettings(), weak.fit(sources))
    assert apart is not None
    assert apart < instruments.ENDOGENEOUS


def test_a_payload_of_nothing_has_its_error_bar_where_lengths_are_known(bench: Bench) -> None:
    lengths = {"l1": bench.arm.l1, "l2": bench.arm.l2}
    unloaded: list[Source] = [partial(list, [bench.log(sigma=1e-3, seed=1)])]
    loaded: list[Source] = [partial(list, [bench.log(sigma=1e-3, seed=2)])]
    for fit in (
        weak.fit(unloaded, loaded, lengths=lengths),
        refined.fit(unloaded, loaded, RefinedSettings(lengths=lengths)),
    ):
        place = fit.names.index("m_p")
        assert fit.status[place] == "OK"
        assert abs(fit.values[place]) < 4 * fit.std[place]
        assert fit.std[place] < 0.02 * bench.payload
