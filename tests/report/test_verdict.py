"""Changes of a result, and the grade and reasons that each must have, in order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import pytest

from algid.notices import Notice, Remedy
from algid.results import (
    Bound,
    Estimate,
    Result,
    Status,
    TorqueModel,
    TorquePrediction,
)
from tests.report.folders import estimate

LOST = Estimate(estimate=None, unit="kg m^2", status=Status.NOT_IDENTIFIABLE)
VAGUE = Estimate(
    estimate=0.1, std=1.0, ci95=(-1.9, 2.1), unit="kg m^2", status=Status.NOT_SIGNIFICANT
)
PRIOR = Estimate(estimate=1.0, std=0.1, ci95=(0.8, 1.2), unit="s", status=Status.FROM_PRIOR)
WORSE = Bound(bound="k3 >= 0", value=-0.1, distance_sigma=9.0)
WEAK = Estimate(estimate=None, unit="kg m^2", status=Status.WEAK_EXCITATION)
HANGING = Notice("WRONG_ZERO", numbers={"turn": -90.0}, remedies=(Remedy({"zero": "hanging"}),))
OTHERS = Notice("OTHER_JOINTS", numbers={"count": 1, "joints": "wrist", "samples": 9})
REFUTED = Notice("REFUTED", numbers={"case": "noise", "kept": "weak"})
NEAR = Notice(
    "LENGTH_CONTRADICTED",
    numbers={"case": "identified", "name": "l1", "given": 0.3, "estimate": 0.3025, "half": 1e-3,
             "distance": 5.0},
)  # fmt: skip
LENGTH = Notice(
    "LENGTH_CONTRADICTED", numbers={"case": "stated", "name": "l1", "given": 0.3, "stated": 0.2}
)
APART = Notice("LOGS_APART", numbers={"case": "apart", "distance": 9.0})
JITTER = {"case": "jitter", "jitter": 0.06, "period": 2.0, "error": 1e-6}
UNEVEN = Notice("UNEVEN_STAMPS", numbers=JITTER, logs=("a.csv",))
NAMES = [f"k{number}" for number in range(1, 8)]


def with_fit(result: Result, **changes: object) -> Result:
    assert result.fit is not None
    return result.model_copy(update={"fit": result.fit.model_copy(update=changes)})


def of(result: Result, found: Estimate, *names: str) -> Result:
    """The result with an estimate in place of those of the names."""
    moved = dict.fromkeys(names, found)
    return result.model_copy(update={"parameters": result.parameters | moved, "table4": []})


def alone(result: Result, found: Estimate) -> Result:
    update = {"parameters": {"k1": found}, "payload": {}, "table4": []}
    return result.model_copy(update=update)


def noticed(result: Result, *notices: Notice) -> Result:
    return result.model_copy(update={"notices": list(notices)})


def predicted(one: float, two: float, of_torque: float = 1.0, **more: object) -> dict[str, object]:
    found = TorquePrediction(rmse=(1, 1), nrmse=(of_torque, 1), r2=(one, two), filter="none")
    return {"residual": found.model_copy(update=more)}


def implausible(result: Result, **changes: object) -> Result:
    """As identification leaves it where physics or torque contradict a fit: no status is OK."""
    groups = {}
    for group in ("parameters", "loaded", "payload"):
        groups[group] = {
            name: one.model_copy(update={"status": Status.IMPLAUSIBLE})
            for name, one in getattr(result, group).items()
        }
    return with_fit(result, **changes).model_copy(update=groups)


def broken(sigma: float | None) -> dict[str, list[Bound]]:
    return {"broken_bounds": [Bound(bound="k7 >= 0", value=-0.3, distance_sigma=sigma)]}


def off_truth(result: Result, sigmas: float) -> Result:
    (row,) = [row for row in result.table4 if row.parameter == "k1"]
    assert row.estimate is not None
    assert row.std is not None
    far = row.model_copy(update={"truth": row.estimate + sigmas * row.std, "error_percent": 0.1})
    return result.model_copy(update={"table4": [far]})


def chosen(result: Result, by: str, **more: list[str]) -> Result:
    """With a term whose coefficient is not significant, and who chose it."""
    model = TorqueModel(
        terms=["coulomb"], coulomb_speed=0.1, stribeck_speed=0.1, chosen_by="settings"
    )
    model = model.model_copy(update={"chosen_by": by, **more})
    return of(with_fit(result, model=model), VAGUE, "f1")


@dataclass(frozen=True)
class Case:
    """What is done to a sound result; grade and codes of the reasons, and a part of the text."""

    change: Callable[[Result], Result]
    grade: str = "reservations"
    codes: list[str] = field(default_factory=list)
    words: str = ""


CASES = {
    "sound": Case(lambda r: r, "good", [], "all 9 parameters are identified"),
    "a payload's inertia": Case(lambda r: of(r, VAGUE, "J_p"), "good", [], "9 of 10"),
    "one lost": Case(
        lambda r: of(r, LOST, "k5"),
        codes=["NOT_IDENTIFIABLE"], words="8 of 9 parameters are identified, but",
    ),
    "half lost": Case(
        lambda r: of(r, LOST, *NAMES[:4]),
        codes=["NOT_IDENTIFIABLE"], words="record a run in which both joints move",
    ),
    "most lost": Case(lambda r: of(r, LOST, *NAMES[:5]), "failed", ["NOT_IDENTIFIABLE"], "only 4"),
    "all weak": Case(
        lambda r: alone(r, WEAK),
        "failed", ["WEAK_EXCITATION"], "Failed: no parameter could be identified; do not use these",
    ),
    "all vague": Case(lambda r: alone(r, VAGUE), "failed", ["NOT_SIGNIFICANT"], "no parameter"),
    "vague term of the logs": Case(lambda r: chosen(r, "logs"), "good"),
    "vague term of the user": Case(lambda r: chosen(r, "settings"), codes=["NOT_SIGNIFICANT"]),
    "wide": Case(
        lambda r: of(r, estimate(0.05, 0.01, "N m"), "k2"), codes=["WIDE_INTERVAL"], words="±39 %"
    ),
    "narrower": Case(lambda r: of(r, estimate(-2, 0.1, "N m"), "k2"), "good", [], "k2, to ±9.8 %"),
    "all from a prior": Case(
        lambda r: of(alone(r, PRIOR), VAGUE, "k2"),
        "failed", ["FROM_PRIOR", "NOT_SIGNIFICANT"], "no parameter",
    ),
    "vague shrunk term of the user": Case(lambda r: chosen(r, "settings", shrunk=["f1"]), "good"),
    "vague phase of the logs": Case(
        lambda r: of(chosen(r, "logs", terms=["phases"]), VAGUE, "k2s"), codes=["NOT_SIGNIFICANT"]
    ),
    "another estimator": Case(
        lambda r: of(r, LOST, "k5").model_copy(update={"settings": {"estimator": "paper"}}),
        codes=["NOT_IDENTIFIABLE"], words="by the refined estimator in place of the paper one",
    ),
    "a length": Case(
        lambda r: noticed(r, LENGTH), "failed", ["LENGTH_CONTRADICTED"], "Failed: a link length"
    ),
    "a length as rulers differ": Case(
        lambda r: noticed(r, NEAR), codes=["LENGTH_CONTRADICTED"]
    ),
    "the worst bound first": Case(
        lambda r: implausible(r, broken_bounds=[*broken(4.0)["broken_bounds"], WORSE]),
        "failed", ["UNKNOWN_CAUSE", "BROKEN_BOUND"], "break k3 >= 0 by 9",
    ),
    "bound": Case(lambda r: with_fit(r, **broken(4.0)), codes=["BROKEN_BOUND"]),
    "not converged": Case(lambda r: with_fit(r, converged=False), "failed", [], "not converge"),
    "R² of 91 %": Case(lambda r: with_fit(r, **predicted(0.91, 0.93)), "good"),
    "R² of 89 %": Case(
        lambda r: with_fit(r, intervals="sandwich", **predicted(0.89, 0.99)),
        codes=["LITTLE_EXPLAINED"], words="89 %",
    ),
    "R² of 55 % by noise": Case(
        lambda r: with_fit(r, intervals="likelihood", whiteness={}, **predicted(0.55, 0.99)), "good"
    ),
    "R² of 49 % by what the model lacks": Case(
        lambda r: noticed(with_fit(r, intervals="sandwich", **predicted(0.49, 0.99)), REFUTED),
        "failed", ["UNKNOWN_CAUSE", "REFUTED"], "only 49 % of the torque of joint 1",
    ),
    "R² of 51 % by what the model lacks": Case(
        lambda r: noticed(with_fit(r, intervals="sandwich", **predicted(0.51, 0.99)), REFUTED),
        codes=["REFUTED", "LITTLE_EXPLAINED"],
    ),
    "worse than the mean": Case(
        lambda r: with_fit(r, **predicted(-0.14, 0.99)), "failed", ["UNKNOWN_CAUSE"], "joint 1"
    ),
    # friction at rest is any torque up to ± f: moving, 1 - (1 + 0.44) (0.8 / 1)² is left of it
    "worse at rest alone": Case(
        lambda r: with_fit(r, **predicted(-0.44, 0.99, rmse_moving=(0.8, 1.0))),
        codes=["LITTLE_EXPLAINED"],
    ),
    "worse while it moves": Case(
        lambda r: with_fit(r, **predicted(-0.44, 0.99, rmse_moving=(0.9, 1.0))),
        "failed", ["UNKNOWN_CAUSE"],
    ),
    # its torque is the little that inertia, weight and friction leave of one another
    "hardly driven": Case(
        lambda r: with_fit(r, **predicted(-0.5, 0.99, of_load=(0.03, 0.1))),
        codes=["LITTLE_EXPLAINED"],
    ),
    "3.9 σ off": Case(lambda r: off_truth(r, 3.9), "good"),
    "4.5 σ off": Case(lambda r: off_truth(r, 4.5), codes=["FAR_FROM_TRUTH"], words="k1 (4.5 σ)"),
    "physics": Case(
        lambda r: implausible(r, **broken(43.0)), "failed", ["UNKNOWN_CAUSE"], "by 43 standard"
    ),
    "physics alone": Case(
        implausible, "failed", ["UNKNOWN_CAUSE"], "Failed: physics forbids these estimates; do"
    ),
    "a bound without distance": Case(
        lambda r: implausible(r, **broken(None), **predicted(-0.3, 0.99)),
        "failed", ["UNKNOWN_CAUSE", "BROKEN_BOUND"], "joint 1 worse than its mean",
    ),
    "a bound without distance alone": Case(
        lambda r: implausible(r, **broken(None)), "failed", ["UNKNOWN_CAUSE"], "break k7 >= 0;"
    ),
    "causes by their order": Case(
        lambda r: implausible(noticed(r, HANGING, OTHERS)),
        "failed", ["OTHER_JOINTS", "WRONG_ZERO"], "Failed: other joints of the arm move; do",
    ),
    "of the fit before of a log": Case(
        lambda r: of(noticed(r, UNEVEN, APART, REFUTED), LOST, "k5"),
        codes=["REFUTED", "NOT_IDENTIFIABLE", "LOGS_APART", "UNEVEN_STAMPS"],
    ),
    "a cause before what is not identified": Case(
        lambda r: of(noticed(r, HANGING), LOST, "k5"), codes=["WRONG_ZERO", "NOT_IDENTIFIABLE"]
    ),
    "clipped": Case(
        lambda r: noticed(
            r, APART, Notice("SATURATED_EFFORT", "a", numbers={"percent": 1.9}),
            Notice("SATURATED_EFFORT", "of an earlier version"),
            Notice("SATURATED_EFFORT", "b", numbers={"percent": 2.1}),
            Notice("CLIPPED_TORQUE", "c", numbers={"percent": 2.1}),
        ),
        codes=["SATURATED_EFFORT", "CLIPPED_TORQUE", "LOGS_APART", *["SATURATED_EFFORT"] * 2],
    ),
    "a note": Case(lambda r: noticed(r, Notice("CUT", "cut", note=True)), "good"),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_the_verdict_on_a_change(result: Result, name: str) -> None:
    case, found = CASES[name], CASES[name].change(result).verdict
    assert (found.grade, [one.code for one in found.reasons]) == (case.grade, case.codes)
    assert case.words in found.sentence


def test_the_quantile_is_that_of_the_intervals_and_the_delay_that_of_the_torque(
    result: Result,
) -> None:
    wide = Estimate(estimate=1.0, std=2.0, ci95=(-4.0, 6.0), unit="s")
    late = alone(result, LOST).model_copy(update={"payload": {"m_p": wide}})
    assert (late.quantile, late.delay) == (2.5, None)
    assert alone(result, LOST).quantile == pytest.approx(1.96, abs=1e-3)
    assert of(result, wide, "delay").delay == wide


TYPED = "algid identify 'a b.csv' -o out"
LONG = TYPED + 99 * " --loaded run.csv"


@pytest.mark.parametrize(
    ("notice", "changes", "command"),
    [
        (HANGING, {"settings": {"command": TYPED}}, f"{TYPED} --zero hanging --force"),
        (HANGING, {"settings": {"command": f"{TYPED} --force"}}, f"{TYPED} --force --zero hanging"),
        (HANGING, {"settings": {"command": LONG}}, f"{LONG} --zero hanging --force"),
        (HANGING, {"profile": {"zero": "hanging"}}, None),  # said already
        (
            HANGING,
            {"settings": {"command": f"{TYPED} --zero upright"}},
            f"{TYPED} --zero upright --zero hanging --force",  # the last one counts
        ),
        (OTHERS, {}, None),
        (replace(HANGING, remedies=(Remedy({"accept": "WRONG_ZERO"}),)), {}, None),
        (
            None,
            {"profile": {"zero": "hanging", "tau1": {"sign": -1}}},
            "algid inspect LOG --zero hanging --set tau1.sign=-1",
        ),
        (HANGING, {"settings": {"model": "plain"}}, None),  # Python's
    ],
)
def test_the_command_to_run_first(
    result: Result, notice: Notice | None, changes: dict[str, object], command: str | None
) -> None:
    told = noticed(result, *([notice] if notice else [])).model_copy(update=changes)
    command = command and command.replace("LOG", result.log.path)
    assert implausible(told).verdict.command == command
