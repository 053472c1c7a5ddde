"""The house's plan: imports point down, mathematics reads no file, importing algid is light."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import algid

ROOT = Path(algid.__file__).parent
FLOORS = {
    "cli": 4,
    "batch": 3,
    "fleet": 3,
    "track": 3,
    "identification": 2,
    "api": 2,
    "table4": 2,
    "check": 2,
    "inspection": 1,
    "readers": 1,
    "writers": 1,
    "signals": 0,
    "estimators": 1,
    "report": 1,
    "synth": 1,
}
MATHEMATICS = ("estimators", "signals", "arm.py", "model.py", "synth/simulator.py", "synth/excitation.py")


def modules(*places: str) -> list[Path]:
    paths = [ROOT / place for place in places] if places else [ROOT]
    return [file for path in paths for file in ([path] if path.is_file() else sorted(path.rglob("*.py")))]


def imported(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
    return names


def floor(parts: tuple[str, ...]) -> int:
    return FLOORS.get(parts[0], 0) if parts else 0


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(ROOT)))
def test_imports_point_down(path: Path) -> None:
    own = path.relative_to(ROOT).with_suffix("").parts
    if own in (("__init__",), ("__main__",)):
        return
    for name in imported(path):
        if name.startswith("algid.") and not name.startswith("algid." + own[0]):
            assert floor(tuple(name.split(".")[1:])) <= floor(own), f"{path} must not import {name}"


@pytest.mark.parametrize("path", modules(*MATHEMATICS), ids=lambda path: str(path.relative_to(ROOT)))
def test_mathematics_needs_numpy_and_scipy_only(path: Path) -> None:
    allowed = {"numpy", "scipy", "algid", *sys.stdlib_module_names}
    assert {name.split(".")[0] for name in imported(path)} <= allowed


@pytest.mark.parametrize("path", modules("synth"), ids=lambda path: path.name)
def test_the_simulator_knows_nothing_of_identification(path: Path) -> None:
    assert not any(name.startswith(("algid.estimators", "algid.identification")) for name in imported(path))


def test_importing_algid_loads_nothing_heavy() -> None:
    heavy = ("numpy", "polars", "pyarrow", "scipy", "pydantic", "plotly")
    code = f"import sys, algid, algid.cli.app; print([m for m in {heavy} if m in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
