"""TOML files that nest too deep: one clear line."""

from __future__ import annotations

from pathlib import Path

import pytest

from algid.errors import SettingError
from algid.profile import load_profile
from algid.synth.cases import load_case


@pytest.mark.parametrize("text", ["a." * 5000 + "b = 1", "a = " + "[" * 5000 + "]" * 5000])
def test_endless_nesting_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "deep.toml"
    path.write_text(text)
    for read in (lambda: load_profile(path), lambda: load_case(str(path))):
        with pytest.raises(SettingError) as told:
            read()
        assert len(str(told.value)) < 400
