"""Flags that cannot be as they are given: one line that names the flag, what was expected and what
to do.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from algid.api.batch import bytes_of
from algid.base.errors import SettingError
from tests.cli.commands import call


@pytest.mark.parametrize(
    ("text", "size"),
    [
        ("2GB", 2 * 10**9),
        ("2 gb", 2 * 10**9),
        ("1.5GiB", 3 * 2**29),
        ("600MiB", 600 * 2**20),
        ("536870912", 2**29),
    ],
)
def test_memory_is_read_in_the_units_of_memory(text: str, size: int) -> None:
    assert bytes_of(text) == size


@pytest.mark.parametrize(
    "text", ["", "GB", "2XB", "1e3GB", "511MiB", "-2GB", "inf", "nan", "1" + "0" * 400 + "GB"]
)
def test_no_memory_and_too_little_is_refused(text: str) -> None:
    with pytest.raises(
        SettingError, match=r"--memory-limit: expected at least 512MiB, like 2GB, found"
    ):
        bytes_of(text)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (
            ["batch", "logs", "-o", "out", "--scheduler", "tcp://127.0.0.1:1", "--workers", "2"],
            "--scheduler: workers and their memory are the cluster's; set them where it is started",
        ),
        (
            [
                "batch",
                "logs",
                "-o",
                "out",
                "--scheduler",
                "tcp://127.0.0.1:1",
                "--memory-limit",
                "2GB",
            ],
            "--scheduler: workers and their memory are the cluster's; set them where it is started",
        ),
        (
            ["batch", "absent", "-o", "out"],
            "absent: there is no such file, folder or match; check the name",
        ),
        (["synth", "case9"], "case9"),
        (
            [
                "identify",
                "log.csv",
                "--estimator",
                "paper",
                "--loaded",
                "a.csv",
                "--loaded",
                "b.csv",
            ],
            "log.csv",
        ),
        (["validate", "absent.algid", "log.csv"], "absent.algid"),
        (["validate", "absent.algid", "--max-error", "1"], "absent.algid"),
        (["track", "log.csv", "--parameters", "absent.algid"], "absent.algid"),
        (["compare", "absent.algid", "other.algid"], "absent.algid"),
        (["report", "absent.algid"], "absent.algid"),
        (["export", "absent.algid", "--to", "urdf"], "absent.algid"),
    ],
    ids=lambda value: " ".join(value[:4]) if isinstance(value, list) else None,
)
def test_what_cannot_be_is_one_line_and_leaves_nothing(
    arguments: list[str], told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "logs").mkdir()
    (tmp_path / "logs/a.csv").write_text("t,theta1\n")
    done = call(*arguments)
    assert (done.code, done.out, done.err.count("\n")) == (2, "", 1), done.err
    assert told in done.err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["logs"]
