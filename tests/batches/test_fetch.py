"""Logs in an object store: what is fetched of them, and that this changes no number."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

import algid
from algid.batches.fetch import SMALL, merged, staged, without
from algid.errors import LogError
from algid.identification.identify import identify
from algid.identification.source import Staged
from algid.log import Log
from algid.profile import Angle, Profile
from algid.readers.mcap import opened
from algid.readers.mcap.load import _LOOKED_BESIDE
from algid.results import Result
from algid.settings import Settings
from algid.stores import open_store
from algid.synth.sensors import Sensors
from tests.objects import Served, s3, with_cameras
from tests.readers.mcaps import NO_INDEX, joint_state, write_mcap

WEAK = Settings(estimator="weak", model="plain")


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    with pytest.MonkeyPatch.context() as monkeypatch, s3(monkeypatch) as running:
        yield running


@pytest.fixture(scope="module")
def log() -> Log:
    unloaded, _ = algid.synthesise(
        "case1", duration=2.0, excitation="wide", sensors=Sensors(1e-4, 1e-3)
    )
    return replace(unloaded, omega=None)


def _put(served: Served, path: Path) -> str:
    open_store(served.url("logs")).write(path.name, path.read_bytes())
    served.answers.clear()
    return served.url(f"logs/{path.name}")


def _told(result: Result) -> str:
    """All of a result but the log's path and hash."""
    return result.model_copy(
        update={"log": result.log.model_copy(update={"path": "", "sha256": ""})}
    ).model_dump_json()


def _same(copy: Staged, path: Path, profile: Profile | None = None) -> bool:
    one, other = (identify(log, settings=WEAK, profile=profile) for log in (copy, path))
    return _told(one) == _told(other)


@pytest.mark.slow
def test_of_a_log_with_cameras_the_joints_chunks_are_fetched(
    served: Served, log: Log, tmp_path: Path
) -> None:
    path = tmp_path / "cameras.mcap"
    with_cameras(path, log, images=32)
    with opened(path) as (_, found):
        joints = next(
            number for number, one in found.channels.items() if one.topic == "/joint_states"
        )
        chunks = [span for span in found.spans if span.channels and joints in span.channels]
    needed = sum(span.length + span.index_length for span in chunks)
    assert needed < 0.012 * path.stat().st_size
    copy = staged(_put(served, path), tmp_path / "copy")
    assert not copy.whole
    looked_at = _LOOKED_BESIDE + needed // 4  # chunks of other channels may redefine ours
    assert sum(served.answers) < 2 * needed + looked_at
    assert len(served.answers) < len(found.spans) + 8
    assert copy.path.stat().st_size == path.stat().st_size
    assert copy.path.stat().st_blocks * 512 < 3 * needed + looked_at
    assert identify(copy, settings=WEAK).log.sha256 is None
    assert _same(copy, path)


def test_a_log_of_joints_alone_is_fetched_whole_and_hashed(
    served: Served, log: Log, tmp_path: Path
) -> None:
    path = tmp_path / "joints.mcap"
    algid.write_log(
        path,
        replace(log, theta=log.theta + np.random.default_rng(0).normal(0, 1e-3, log.theta.shape)),
    )
    for size in (1 << 30, 0):  # below the size where parts are worth a request, and above it
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("algid.batches.fetch.SMALL", size)
            copy = staged(_put(served, path), tmp_path / "copy")
        assert copy.whole
        assert copy.path.read_bytes() == path.read_bytes()
    assert identify(copy, settings=WEAK).log.sha256 == identify(path, settings=WEAK).log.sha256


def _large(rows: int = 40000) -> Iterator[tuple[str, int, bytes]]:
    noise = np.random.default_rng(1)
    for row in range(rows):
        values = noise.normal(size=2).tolist()
        yield (
            "/joint_states",
            row * 10**6,
            joint_state(row * 10**6, position=values, effort=values).done(),
        )


@pytest.mark.parametrize("fault", ["cut off", "without index", "crooked index"])
def test_an_mcap_file_without_a_sound_summary_is_fetched_whole(
    served: Served, tmp_path: Path, fault: str
) -> None:
    path = tmp_path / "log.mcap"
    options: dict[str, Any] = NO_INDEX if fault == "without index" else {}
    write_mcap(path, _large(), **options)
    content = bytearray(path.read_bytes())
    if fault == "cut off":
        content = content[:-1000]
    elif fault == "crooked index":
        with opened(path) as (_, found):
            content[found.spans[0].start + found.spans[0].length] ^= 0xFF
    assert len(content) > SMALL
    path.write_bytes(content)
    copy = staged(_put(served, path), tmp_path / "copy")
    assert copy.whole
    assert copy.path.read_bytes() == content


@pytest.mark.parametrize("name", ["algid", "foreign"])
def test_of_parquet_the_columns_that_are_read_are_fetched(
    served: Served, log: Log, tmp_path: Path, name: str
) -> None:
    path = tmp_path / f"{name}.parquet"
    algid.write_log(path, log)
    if name == "foreign":
        frame = pl.read_parquet(path).rename({"theta1": "arm.theta1"})
        ballast = np.random.default_rng(2).normal(size=(frame.height, 96))
        frame = frame.hstack(pl.DataFrame(ballast, schema=[f"other{n}" for n in range(96)]))
        frame.write_parquet(path, row_group_size=500)
    profile = (
        Profile(theta1=Angle(source="arm.theta1"), theta2=Angle(source="theta2"))
        if name == "foreign"
        else None
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("algid.batches.fetch.SMALL", 0)
        copy = staged(_put(served, path), tmp_path / "copy", profile)
    assert copy.whole == (name == "algid")
    if name == "foreign":
        assert sum(served.answers) < 0.2 * path.stat().st_size
    assert _same(copy, path, profile)


def test_other_logs_are_fetched_whole(served: Served, log: Log, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    algid.write_log(path, log)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("algid.batches.fetch.SMALL", 0)
        copy = staged(_put(served, path), tmp_path / "copy")
    assert copy.whole
    assert _same(copy, path)


def test_an_error_names_the_object(served: Served, tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    write_mcap(path, (("/gripper", stamp, payload) for _, stamp, payload in _large()))
    with pytest.raises(LogError, match=r"^s3://lab-\w+/logs/log\.mcap.*no topic holds"):
        staged(_put(served, path), tmp_path / "copy", Profile(topic="/arm"))
    with pytest.raises(LogError, match=r"^s3://lab-\w+/absent\.mcap.* it cannot be read"):
        staged(served.url("absent.mcap"), tmp_path / "copy")


def test_ranges_that_lie_near_each_other_become_one() -> None:
    assert merged([(50, 60), (0, 10), (5, 12), (14, 20)]) == [(0, 12), (14, 20), (50, 60)]
    assert merged([(50, 60), (0, 10), (14, 20)], gap=4) == [(0, 20), (50, 60)]


def test_what_is_had_is_not_fetched_again() -> None:
    held = [(10, 20), (30, 40)]
    assert list(without([(0, 5), (12, 18), (15, 35), (38, 50)], held)) == [
        (0, 5),
        (20, 30),
        (40, 50),
    ]
    assert list(without([(5, 45), (50, 50)], held)) == [(5, 10), (20, 30), (40, 45)]
