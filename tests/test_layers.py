"""The house's plan: imports point down, mathematics reads no file, importing algid is light."""

from __future__ import annotations

import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

import algid
from tests.layers import PURE, Room, breaches, cycles, imported, room

ROOT = Path(algid.__file__).parent
TABLE: dict[str, Room] = {  # lower rooms first
    "errors": room(),
    "guard": room("errors"),
    "staging": room("guard"),
    "limits": room(packages="pydantic"),
    "units": room(),
    "options": room("errors"),
    "faults": room("errors guard options"),
    "progress": room(),
    "significance": room(),
    "criteria": room(),
    "ros2": room("errors", "numpy"),
    "text": room("errors"),
    "notices": room("options text"),
    "arm": room(packages="numpy", library=PURE),
    "arrow": room(packages="numpy pyarrow"),
    "compiled": room(packages="numpy scipy"),
    "quantiles": room("arm", "numpy"),
    "names": room("arm", "numpy", PURE),
    "physics": room("arm names", "numpy", PURE),
    "model": room("arm names physics", "numpy", PURE),
    "log": room("arm errors notices quantiles", "numpy"),
    "signals": room("arm compiled criteria log", "numpy", PURE),
    "estimators": room(
        "arm compiled criteria model names notices physics progress quantiles signals "
        "significance", "numpy scipy", PURE
    ),
    "methods": room("estimators"),
    "files": room("errors guard limits options staging", "pydantic"),
    "stores": room("errors files", "pyarrow"),
    "runtime": room(packages="threadpoolctl"),
    "profile": room("errors files limits options units", "pydantic"),
    "settings": room(
        "errors files limits methods model options physics profile signals", "pydantic"
    ),
    "results": room(
        "arm criteria errors files log model names notices options physics significance text",
        "numpy polars pydantic"),
    "synth": room("arm errors files limits log options progress", "numpy pydantic scipy"),
    "table4": room("arm estimators limits log model names results synth"),
    "writers": room("arrow errors files log ros2", "mcap numpy polars pyarrow"),
    "readers": room(
        "arm arrow criteria errors faults files limits log names notices options profile "
        "quantiles ros2 runtime text units",
        "google h5py lz4 mcap numpy polars pyarrow rosbags ruamel scipy zstandard",
    ),
    "inspection": room("arm criteria errors estimators faults log model notices profile "
                       "quantiles readers signals units", "numpy pydantic_core"),
    "report": room(
        "arm arrow criteria errors files inspection methods model names notices options "
        "progress quantiles results ros2 significance text",
        "jinja2 markupsafe mcap numpy plotly pyarrow pydantic_core rich"
    ),
    "identification": room(
        "arm arrow criteria errors estimators files inspection log methods model names "
        "notices options physics profile progress readers report results runtime settings signals "
        "significance table4 text",
        "numpy polars pyarrow scipy",
    ),
    "batches": room(
        "errors files guard identification limits options profile progress readers results "
        "runtime settings staging stores text",
        "distributed polars pyarrow pydantic",
    ),
    "tracks": room(
        "arm compiled criteria errors estimators files identification model names notices options "
        "profile report results runtime signals significance text",
        "numpy polars pyarrow pydantic",
    ),
    "designs": room(
        "arm criteria errors estimators files identification limits log model names "
        "notices options progress report results signals significance synth text "
        "writers",
        "numpy polars pydantic pydantic_core scipy",
    ),
    "exports": room(
        "arm errors estimators identification model names notices options physics "
        "results",
        "jinja2 numpy polars scipy",
    ),
    "fleet": room("arm errors files limits model notices progress report "
                  "significance text", "numpy polars scipy"),
    "api": room(
        "batches designs errors exports files fleet identification "
        "inspection limits log methods notices options physics profile progress "
        "readers report results runtime settings stores synth text tracks units writers",
        "numpy plotly polars pydantic",
    ),
    "cli": room(
        "api errors faults guard options progress report runtime text",
        "click rich",
    ),
}  # fmt: skip


@cache
def sources() -> dict[str, str]:
    """The text of every module of algid by its name; each file of `base` is a room of its own."""
    found = {}
    for path in sorted(ROOT.rglob("*.py")):
        parts = ("algid", *path.relative_to(ROOT).with_suffix("").parts)
        name = ".".join(parts).removesuffix(".__init__").replace("algid.base.", "algid.")
        text = path.read_text(encoding="utf-8")
        found[name] = text.replace("algid.base.", "algid.").replace("algid.base ", "algid ")
    del found["algid.base"]
    return found


def test_imports_follow_the_table() -> None:
    assert list(breaches(sources(), TABLE)) == []


def test_no_arrow_points_up() -> None:
    assert cycles(TABLE) == []


def test_the_table_allows_nothing_that_nobody_needs() -> None:
    used: dict[str, set[str]] = {name: set() for name in TABLE}
    for module, text in sources().items():
        own = module.split(".")[1] if "." in module else ""
        used.get(own, set()).update(
            name.split(".")[1] if name.startswith("algid.") else name.split(".")[0]
            for name in imported(text, sources())
        )
    spare = {name: (one.rooms | one.packages) - used[name] for name, one in TABLE.items()}
    assert {name: more for name, more in spare.items() if more} == {}


HOUSE = {
    "algid": "def __getattr__(name): ...",
    "algid.arm": "import numpy",
    "algid.estimators": "",
    "algid.estimators.weak": "from algid.arm import FloatArray",
    "algid.synth": "",
    "algid.synth.run": "from algid.arm import Arm",
    "algid.cli": "",
    "algid.cli.app": "from algid.estimators import weak",
}
FLOORS = {
    "arm": room(packages="numpy", library=PURE),
    "estimators": room("arm", "numpy scipy", PURE),
    "synth": room("arm", "numpy"),
    "cli": room("arm estimators synth", "click"),
}


def test_a_sound_house_is_let_stand() -> None:
    assert list(breaches(HOUSE, FLOORS)) == []


@pytest.mark.parametrize(
    ("module", "line"),
    [
        pytest.param("algid.arm", "import algid.cli.app", id="upwards"),
        pytest.param("algid.arm", "from algid import cli", id="upwards, as a name of the package"),
        pytest.param("algid.arm", "from .cli import app", id="relative"),
        pytest.param(
            "algid.arm", "def f():\n    from algid.cli import app", id="upwards, in a function"
        ),
        pytest.param(
            "algid.arm",
            "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import algid.cli",
            id="for types",
        ),
        pytest.param(
            "algid.arm",
            "import importlib\nimportlib.import_module('algid.cli')",
            id="by its name as text",
        ),
        pytest.param("algid.arm", "__import__('algid.cli')", id="by the function behind import"),
        pytest.param(
            "algid.synth.run",
            "import importlib\nimportlib.import_module(name)",
            id="a computed name",
        ),
        pytest.param(
            "algid.synth.run",
            "from algid.estimators.weak import fit",
            id="the simulator, an estimator",
        ),
        pytest.param(
            "algid.synth.run", "from algid import identify", id="the simulator, through the package"
        ),
        pytest.param("algid.synth.run", "import algid\nalgid.identify()", id="the package whole"),
        pytest.param("algid.estimators.weak", "import polars", id="mathematics, tables"),
        pytest.param("algid.estimators.weak", "from pathlib import Path", id="mathematics, files"),
        pytest.param(
            "algid.estimators.weak",
            "def f():\n    import os.path",
            id="mathematics, files, in a function",
        ),
        pytest.param("algid.attic.box", "", id="a room without a place"),
    ],
)
def test_a_breach_is_seen(module: str, line: str) -> None:
    assert list(breaches({**HOUSE, module: line}, FLOORS))


def test_a_circle_of_rooms_is_seen() -> None:
    assert cycles({"arm": room("cli"), "cli": room("arm")}) == ["arm -> cli"]


def test_importing_algid_loads_nothing_heavy() -> None:
    heavy = ("numpy", "polars", "pyarrow", "scipy", "pydantic", "plotly")
    code = f"import sys, algid, algid.cli.app; print([m for m in {heavy} if m in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
