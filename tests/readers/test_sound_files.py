"""A sound file reads to the bit as it always did, and its user is told what he always was."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.readers.sound_files import EXPECTED, Sound, cases

ALL = cases()


def test_every_kind_of_file_is_expected_once() -> None:
    names = [case.name for case in ALL]
    assert len(set(names)) == len(names) >= 100
    assert names == list(json.loads(EXPECTED.read_text(encoding="utf-8")))


@pytest.mark.parametrize("case", ALL, ids=lambda case: case.name)
def test_a_sound_file_reads_as_it_did(case: Sound, tmp_path: Path) -> None:
    wanted = json.loads(EXPECTED.read_text(encoding="utf-8"))[case.name]
    assert case.read(tmp_path) == wanted
