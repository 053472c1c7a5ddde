"""Logs of `algid synth`: which are written, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from algid.base.errors import AlgidError
from algid.readers import read_log
from tests.cli.commands import app

BARE = "[arm]\nm1 = 2.0\nm2 = 1.0\nl1 = 0.4\nl2 = 0.3\nb1 = 0.2\nb2 = 0.1\n"
PLAN = "t,theta1,theta2,omega1,omega2,tau1,tau2\n" + "".join(
    f"{t},-1.57,0,0,0,0,0\n" for t in (0, 0.01, 0.02, 0.03)
)


def synth(*arguments: object) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["synth", *map(str, arguments)])
    if isinstance(done.exception, AlgidError):  # the entry point prints it and exits with 2
        return 2, str(done.exception)
    return done.exit_code, done.output


def test_an_arm_without_payload_leaves_one_log_with_the_noise_of_its_seed(tmp_path: Path) -> None:
    case, logs = tmp_path / "bare.toml", tmp_path / "logs"
    case.write_text(BARE, encoding="utf-8")
    code, said = synth(
        case, "--torque-noise", "0.1", "--duration", "0.1", "--format", "csv", "-o", logs
    )
    assert (code, said.split()) == (0, [str(logs / "bare-unloaded.csv")])
    case.write_text(BARE + "[payload]\nm_p = 0.3\n", encoding="utf-8")
    synth(
        case,
        "--torque-noise",
        "0.1",
        "--duration",
        "0.1",
        "--format",
        "csv",
        "-o",
        tmp_path / "both",
    )
    once, both = (
        read_log(folder / "bare-unloaded.csv").tau for folder in (logs, tmp_path / "both")
    )
    np.testing.assert_array_equal(once, both)


def test_a_rehearsal_overwrites_no_log_either(tmp_path: Path) -> None:
    case, plan = tmp_path / "bare.toml", tmp_path / "plan.csv"
    case.write_text(BARE, encoding="utf-8")
    plan.write_text(PLAN, encoding="utf-8")
    arguments = (case, "--motion", plan, "--format", "csv", "-o", tmp_path)
    assert synth(*arguments)[0] == 0
    before = (tmp_path / "bare-unloaded.csv").read_bytes()
    code, said = synth(*arguments, "--torque-noise", "0.1")
    assert code == 2
    assert f"{tmp_path / 'bare-unloaded.csv'}: exists already" in said
    assert (tmp_path / "bare-unloaded.csv").read_bytes() == before
    assert synth(*arguments, "--torque-noise", "0.1", "--force")[0] == 0
    assert (tmp_path / "bare-unloaded.csv").read_bytes() != before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        *(
            (["case1", "--payload-schedule", text], f"--payload-schedule: {why}")
            for text, why in (
                ("1=2=3", "tuple should have at most 2 items"),
                ("2=1,1=0", "expected increasing times like 2=0.05,4=0, found [(2.0, 1.0), "),
                ("1=-1", "expected greater than or equal to 0, found '-1'"),
                ("nan=1", "expected less than or equal to 1000000, found 'nan'"),
                ("", ""),
            )
        ),
        (
            ["nocase"],
            "nocase: no such case; expected case1, case2 or a .toml file that describes an arm",
        ),
        (
            ["case1", "--set", "initial=0,0,0"],
            "--set initial: field required, found ['0', '0', '0'] (The state θ1,θ2,ω1,ω2",
        ),
        (
            ["case1", "--set", "initial=0,0,0,inf"],
            "--set initial: expected less than or equal to 10000, found 'inf'",
        ),
        (
            ["case1", "--torque", "fast"],
            "--torque fast: expected case, wide, none or a log, found neither",
        ),
        (
            ["case1", "--motion", "x", "--set", "initial=0,0,0,0"],
            (
                "--set initial: a motion starts where it was planned and carries one "
                "payload; leave it out"
            ),
        ),
        (["case1", "--motion", "x"], "x: not the trajectory of a design ("),
    ],
)
def test_what_makes_no_log_is_refused_in_one_line(
    arguments: list[str], message: str, tmp_path: Path
) -> None:
    code, said = synth(*arguments, "-o", tmp_path)
    assert code == 2
    assert said.startswith(message)
    assert "\n" not in said
    assert list(tmp_path.iterdir()) == []
