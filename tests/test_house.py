"""The figure of where tests reach, on a package of two rooms."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipelines.house_tests import Reach, reach

PACKAGE = {
    "house/__init__.py": "",
    "house/cellar/__init__.py": "",
    "house/cellar/door.py": "from house.cellar.stairs import steps\ndef enter(): return steps()\n",
    "house/cellar/stairs.py": "def steps(): return 1\ndef _creak(): pass\n",
    "house/attic/__init__.py": "from house.cellar.door import enter\n",
}
FACE = "from house.cellar.door import enter\n"
INNER = "from house.cellar.stairs import steps\n"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (FACE + "def test_a():\n    enter()\n", Reach(1, 0, 0)),
        (INNER + "def test_a():\n    steps()\ndef test_b():\n    pass\n", Reach(2, 0, 1)),
        (
            "from house.cellar import stairs\ndef test_a():\n    stairs.steps()\n",
            Reach(1, 0, 1),
        ),
        (INNER + "def helper():\n    steps()\ndef test_a():\n    helper()\n", Reach(1, 0, 1)),
        (INNER + "MADE = steps()\ndef test_a():\n    assert MADE\n", Reach(1, 0, 1)),
        (
            "from house.cellar.stairs import _creak\ndef test_a():\n    _creak()\n",
            Reach(1, 1, 1),
        ),
        (FACE + "def test_a():\n    enter()._way.__name__\n", Reach(1, 1, 1)),
    ],
)
def test_a_test_reaches_inside_by_what_it_and_its_helpers_use(
    text: str, expected: Reach, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, content in {**PACKAGE, "tests/test_it.py": text}.items():
        path = Path(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)
    assert reach(Path("house"), Path("tests")) == expected
