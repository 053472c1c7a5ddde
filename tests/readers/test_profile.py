"""Profiles: units, signs, zero, references, clocks, several topics; and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from algid.base.errors import SettingError
from algid.profile import load_profile


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("topics = 1", "topics.*not permitted"),
        ('[theta1]\nunit = "grad"', "theta1.unit"),
        ("[tau1]\ntorque_constant = -1", "torque_constant"),
        ("signs = [2, 1]", "signs"),
        ("gravity = nan", "gravity"),
        ("= 3", "not TOML"),
    ],
)
def test_profiles_are_strict(text: str, told: str, tmp_path: Path) -> None:
    (tmp_path / "algid.toml").write_text(text)
    with pytest.raises(SettingError, match=told):
        load_profile(tmp_path / "algid.toml")
    with pytest.raises(SettingError, match="cannot read it"):
        load_profile(tmp_path / "none.toml")
