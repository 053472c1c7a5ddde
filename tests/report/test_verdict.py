from __future__ import annotations

import pytest
from rich.console import Console

from algid.notices import Notice, Remedy
from algid.report.page import result_document
from algid.report.render import markdown, page
from algid.report.terminal import print_document
from algid.results import (
    Bound,
    Estimate,
    Result,
    Status,
    TorqueModel,
    TorquePrediction,
    WhitenessTest,
)
from algid.results.rows import row_of
from tests.report.folders import estimate

HANGING = Notice("WRONG_ZERO", numbers={"turn": -90.0}, remedies=(Remedy({"zero": "hanging"}),))


def with_fit(result: Result, **changes: object) -> Result:
    assert result.fit is not None
    return result.model_copy(update={"fit": result.fit.model_copy(update=changes)})


def with_parameter(result: Result, name: str, found: Estimate) -> Result:
    return result.model_copy(
        update={"parameters": {**result.parameters, name: found}, "table4": []}
    )


def test_a_result_without_a_flaw_is_good_and_says_how_good(result: Result) -> None:
    found = result.verdict
    assert found.grade == "good"
    assert found.sentence.startswith("Good: all 9 parameters are identified, the least certain, ")
    assert "over 99.99 % of the torque of both joints" in found.sentence
    assert found.reasons == ()


def test_the_papers_estimator_is_good_without_error_bars(result: Result) -> None:
    bare = {
        name: Estimate(estimate=e.estimate, unit=e.unit) for name, e in result.parameters.items()
    }
    plain = result.model_copy(
        update={"parameters": bare, "payload": {}, "fit": None, "estimator": "paper", "table4": []}
    )
    found = plain.verdict
    assert found.grade == "good"
    assert "without error bars, which the paper estimator does not give" in found.sentence


def test_one_reservation_is_told_in_the_sentence(result: Result) -> None:
    lost = Estimate(estimate=None, unit="kg m^2", status=Status.NOT_IDENTIFIABLE)
    found = with_parameter(result, "k5", lost).verdict
    assert found.grade == "reservations"
    assert (
        found.sentence
        == "With reservations: 8 of 9 parameters are identified, but k5 is not identifiable: "
        "record a run in which both joints move, further and faster."
    )
    wrong = result.model_copy(update={"notices": [HANGING]})
    assert [one.text for one in with_parameter(wrong, "k5", lost).verdict.reasons][1:] == [
        "k5 is not identifiable"  # the cause is mended first
    ]
    assert [reason.code for reason in found.reasons] == ["NOT_IDENTIFIABLE"]


def test_warnings_are_reasons_and_notes_are_none(result: Result) -> None:
    lost, cut = (
        Notice("NOT_FINITE", "3 samples are missing", lossy=True, logs=("a.csv",)),
        Notice("CUT", "cut", note=True),
    )
    found = result.model_copy(update={"notices": [cut, lost]}).verdict
    assert found.sentence.endswith("but 3 samples are missing.")
    assert (found.reasons, found.notes) == ((lost,), (cut,))
    assert found.reasons[0].sentence == "a.csv: 3 samples are missing"


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"broken_bounds": [Bound(bound="k6 ≥ 0", value=-1.0, distance_sigma=4.0)]}, "k6 ≥ 0"),
        (
            {"whiteness": {"tau1": WhitenessTest(white=False, p_value=0.0, lag1_correlation=0.9)}},
            "the residual of tau1 is autocorrelated",
        ),
        (
            {
                "cross_validation": TorquePrediction(
                    rmse=(1, 1), nrmse=(1, 1), r2=(0.62, 0.99), filter="none"
                )
            },
            "the model explains only 62 % of the torque of joint 1",
        ),
    ],
)
def test_what_the_fit_holds_against_itself_is_a_reservation(
    result: Result, changes: dict[str, object], reason: str
) -> None:
    found = with_fit(result, **changes).verdict
    assert found.grade == "reservations"
    assert reason in found.sentence


def test_intervals_that_allow_for_colour_make_it_no_reservation(result: Result) -> None:
    coloured = {"tau1": WhitenessTest(white=False, p_value=0.0, lag1_correlation=0.9)}
    assert with_fit(result, whiteness=coloured, intervals="sandwich").verdict.grade == "good"


def test_wide_intervals_and_distance_from_the_truth_are_reservations(result: Result) -> None:
    wide = with_parameter(result, "k2", estimate(0.05, 0.01, "N m")).verdict
    assert "k2 (±39 %)" in wide.sentence  # 1.96 times 20 %
    row = result.table4[0].model_copy(update={"estimate": 2.0, "truth": 1.0, "std": 0.1})
    assert (
        "k1 (10 σ) lies far from the truth"
        in result.model_copy(update={"table4": [row]}).verdict.sentence
    )


@pytest.mark.parametrize("quantile", [1.96, 2.776])
def test_every_per_cent_of_an_interval_is_that_of_the_printed_interval(
    result: Result, quantile: float
) -> None:
    """Student's interval is wider than 1.96 σ: terminal, notice and table print the same one."""
    one = estimate(0.05, 0.01, "N m").model_copy(
        update={"ci95": (0.05 - quantile * 0.01, 0.05 + quantile * 0.01)}
    )
    found = with_parameter(result, "k2", one)
    share = row_of("k2", one).share
    assert float(share) == pytest.approx(20 * quantile, rel=0.02)
    assert f"k2 (±{share} %)" in found.verdict.sentence
    assert f"± {0.01 * quantile:.2g}" in str(row_of("k2", one).with_half)
    (line,) = [line for line in str(found).splitlines() if line.startswith("k2 ")]
    assert line.split()[2] == f"{0.01 * quantile:.2g}"


def test_an_estimator_that_did_not_converge_failed(result: Result) -> None:
    found = with_fit(result, converged=False).verdict
    assert (
        found.sentence
        == "Failed: the estimator did not converge in 4 iterations; do not use these numbers."
    )
    one = result.parameters["k1"].model_copy(update={"status": Status.NOT_CONVERGED})
    assert with_parameter(result, "k1", one).verdict.grade == "failed"


def test_a_model_that_is_worse_than_a_constant_failed_and_one_that_explains_little_is_doubtful(
    result: Result,
) -> None:
    worse = TorquePrediction(rmse=(1, 1), nrmse=(1, 1), r2=(-0.14, 0.48), filter="none")
    found = with_fit(result, residual=worse).verdict
    assert found.sentence == (
        "Failed: the model predicts the torque of joint 1 worse than its mean does; do not use "
        "these numbers."
    )
    little = worse.model_copy(update={"r2": (0.14, 0.48)})
    found = with_fit(result, residual=little).verdict
    assert found.grade == "reservations"
    assert "explains only 14 % of the torque of joint 1" in found.sentence


def test_a_joint_that_a_constant_beats_only_at_rest_is_no_failure(result: Result) -> None:
    """Friction is any torque up to ± f there.

    A torque of RMS 1 whose residual is 1.2 in all is explained where 0.6 is left while it moves,
    and not where 1.1 is.
    """
    sticking = TorquePrediction(
        rmse=(1.2, 0.1), nrmse=(1.2, 0.1), r2=(-0.44, 0.99), filter="none", rmse_moving=(0.6, 0.1)
    )
    found = with_fit(result, residual=sticking).verdict
    assert found.grade == "reservations"
    assert "the torque of joint 1 worse than its mean does" in found.sentence
    for moving in (1.1, None):
        poor = sticking.model_copy(update={"rmse_moving": (moving, 0.1)})
        assert with_fit(result, residual=poor).verdict.grade == "failed"


def test_a_joint_that_is_hardly_driven_is_no_failure(result: Result) -> None:
    """Its torque is the little that inertia, weight and friction leave of one another."""
    hardly = TorquePrediction(
        rmse=(1, 1), nrmse=(1.2, 0.1), r2=(-0.5, 0.99), filter="none", of_load=(0.03, 0.1)
    )
    found = with_fit(result, residual=hardly).verdict
    assert found.grade == "reservations"
    assert "predicts the torque of joint 1 worse than its mean does" in found.sentence


def test_fewer_than_half_of_the_parameters_is_a_failure(result: Result) -> None:
    lost = Estimate(estimate=None, unit="kg m^2", status=Status.NOT_IDENTIFIABLE)
    few = {
        name: found if name in ("k1", "k2") else lost for name, found in result.parameters.items()
    }
    found = result.model_copy(update={"parameters": few, "payload": {}, "table4": []}).verdict
    assert found.sentence.startswith("Failed: only 2 of 7 parameters could be identified")


def test_nothing_identified_is_a_failure(result: Result) -> None:
    weak = {"k1": Estimate(estimate=None, unit="kg m^2", status=Status.WEAK_EXCITATION)}
    found = result.model_copy(update={"parameters": weak, "payload": {}, "table4": []}).verdict
    assert found.sentence.startswith(
        "Failed: no parameter could be identified (too weakly excited)"
    )


def test_nothing_but_what_may_be_zero_is_a_failure(result: Result) -> None:
    vague = Estimate(
        estimate=0.1, std=1.0, ci95=(-1.9, 2.1), unit="kg m^2", status=Status.NOT_SIGNIFICANT
    )
    found = result.model_copy(update={"parameters": {"k1": vague}, "payload": {}, "table4": []})
    assert found.verdict.sentence.startswith(
        "Failed: no parameter could be identified (not significant)"
    )


def test_an_undetermined_parameter_is_told_once(result: Result) -> None:
    lost = Estimate(estimate=None, unit="kg m^2", status=Status.NOT_IDENTIFIABLE)
    told = with_parameter(result, "k5", lost)
    assert [reason.text for reason in told.verdict.reasons] == [
        "k5 is not identifiable: record a run in which both joints move, further and faster"
    ]


def test_many_estimates_far_from_the_truth_are_one_reason(result: Result) -> None:
    wrong = [
        row.model_copy(update={"truth": row.truth * 2})
        for row in result.table4
        if row.truth is not None
    ]
    reasons = result.model_copy(update={"table4": wrong}).verdict.reasons
    assert len(reasons) == 1
    assert reasons[0].code == "FAR_FROM_TRUTH"
    assert reasons[0].text.startswith("k1 (")
    assert reasons[0].text.endswith(" σ) lie far from the truth")


def implausible(result: Result, **changes: object) -> Result:
    """The result with no status OK left, as identification leaves it where physics or torque
    contradict a fit.
    """
    groups = {
        group: {
            name: e.model_copy(update={"status": Status.IMPLAUSIBLE})
            for name, e in getattr(result, group).items()
        }
        for group in ("parameters", "loaded", "payload")
    }
    return with_fit(result, **changes).model_copy(update=groups)


def test_broken_physics_failed_and_the_likely_cause_leads(result: Result) -> None:
    broken = [Bound(bound="k7 >= 0", value=-0.3, distance_sigma=43.0)]
    found = implausible(result, broken_bounds=broken).verdict
    assert found.grade == "failed"
    assert found.sentence.startswith(
        "Failed: the estimates break k7 >= 0 by 43 standard deviations"
    )
    assert found.reasons[0].code == "UNKNOWN_CAUSE"
    assert found.command == f"algid inspect {result.log.path}"
    assert not any("k7" in reason.text for reason in found.reasons)


def test_a_known_cause_comes_with_the_command_that_mends_it(result: Result) -> None:
    told = result.model_copy(
        update={"notices": [HANGING], "settings": {"command": "algid identify 'a b.csv' -o out"}}
    )
    found = implausible(told).verdict
    assert found.reasons[0] == HANGING
    assert found.command == "algid identify 'a b.csv' -o out --zero hanging --force"


def test_nothing_of_a_failed_result_is_green(result: Result) -> None:
    console = Console(width=120, force_terminal=True, color_system="standard")
    poor = TorquePrediction(rmse=(1, 1), nrmse=(1, 1), r2=(-0.14, 0.48), filter="none")
    failed = with_fit(result, residual=poor)
    for shown, green in ((result, True), (failed, False)):
        with console.capture() as printed:
            print_document(result_document(shown), console)
        assert ("\x1b[32mOK" in printed.get()) is green
        whole = page(result_document(shown), shared_library=True)
        assert ('class="status whole ok"' in whole) is green
    assert "✅" not in markdown(result_document(failed))


def test_one_document_holds_what_every_format_shows(result: Result) -> None:
    made = result_document(result)
    console = Console(width=200)
    with console.capture() as printed:
        print_document(made, console)
    shown = printed.get()
    text = markdown(made)
    folded = text.partition("<details>")[2]
    for away in (False, True):
        assert made.tables(folded=away)
        for table in made.tables(folded=away):
            assert f"**{table.title}**" in text
            assert (f"**{table.title}**" in folded) is away
            assert (table.title in shown) is not away
    assert made.verdict.sentence.partition(":")[0] in shown


def predicted(one: float, two: float) -> TorquePrediction:
    return TorquePrediction(rmse=(1, 1), nrmse=(1, 1), r2=(one, two), filter="none")


@pytest.mark.parametrize(
    ("r2", "level", "words"),
    [
        (
            (0.91, 0.93),
            "good",
            "the model explains 91.00 % of joint 1's torque and 93.00 % of joint 2's",
        ),
        ((0.995, 0.995), "good", "the model explains 99.50 % of the torque of both joints"),
        (
            (0.89, 0.99),
            "reservations",
            "but the model explains only 89 % of the torque of joint 1.",
        ),
        (
            (0.99, 0.51),
            "reservations",
            "but the model explains only 51 % of the torque of joint 2.",
        ),
        (
            (0.45, 0.99),
            "reservations",
            "but the model explains only 45 % of the torque of joint 1.",
        ),
        (
            (-0.2, 0.99),
            "failed",
            "Failed: the model predicts the torque of joint 1 worse than its mean does;",
        ),
    ],
)
def test_what_the_model_explains_decides(
    result: Result, r2: tuple[float, float], level: str, words: str
) -> None:
    found = with_fit(result, residual=predicted(*r2)).verdict
    assert (found.grade, words in found.sentence) == (level, True), found.sentence


@pytest.mark.parametrize(
    ("lost", "sentence"),
    [
        (4, "With reservations: 4 of 8 parameters are identified, but "),
        (5, "Failed: only 3 of 8 parameters could be identified; do not use these numbers."),
    ],
)
def test_half_of_the_parameters_must_be_identified(
    result: Result, lost: int, sentence: str
) -> None:
    none = Estimate(estimate=None, unit="kg m^2", status=Status.NOT_IDENTIFIABLE)
    names = list(result.parameters)
    parameters = {
        name: none if place < lost else result.parameters[name] for place, name in enumerate(names)
    }
    payload = {"m_p": result.payload["m_p"]}
    found = result.model_copy(
        update={"parameters": parameters, "payload": payload, "table4": []}
    ).verdict
    assert found.sentence.startswith(sentence)


@pytest.mark.parametrize(
    ("sigmas", "reasons"), [(3.9, ()), (4.5, ("k1 (4.5 σ) lies far from the truth",))]
)
def test_four_sigma_from_the_truth_are_too_far(
    result: Result, sigmas: float, reasons: tuple[str, ...]
) -> None:
    (row,) = [row for row in result.table4 if row.parameter == "k1"]
    assert row.estimate is not None
    assert row.std is not None
    far = row.model_copy(update={"truth": row.estimate + sigmas * row.std, "error_percent": 0.1})
    found = result.model_copy(update={"table4": [far]}).verdict
    assert tuple(reason.text for reason in found.reasons) == reasons


def test_praise_tells_the_widest_interval_in_percent(result: Result) -> None:
    found = with_parameter(result, "k2", estimate(-2.0, 0.1, "N m")).verdict
    assert "the least certain, k2, to ±9.8 % (95 %)" in found.sentence  # 1.96 times 5 %


def test_a_look_at_the_log_takes_the_flags_that_say_how_it_is_read(result: Result) -> None:
    typed = "algid identify a.csv --set tau1.sign=-1 --joints=elbow,wrist -o out --l1 0.2 --force"
    told = result.model_copy(update={"settings": {"command": typed}})
    command = f"algid inspect {result.log.path} --set tau1.sign=-1 --joints=elbow,wrist"
    assert implausible(told).verdict.command == command
    python = result.model_copy(update={"profile": {"zero": "hanging", "tau1": {"sign": -1}}})
    assert implausible(python).verdict.command == (
        f"algid inspect {result.log.path} --zero hanging --set tau1.sign=-1"
    )


def test_what_the_call_has_said_is_not_advised_again(result: Result) -> None:
    told = result.model_copy(update={"notices": [HANGING], "profile": {"zero": "hanging"}})
    assert implausible(told).verdict.command is None


def test_what_changed_the_estimator_comes_before_what_is_of_a_log(result: Result) -> None:
    jitter = {"jitter": 0.06, "period": 2.0, "error": 1e-6}
    notices = [
        Notice("UNEVEN_STAMPS", numbers={"case": "jitter"} | jitter, logs=("a.csv",)),
        Notice("LOGS_APART", numbers={"case": "apart", "distance": 9.0}),
        Notice("REFUTED", numbers={"case": "noise", "kept": "weak"}),
    ]
    found = result.model_copy(update={"notices": notices}).verdict
    codes = [one.code for one in found.reasons]
    assert codes[0] == "REFUTED"
    assert codes[-2:] == ["LOGS_APART", "UNEVEN_STAMPS"]


def test_a_command_is_forced_once(result: Result) -> None:
    told = result.model_copy(
        update={"notices": [HANGING], "settings": {"command": "algid identify a.csv --force"}}
    )
    assert implausible(told).verdict.command == "algid identify a.csv --force --zero hanging"


def test_a_bound_without_a_distance_does_not_hide_a_useless_model(result: Result) -> None:
    near = [Bound(bound="k7 >= 0", value=0.0, distance_sigma=None)]
    found = implausible(result, broken_bounds=near, residual=predicted(-0.3, 0.9)).verdict
    assert found.sentence.startswith(
        "Failed: the model predicts the torque of joint 1 worse than its mean does;"
    )
    fine = implausible(result, broken_bounds=near).verdict
    assert fine.sentence.startswith("Failed: the estimates break k7 >= 0;")
    assert implausible(result).verdict.sentence.startswith(
        "Failed: physics forbids these estimates;"
    )


def test_joints_that_move_beside_those_read_lead_the_reasons(result: Result) -> None:
    """Conventions are sought in torques in which other joints have their share."""
    others = Notice("OTHER_JOINTS", numbers={"count": 1, "joints": "wrist", "samples": 9})
    found = implausible(result.model_copy(update={"notices": [HANGING, others]})).verdict
    assert [reason.code for reason in found.reasons[:2]] == ["OTHER_JOINTS", "WRONG_ZERO"]
    assert found.command is None


@pytest.mark.parametrize(("percent", "first"), [(2.5, True), (1.5, False)])
def test_a_torque_that_is_cut_off_in_many_samples_leads_the_reasons(
    percent: float, first: bool, result: Result
) -> None:
    numbers = {"case": "open", "channel": "tau1", "percent": percent}
    refuted = Notice("REFUTED", numbers={"case": "noise", "kept": "weak"})
    notices = [refuted, Notice("SATURATED_EFFORT", numbers=numbers, logs=("a.csv",))]
    found = result.model_copy(update={"notices": notices}).verdict
    assert found.grade == "reservations"
    assert (found.reasons[0].code == "SATURATED_EFFORT") is first


@pytest.mark.parametrize(("chosen_by", "doubted"), [("logs", False), ("settings", True)])
def test_terms_that_the_logs_chose_bring_no_reservation(
    chosen_by: str, doubted: bool, result: Result
) -> None:
    """A wide or insignificant coefficient is one where the term was asked for, or is a phase."""
    vague = Estimate(estimate=0.1, std=0.07, ci95=(-0.04, 0.24), unit="N m")
    none = vague.model_copy(update={"status": Status.NOT_SIGNIFICANT})
    content = {"terms": ["stribeck", "phases"], "coulomb_speed": 0.1, "stribeck_speed": 0.3}
    model = TorqueModel.model_validate({**content, "chosen_by": chosen_by})
    fitted = with_fit(result, model=model)
    codes = {
        name: [
            {reason.code for reason in with_parameter(fitted, name, one).verdict.reasons}
            for one in (vague, none)
        ]
        for name in ("s1", "k1s")
    }
    named = [{"WIDE_INTERVAL"}, {"NOT_SIGNIFICANT"}]
    assert codes == {"s1": named if doubted else [set(), set()], "k1s": named}
