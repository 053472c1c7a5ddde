"""The logs to try algid on: what its guide promises of them."""

from __future__ import annotations

from pathlib import Path

import pytest

import algid
from algid.api.synth import EXAMPLE, FRICTION, LOGS
from algid.arm import CONSTANT_NAMES
from algid.base.errors import OutputError
from algid.inspection.checks import inspect_log
from algid.profile import Profile
from algid.synth.cases import load_case
from tests.processes import Outcome


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("example")
    done = Outcome("synth", "example", "-o", folder)
    assert (done.code, done.err) == (0, "")
    assert done.out.split() == [str(folder / f"{name}.csv") for name in LOGS]
    return folder


def test_nothing_is_overwritten_unless_forced(example: Path, tmp_path: Path) -> None:
    (tmp_path / "run4.csv").write_text("mine")
    with pytest.raises(OutputError, match=r"run4\.csv: exists already"):
        algid.synthesise("example", out=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["run4.csv"]
    algid.synthesise("example", out=tmp_path, force=True)
    for path in sorted(example.iterdir()):
        assert (tmp_path / path.name).read_bytes() == path.read_bytes()


def test_a_log_does_not_say_how_its_zero_lies_and_physics_does(example: Path) -> None:
    found = {one.code for one in inspect_log(example / "run1.csv").findings}
    assert "WRONG_CONVENTION" in found
    profile = Profile(zero="hanging")
    assert "WRONG_CONVENTION" not in {
        one.code for one in inspect_log(example / "run1.csv", profile).findings
    }


def test_with_its_profile_the_arm_is_found(example: Path) -> None:
    """Within four standard deviations, and these a thousandth of the value."""
    result = algid.identify(example / "run1.csv", example / "loaded.csv", zero="hanging")
    case = load_case(str(EXAMPLE))
    truth = dict(zip(CONSTANT_NAMES, case.arm.constants(), strict=True))
    truth |= {"f1": FRICTION[0], "f2": FRICTION[1], "m_p": case.payload, "l1": case.arm.l1}
    for name, value in truth.items():
        found = result.estimates[name]
        assert abs(found.estimate - value) < 4 * found.std
        assert found.std < 4e-3 * value
