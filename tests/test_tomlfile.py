"""TOML files that nest too deep: one clear line."""

from __future__ import annotations

from pathlib import Path

import pytest

from algid.base.errors import SettingError
from algid.batches.discover import jobs_of
from algid.designs.limits import request
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


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a = " + "9" * 80_000, "Exceeds the limit"),
        ("a = [" + "1," * (1 << 21) + "]", "more than 4 MiB"),
    ],
)
def test_more_work_than_any_honest_file_asks_for_is_refused(
    text: str, said: str, tmp_path: Path
) -> None:
    path = tmp_path / "long.toml"
    path.write_text(text)
    for read in (
        load_profile,
        lambda path: load_case(str(path)),
        lambda path: jobs_of([str(path)], "out"),
        lambda path: request(path, {}),
    ):
        with pytest.raises(SettingError, match=f"long.toml: .*{said}"):
            read(path)
