"""Logs of `algid synth`: which are written, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from algid.base.errors import AlgidError
from tests.cli.commands import app


def synth(*arguments: object) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["synth", *map(str, arguments)])
    if isinstance(done.exception, AlgidError):  # the entry point prints it and exits with 2
        return 2, str(done.exception)
    return done.exit_code, done.output


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
