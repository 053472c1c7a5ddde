"""One place for what decides an identification: fields, options and what a result remembers are
the same.
"""

from __future__ import annotations

import json

import pytest

from algid.base.errors import SettingError
from algid.settings import Settings


@pytest.mark.parametrize(
    "settings",
    [
        Settings(),
        Settings(
            estimator="paper", poles=(-50 + 20j, -50 - 20j, -60.0, -80.0, -90.0, -100.0), window=1.5
        ),
        Settings(model="coulomb,delay", torque_hold="zoh", l1=0.3, cross_validate=True),
    ],
)
def test_a_result_gives_its_settings_back(settings: Settings) -> None:
    content = json.loads(json.dumps(settings.as_json() | {"command": "algid identify x.csv"}))
    found = Settings.of(content)
    assert found.as_json() == settings.as_json()
    if settings.poles is not None:
        assert found == settings


@pytest.mark.parametrize("text", ["1,2,3", "a,b"])
def test_text_of_a_setting_that_means_nothing_names_it(text: str) -> None:
    with pytest.raises(SettingError, match=r"^--set poles"):
        Settings(poles=text)  # type: ignore[arg-type]


def test_auto_chooses_and_plain_has_no_terms() -> None:
    assert Settings().chooses
    assert not Settings(model="plain").chooses
    assert Settings(model="plain").terms == ()


@pytest.mark.parametrize(
    ("model", "told"),
    [
        ("backlash", "found 'backlash'"),
        ("stribeck", "add coulomb"),
        ("delay,lag", "leave one of them out"),
        ("", "found ''"),
    ],
)
def test_a_list_of_terms_that_means_nothing_is_refused(model: str, told: str) -> None:
    with pytest.raises(SettingError, match=f"^--model: .*{told}"):
        Settings(model=model)


def test_the_papers_method_takes_no_terms() -> None:
    assert Settings(estimator="paper").model == "auto"
    with pytest.raises(SettingError, match="--model coulomb: the paper's method"):
        Settings(estimator="paper", model="coulomb")
