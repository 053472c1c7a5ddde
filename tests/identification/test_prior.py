"""A prior from CAD or an earlier result: what it adds, what stays its own, what contradicts it."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import algid
from algid.base.errors import AlgidError
from algid.estimators.combine import without
from algid.identification.prior import Statement, drawn_covariance, with_prior
from algid.model import RIGID
from algid.results import Status
from algid.settings import Settings
from pipelines.accuracy_scenes import random_arm
from pipelines.prior import log_of, urdf
from tests.identification.fits import K, fit_of

ARM = random_arm(1)[0]
SEED = 1


@pytest.fixture
def cad(tmp_path: Path) -> Path:
    """The file of an arm that CAD has exactly."""
    file = tmp_path / "arm.urdf"
    file.write_text(urdf(ARM))
    return file


def test_a_drawing_errs_as_draws_of_its_numbers_do() -> None:
    """Monte Carlo of small relative errors against the derivatives."""
    error, rng = 1e-3, np.random.default_rng(1)
    drawn = []
    for _ in range(4000):
        wrong = {}
        for name in ("m1", "m2", "lc1", "lc2", "I1", "I2", "l1"):
            size = 0.01 if name == "l1" else error
            wrong[name] = getattr(ARM, name) * (1 + size * rng.standard_normal())
        drawn.append(replace(ARM, **wrong).constants()[: len(RIGID)])
    expected = drawn_covariance(ARM, error)
    std = np.sqrt(np.diag(expected))
    found = np.cov(np.transpose(drawn)) / np.outer(std, std)
    np.testing.assert_allclose(found, expected / np.outer(std, std), atol=0.07)


def test_of_a_balanced_link_the_centre_is_known_as_well_as_its_radius_of_gyration() -> None:
    arm = replace(ARM, lc1=0.0, lc2=0.0)
    std = np.sqrt(np.diag(drawn_covariance(arm, 0.2)))
    centres = [math.sqrt(arm.m1 * arm.I1), math.sqrt(arm.m2 * arm.I2)]
    assert std[1] == pytest.approx(0.2 * arm.g * centres[1])  # k2 = g m2 lc2
    link = arm.m2 * arm.l1  # k4 = g (m1 lc1 + m2 l1), with 1 % of l1
    assert std[3] == pytest.approx(arm.g * math.hypot(0.2 * centres[0], 0.2 * link, 0.01 * link))


def test_both_are_weighed_by_their_information() -> None:
    """One constant, prior half as sure as the log; nothing of one that the torque lacks."""
    fit = fit_of(payload=False, prior=without(None, ("k4",)))
    fit = replace(fit, covariance=np.diag(np.full(len(fit.names), 1e-4**2)))
    std = 2e-4
    mean = np.array([2 * K[3], K[4] + 3e-4])
    one = Statement("arm.urdf", ("k4", "k5"), mean, std**2 * np.eye(2))
    both, place = with_prior(fit, one), fit.names.index("k5")
    assert both.values[place] == pytest.approx(K[4] + 3e-4 / 5)
    assert both.covariance[place, place] == pytest.approx(1 / (1e8 + 1 / std**2))
    assert both.status == fit.status
    others = np.delete(np.arange(len(fit.names)), place)
    np.testing.assert_array_equal(both.values[others], fit.values[others])


@pytest.mark.parametrize("estimator", ["refined", "weak"])
def test_a_log_that_excites_well_stays_as_it_is(cad: Path, estimator: str) -> None:
    log = log_of(ARM, "rich", SEED)
    settings = Settings(estimator=estimator)
    alone = algid.identify(log, settings=settings)
    both = algid.identify(log, settings=settings, prior=cad, prior_error=20)
    assert both.complete is alone.complete
    for name in RIGID:
        one, other = alone.parameters[name], both.parameters[name]
        assert other.status is one.status
        assert abs(other.estimate - one.estimate) < one.std
        assert (other.std or 0) <= one.std


@pytest.mark.parametrize("estimator", ["refined", "weak"])
def test_a_log_that_excites_nothing_returns_the_prior_and_says_so(
    cad: Path, estimator: str
) -> None:
    log, settings = log_of(ARM, "rest", SEED), Settings(estimator=estimator)
    result = algid.identify(log, settings=settings, prior=cad)
    assert not result.complete  # exit code 3
    k, P = ARM.constants(), drawn_covariance(ARM, 0.2)
    for place in (0, 2, 4):
        one = result.parameters[RIGID[place]]
        assert one.status is Status.FROM_PRIOR
        assert one.estimate == pytest.approx(k[place], abs=0.3 * np.sqrt(P[place, place]))
    assert "FROM_PRIOR" in [one.code for one in result.verdict.reasons]


def test_a_wrong_prior_is_left_out(tmp_path: Path) -> None:
    file = tmp_path / "wrong.urdf"
    file.write_text(urdf(replace(ARM, m2=ARM.m2 / 3, I2=ARM.I2 / 3)))
    log = log_of(ARM, "rich", SEED)
    alone, both = algid.identify(log), algid.identify(log, prior=file)
    assert both.parameters == alone.parameters
    (notice,) = [one for one in both.notices if one.code == "OTHER_ARM"]
    assert notice.numbers["distance"] > 3
    assert both.verdict.grade == "reservations"


def test_an_earlier_result_is_a_prior_by_its_own_covariance(tmp_path: Path) -> None:
    first = algid.identify(log_of(ARM, "rich", SEED), out=tmp_path, name="first")
    folder = str(tmp_path / "first.algid")
    result = algid.identify(log_of(ARM, "faint", SEED), prior=folder)
    statuses = {result.parameters[name].status for name in RIGID}
    assert Status.FROM_PRIOR in statuses
    for name in RIGID:
        assert (result.parameters[name].std or 1) <= 1.05 * (first.parameters[name].std or 0)
    file = tmp_path / "first.algid" / "result.json"
    content = json.loads(file.read_text())
    content["fit"]["covariance"][0] = []
    file.write_text(json.dumps(content))
    with pytest.raises(AlgidError, match="its result has no covariance of k1, k2"):
        algid.identify(log_of(ARM, "faint", SEED), prior=folder)


def test_a_profile_names_it(cad: Path) -> None:
    log = log_of(ARM, "faint", SEED)
    profile = {"prior": str(cad), "prior_error": 30}
    by_profile = algid.identify(log, profile=profile)
    assert by_profile.settings["prior"] == str(cad)
    assert by_profile.parameters == algid.identify(log, **profile).parameters  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"prior_error": 20}, "--set prior_error: expected a prior"),
        ({"prior": "none.urdf"}, "none.urdf: cannot read it"),
        ({"prior": "arm.xacro"}, "--prior: no URDF by its name, and .*arm.xacro: cannot read it"),
        (
            {"prior": "arm.urdf", "prior_error": 0.2},
            "--set prior_error: expected greater than or equal to 1, ",
        ),
        ({"prior": "arm.urdf", "estimator": "paper"}, "--prior .*: the paper's method"),
        ({"prior": "arm.urdf", "parameters": "first.algid"}, "--prior: .* leave one of them out"),
        ({"prior": "first.algid", "prior_error": 20}, "first.algid is a result"),
    ],
)
def test_what_cannot_be_meant_is_refused(
    cad: Path, options: dict[str, object], message: str
) -> None:
    tmp_path = cad.parent
    log = log_of(ARM, "rich", SEED)
    if "first.algid" in options.values():
        algid.identify(log, estimator="weak", out=tmp_path, name="first")
    given = {
        name: str(tmp_path / str(one)) if name in ("prior", "parameters") else one
        for name, one in options.items()
    }
    with pytest.raises(AlgidError, match=message):
        algid.identify(log, **given)  # type: ignore[arg-type]


def test_an_export_says_what_is_from_the_prior(cad: Path) -> None:
    result = algid.identify(log_of(ARM, "faint", SEED), prior=cad, prior_error=1)
    assert not result.complete
    assert "from the prior, not measured" in algid.export(result, to="urdf").text
