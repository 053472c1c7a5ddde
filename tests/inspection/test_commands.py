"""`algid inspect`, `convert` and `profile new` as commands."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from algid.cli import convert, inspect, profile
from algid.errors import OutputError, SettingError
from algid.profile import load_profile
from algid.readers import read_log
from algid.writers import FORMATS, write_log
from tests.inspection.test_checks import moving_log
from tests.readers.logs import TRUTH, noise_log, same

APP = typer.Typer()
APP.command("inspect")(inspect.inspect)
APP.command("convert")(convert.convert)
APP.command("new")(profile.new)


def run(*arguments: str | Path, code: int = 0) -> str:
    result = CliRunner().invoke(APP, [str(one) for one in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == code, result.output
    return str(result.stdout)


@pytest.mark.parametrize("kind", FORMATS)
def test_inspect_tells_what_a_log_is(kind: str, tmp_path: Path) -> None:
    write_log(tmp_path / f"arm.{kind}", moving_log())
    text = run("inspect", tmp_path / f"arm.{kind}")
    assert "condition number" in text
    found = json.loads(run("inspect", tmp_path / f"arm.{kind}", "--format", "json"))
    assert found["refused"] is None
    assert found["clock"]["rows"] == 6000
    assert found["clock"]["rate"] == pytest.approx(1000)
    assert set(found["signals"]) == {f"{name}{joint}" for name in ("theta", "tau", "omega") for joint in (1, 2)}


def test_inspect_works_on_what_it_refuses(tmp_path: Path) -> None:
    path = tmp_path / "arm.csv"
    path.write_text("time,<b>a\x1b[31m</b>,q2\n0,1,2\n1,2,3\n".replace("\x1b", "\u0085"))
    text = run("inspect", path, code=2)
    assert "refused" in text
    assert "q2" in text
    assert "\u0085" not in text
    assert json.loads(run("inspect", path, "--format", "json", code=2))["entries"][2]["name"] == "q2"


def test_inspect_on_a_cut_file_exits_with_3(tmp_path: Path) -> None:
    write_log(tmp_path / "arm.mcap", moving_log(60_000))
    content = (tmp_path / "arm.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(content[: len(content) * 3 // 4])
    assert "CUT_OFF" in run("inspect", tmp_path / "cut.mcap", code=3)


@pytest.mark.parametrize("source", FORMATS)
@pytest.mark.parametrize("target", FORMATS)
def test_convert_keeps_every_bit_and_the_truth(source: str, target: str, tmp_path: Path) -> None:
    log = noise_log()
    write_log(tmp_path / f"in.{source}", log, truth=TRUTH)
    run("convert", tmp_path / f"in.{source}", tmp_path / f"out.{target}")
    found = read_log(tmp_path / f"out.{target}")
    assert same(found, log)
    assert found.origin.truth == TRUTH
    with pytest.raises(OutputError, match="--force"):
        run("convert", tmp_path / f"in.{source}", tmp_path / f"out.{target}")


def test_convert_refuses_unknown_formats_and_settings(tmp_path: Path) -> None:
    write_log(tmp_path / "in.csv", noise_log())
    with pytest.raises(OutputError, match="ends in"):
        run("convert", tmp_path / "in.csv", tmp_path / "out.txt")
    with pytest.raises(SettingError, match="zero"):
        run("convert", tmp_path / "in.csv", tmp_path / "out.csv", "--zero", "sideways")
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.parametrize("kind", FORMATS)
def test_a_new_profile_reads_the_log_as_before(kind: str, tmp_path: Path) -> None:
    log = noise_log()
    write_log(tmp_path / f"arm.{kind}", log)
    run("new", tmp_path / f"arm.{kind}", "-o", tmp_path / "algid.toml")
    assert same(read_log(tmp_path / f"arm.{kind}", load_profile(tmp_path / "algid.toml")), log)
    with pytest.raises(OutputError, match="--force"):
        run("new", tmp_path / f"arm.{kind}", "-o", tmp_path / "algid.toml")
