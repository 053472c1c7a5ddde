"""A track's folder: the same digits everywhere, a page that opens offline, a log for other
viewers.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from click.testing import CliRunner
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

import algid
from algid.api.track import answer
from algid.base.errors import ResultError
from algid.identification.identify import identify
from algid.synth.sensors import Sensors
from algid.tracks.page import (
    verdict,
    write_track,
)
from algid.tracks.payload import track_log
from algid.tracks.result import TrackResult, read_track, track_json
from algid.writers import write_log
from tests.cli.commands import app
from tests.report.pages import Page
from tests.tracks.folders import CASE, noisy

START_NS = 1_700_000_000_000_000_000


@pytest.fixture(scope="module")
def files(picking: algid.Log, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A log with its schedule, and the result of its arm."""
    folder = tmp_path_factory.mktemp("track")
    unloaded, _ = algid.synthesise(
        "case1", duration=2.0, torque="wide", sensors=Sensors(1e-3, 1e-2)
    )
    identify(unloaded, out=folder, name="arm", report=False)
    log = noisy(picking, np.random.default_rng(4))
    write_log(
        folder / "picking.mcap",
        replace(log, stamp_ns=log.stamp_ns + START_NS),
        truth=log.origin.truth,
    )
    return folder / "picking.mcap", folder / "arm.algid"


@pytest.fixture(scope="module")
def result(files: tuple[Path, Path]) -> TrackResult:
    return track_log(*files, l1=CASE.arm.l1, l2=CASE.arm.l2)


def test_a_track_with_one_stretch_that_says_nothing_ends_with_3_and_of_a_cut_log_with_4(
    result: TrackResult,
) -> None:
    first, *others = result.track.stretches
    silent = replace(result.track, stretches=[replace(first, std=1e9), *others])
    partly, given = replace(result, track=silent), {"log": "a.mcap", "out": Path()}
    assert not verdict(partly).failed
    ends = [answer(one, given).exit for one in (result, partly, replace(result, data_lost=True))]
    assert ends == [0, 3, 4]


def test_the_mcap_bears_the_stamps_of_the_log(result: TrackResult, tmp_path: Path) -> None:
    write_track(result, tmp_path, mcap=True)
    rows = pl.read_parquet(tmp_path / "track.parquet")
    with (tmp_path / "track.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        found = [
            (m.channel.topic, m.message.log_time, m.decoded_message)
            for m in reader.iter_decoded_messages()
        ]
    assert {topic for topic, _, _ in found} == {"/algid/payload"}
    assert [time for _, time, _ in found] == (
        START_NS + np.rint(rows["t"].to_numpy() * 1e9).astype(np.int64)
    ).tolist()
    for name in ("m_p", "low", "high", "stretch_m_p", "stretch_low", "stretch_high"):
        assert [getattr(message, name) for _, _, message in found] == rows[name].to_list()


def test_the_arm_of_another_log_is_told(files: tuple[Path, Path], tmp_path: Path) -> None:
    other, _ = algid.synthesise("case2", duration=2.0, torque="wide", sensors=Sensors(1e-3, 1e-2))
    write_log(tmp_path / "other.mcap", other)
    judged = verdict(track_log(tmp_path / "other.mcap", files[1], l1=CASE.arm.l1, l2=CASE.arm.l2))
    assert judged.grade == "failed"


@pytest.mark.parametrize("knows", ["identified", "stated"])
def test_lengths_that_contradict_the_arms_result_fail_whoever_takes_them(
    picking: algid.Log, knows: str
) -> None:
    arm, noise = CASE.arm, Sensors(1e-3, 1e-2)
    unloaded, loaded = algid.synthesise("case1", duration=2.0, torque="wide", sensors=noise)
    lengths: dict[str, Any] = {"l1": arm.l1, "l2": arm.l2} if knows == "stated" else {}
    known = algid.identify(unloaded, loaded, **lengths)
    log = noisy(picking, np.random.default_rng(4))
    found = algid.track(log, known, l1=0.2, l2=0.2)
    contradicted = [one.text for one in found.notices if one.code == "LENGTH_CONTRADICTED"]
    assert [text.partition(",")[0] for text in contradicted] == [
        "l1 is given as 0.2 m",
        "l2 is given as 0.2 m",
    ]
    assert verdict(found).sentence.startswith("Failed: a link length contradicts the arm's result")
    again = algid.identify(None, loaded, parameters=known, l1=0.2, l2=0.2)
    assert again.verdict.failed
    assert "LENGTH_CONTRADICTED" in [one.code for one in again.notices]
    right = algid.track(log, known, l1=arm.l1, l2=arm.l2)
    assert not verdict(right).failed
    assert not {"LENGTH_CONTRADICTED", "ARM_DOUBTFUL"} & {one.code for one in right.notices}
    assert "ARM_DOUBTFUL" in [one.code for one in algid.track(log, again).notices]


def test_the_command_prints_json_alone_and_keeps_what_is_there(
    files: tuple[Path, Path], tmp_path: Path
) -> None:
    lengths = ["--l1", str(CASE.arm.l1), "--l2", str(CASE.arm.l2)]
    command = ["track", str(files[0]), "--parameters", str(files[1]), *lengths, "-o", str(tmp_path)]
    done = CliRunner().invoke(app, [*command, "--format", "json", "--export", "mcap"])
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["schema_version"] == 2
    folder = tmp_path / "picking.track"
    assert f"wrote {folder}\n" in done.stderr
    names = {
        "track.json",
        "track.parquet",
        "stretches.parquet",
        "report.html",
        "report.md",
        "track.mcap",
    }
    assert {path.name for path in folder.iterdir()} == names
    again = CliRunner().invoke(app, command)
    assert "exists already" in str(again.exception)


def test_a_track_is_read_back_as_it_was(result: TrackResult, tmp_path: Path) -> None:
    folder = tmp_path / "picking.track"
    write_track(result, folder)
    told = json.loads((folder / "track.json").read_text(encoding="utf-8"))
    for one, row, status in zip(
        told["stretches"], result.track.stretches, result.statuses, strict=True
    ):
        assert (one["m_p"], one["ci95"], one["status"]) == (row.m_p, [*row.ci95], status.value)
        assert (one["unit"], one["truth"]) == ("kg", pytest.approx(row.m_p, abs=6 * row.std))
    page = Page((folder / "report.html").read_text(encoding="utf-8"))
    names = ["Payload by stretch", "Changes", "Fit", "Logs", "Channels", "Settings", "Provenance"]
    assert list(page.tables) == names
    noise = page.tables["Fit"][1][1][1]
    assert float(noise) == pytest.approx(result.track.colour**0.5, rel=0.01)
    assert "<title>picking.mcap · algid</title>" in page.text
    masses = [f"{one.m_p:.4g} ± {one.std:.2g}" for one in result.track.stretches]
    assert f"by stretch {', '.join(masses)} kg" in repr(result)
    for words in ("Payload in time", "Data quality", "Settings and provenance", "arm of arm.algid"):
        assert words in page.prose
    again = read_track(folder)
    assert track_json(again) == track_json(result)
    assert verdict(again) == verdict(result)
    for name in ("t", "m_p", "left", "changes", "holes"):
        np.testing.assert_array_equal(getattr(again.track, name), getattr(result.track, name))
    # the band is kept as its upper end: rounding of m_p, over the interval's half width
    np.testing.assert_allclose(again.track.std, result.track.std, rtol=1e-9)


@pytest.mark.parametrize("damage", ['{"stretches": []}', "[]", "{", '{"stretches": 3}', ""])
def test_a_damaged_track_is_refused_in_one_line(
    result: TrackResult, tmp_path: Path, damage: str
) -> None:
    folder = tmp_path / "picking.track"
    write_track(result, folder)
    (folder / "track.json").write_text(damage or track_json(result).replace('"sha256"', '"sum"'))
    with pytest.raises(
        ResultError, match=r"track\.json: (not JSON|.*(required|expected|valid|sha256))"
    ) as refused:
        read_track(folder)
    assert "\n" not in str(refused.value)


def test_a_curve_without_rows_or_intervals_is_refused(result: TrackResult, tmp_path: Path) -> None:
    write_track(result, tmp_path / "picking.track")
    curve = tmp_path / "picking.track" / "track.parquet"
    whole = pl.read_parquet(curve)
    for damaged in (whole.head(0), whole.with_columns(high=pl.col("m_p") - 1.0)):
        damaged.write_parquet(curve)
        with pytest.raises(ResultError, match=r"track\.parquet: it holds no rows, or rows without"):
            read_track(curve.parent)
