"""The terms of the torque that logs choose."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import pytest

from algid.estimators.selection import CHOICE, Selection, _Search, needs_shape, select
from algid.estimators.weak import WeakSettings
from algid.model import EVERY_TERM, TERMS, Model
from tests.estimators.conftest import Bench
from tests.estimators.test_terms import term_log, term_values

SETTINGS = WeakSettings(bandwidth=60.0)


def _chosen(bench: Bench, terms: tuple[str, ...], **asked: object) -> Selection:
    model = Model(terms, coulomb_speed=0.05)
    values = term_values(bench, terms)
    logs = [term_log(bench, model, values, loaded) for loaded in (False, True)]
    unloaded, loaded = ([lambda one=one: [one]] for one in logs)
    return select(unloaded, loaded, SETTINGS, **asked)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "terms",
    [(), ("coulomb",), ("offset", "rotor"), ("load",), ("gain",), ("phases",), ("lag",)],
    ids="+".join,
)
def test_the_terms_that_are_there_are_chosen_and_no_other(
    bench: Bench, terms: tuple[str, ...]
) -> None:
    chosen = _chosen(bench, terms)
    assert chosen.model.terms == terms
    assert not chosen.delay
    assert chosen.chosen_by == "logs"
    assert chosen.held_out == "blocks"
    assert {trial.term for trial in chosen.trials if trial.kept} == set(terms)
    assert all(trial.prediction > 0 and trial.evidence > 0 for trial in chosen.trials if trial.kept)
    assert len(chosen.trials) == len(CHOICE)


@pytest.mark.parametrize(("share", "found"), [(1e-4, False), (0.1, True)])
@pytest.mark.parametrize("term", ["rotor", "offset"])
def test_a_term_below_the_sampling_error_of_a_log_without_noise_is_left_out(
    bench: Bench, term: str, share: float, found: bool
) -> None:
    """A hundredth of a period in the stamps makes more of the torque than such a term."""
    model = Model((term,))
    values = term_values(bench, (term,))
    values |= {name: share * values[name] for name in EVERY_TERM[term].names}
    log = term_log(bench, model, values, noise=0.0)
    chosen = select([lambda: [log]], [], SETTINGS, candidates=("rotor", "offset", "gain"))
    assert chosen.model.terms == ((term,) if found else ())
    if not found:
        reasons = {trial.term: trial.reason for trial in chosen.trials}
        assert reasons[term] == "left out: explains less than sampling leaves open"


def test_the_width_of_friction_is_found(bench: Bench) -> None:
    chosen = _chosen(bench, ("coulomb",), candidates=(), kept=("coulomb",))
    assert chosen.chosen_by == "settings"
    assert chosen.model.terms == ("coulomb",)
    # velocities are smoothed: a widest guess
    assert chosen.model.coulomb_speed == pytest.approx(0.05, rel=0.5)


def test_what_was_asked_for_and_what_was_not_is_said_term_by_term(bench: Bench) -> None:
    chosen = _chosen(
        bench, ("coulomb",), candidates=("coulomb", "stribeck", "offset"), kept=("coulomb",)
    )
    trials = {trial.term: trial for trial in chosen.trials}
    assert {term: trial.kept for term, trial in trials.items()} == {
        "coulomb": True,
        "stribeck": False,
        "offset": False,
    }
    assert trials["coulomb"].reason == "asked for"
    assert min(trials["coulomb"].prediction, trials["coulomb"].evidence) > 0
    assert all(
        trial.reason.startswith("left out: ") for term, trial in trials.items() if term != "coulomb"
    )


def test_terms_with_a_shape_are_those_of_friction() -> None:
    assert {term for term in TERMS if needs_shape([term])} == {
        "coulomb",
        "stribeck",
        "asymmetry",
        "load",
    }


def test_logs_too_short_for_a_window_are_refused() -> None:
    with pytest.raises(ValueError, match="no log is long enough"):
        select([list], [], SETTINGS)


class _Told(_Search):
    """A search whose evidence is a table: of terms, beside others.

    Minus one where it has no entry.
    """

    table: ClassVar[dict[tuple[str, str], float]] = {
        ("rotor", ""): 5.0,
        ("coulomb", ""): 3.0,
        ("coulomb offset", "rotor"): 4.0,
        ("rotor", "coulomb offset"): -2.0,
        ("coulomb", "offset rotor"): 1.0,
        ("offset", "coulomb rotor"): -0.5,
        ("coulomb", "offset"): 2.0,
        ("offset", "coulomb"): 2.0,
    }

    def evidence(self, terms: Sequence[str], beside: Sequence[str]) -> float:
        return self.table.get((" ".join(sorted(terms)), " ".join(sorted(beside))), -1.0)

    def agreed(self, *_: Sequence[str]) -> bool:
        return True


def test_a_term_that_a_pair_makes_needless_is_taken_out_again() -> None:
    candidates = ("coulomb", "offset", "rotor")
    # rotor first, the pair then, and of the two that are poor beside the others the poorer goes:
    # rotor
    chosen = _Told(None, candidates, ()).run()  # type: ignore[arg-type]
    assert sorted(chosen) == ["coulomb", "offset"]
    # it stays whatever it is worth
    assert _Told(None, candidates, ("rotor",)).run() == ["rotor"]  # type: ignore[arg-type]
