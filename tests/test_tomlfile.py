"""TOML files that nest too deep: one clear line."""

from __future__ import annotations

from pathlib import Path

import pytest

from algid.base.errors import SettingError
from algid.base.files import parsed_toml
from algid.batches.discover import jobs_of
from algid.designs.request import request
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
        ("a" + ".a" * 1_000_000 + " = 1", "line 1 has a key of more than 32 parts"),
        ("[a" + " . a" * 1_000_000 + "]", "line 1 has a key of more than 32 parts"),
        ('x = 1\n"a b"' + '."a b"' * 200_000 + " = 1", "line 2 has a key of more than 32 parts"),
        ("a = " + "9" * 80_000, "a whole number of too many digits"),
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


def test_dots_that_are_no_keys_are_read() -> None:
    text = (
        "# ..................................................\nq = ["
        + "1.5, " * 100
        + ']\nlogs = "'
        + "./" * 100
        + 'a.b"'
    )
    assert parsed_toml(text)["logs"].endswith("a.b")
    assert parsed_toml(".".join("abcdef") + " = 1") == {"a": {"b": {"c": {"d": {"e": {"f": 1}}}}}}
