"""Each estimator is one entry: settings, completion, help and guide follow it."""

from __future__ import annotations

import re

import pytest

from algid.api.guide import text_of
from algid.base.errors import SettingError
from algid.methods import ESTIMATORS, NAMES, estimator_of, settles
from algid.options import flag
from algid.settings import Settings


def test_an_entry_names_settings_that_there_are() -> None:
    assert len(set(NAMES)) == len(NAMES)
    assert {name for one in ESTIMATORS for name in one.lacks} <= set(Settings.model_fields)
    assert [one.name for one in ESTIMATORS if settles(one.name)] == ["paper"]
    with pytest.raises(ValueError, match=r"estimator must be one of refined, weak, .* got 'ols'"):
        estimator_of("ols")


@pytest.mark.parametrize("one", ESTIMATORS, ids=NAMES)
def test_the_guide_tells_each_estimator(one: object) -> None:
    assert isinstance(one, type(ESTIMATORS[0]))
    assert re.search(
        rf"^\| `{one.name}`.* \| {re.escape(one.does)} \| {one.when} \|$",
        text_of("estimators"),
        re.M,
    )


@pytest.mark.parametrize(
    ("name", "value"),
    [("delay", 0.01), ("constrain", True), ("l2", 0.3), ("gravity", 0.0), ("model", "rotor")],
)
def test_what_an_estimator_lacks_is_refused_with_one_that_takes_it(
    name: str, value: object
) -> None:
    given = flag(name) + (
        f" {value:g}" if name == "gravity" else f" {value}" if name == "model" else ""
    )
    with pytest.raises(
        SettingError, match=f"^{given}: .*the paper's method.*; use --estimator refined or weak$"
    ):
        Settings(estimator="paper", **{name: value})  # type: ignore[arg-type]
