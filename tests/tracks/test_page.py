"""A track's folder: the same digits everywhere, a page that opens offline, a log for other
viewers.
"""

from __future__ import annotations

import json
import math
import re
import shutil
from collections.abc import Iterator
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
from algid.base.errors import ResultError
from algid.base.verdict import Verdict
from algid.identification.identify import identify
from algid.notices import Notice
from algid.report.render import markdown, page
from algid.synth.sensors import Sensors
from algid.tracks.page import track_document, write_track
from algid.tracks.payload import Stretch
from algid.tracks.read import COLUMNS, CURVE, read_track
from algid.tracks.result import StretchStatus, TrackResult, track_json
from algid.tracks.run import track_log
from algid.tracks.tables import change_table, fixed, stretch_table, verdict
from algid.writers import write_log
from tests.cli.commands import app
from tests.report.browser import DRIVER, Browser
from tests.report.folders import HOSTILE
from tests.report.test_browser import assert_sound
from tests.terminals import shown
from tests.tracks.folders import CASE, noisy

START_NS = 1_700_000_000_000_000_000


@pytest.fixture(scope="module")
def files(picking: algid.Log, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A log with its schedule, and the result of its arm."""
    folder = tmp_path_factory.mktemp("track")
    unloaded, _ = algid.synthesise(
        "case1", duration=2.0, excitation="wide", sensors=Sensors(1e-3, 1e-2)
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


def test_the_sentence_tells_changes_and_masses(result: TrackResult) -> None:
    judged = verdict(result)
    assert judged.grade == "good", judged
    first, second = result.track.changes[:, 0]
    assert f" at {first:.2f} and {second:.2f} s, " in judged.sentence
    assert re.fullmatch(
        r"Good: the payload changes twice at 1\.\d+ and [23]\.\d+ s, "
        r"weighing 0, 0\.0[45]\d+ and 0 kg, "
        r"the least certain to ± 0\.00\d+ kg \(95 %\)\.",
        judged.sentence,
    )


def test_every_format_shows_the_same_digits(result: TrackResult) -> None:
    rows = [*stretch_table(result).rows, *change_table(result).rows]
    document = track_document(result)
    shown, text = page(document), markdown(document).replace("\\", "")
    for cell in {cell for row in rows for cell in row}:
        assert f">{cell}<" in shown
        assert f" {cell} |" in text
    for row, stretch in zip(rows, json.loads(track_json(result))["stretches"], strict=False):
        zero = stretch["ci95"][0] <= 0 <= stretch["ci95"][1]
        assert row[3] == ("0" if zero else fixed(stretch["m_p"], stretch["std"]))
        assert row[5:7] == (stretch["unit"], stretch["status"])


def test_the_schedule_stands_beside_the_stretches(result: TrackResult) -> None:
    stretches = json.loads(track_json(result))["stretches"]
    assert [stretch["truth"] for stretch in stretches] == [0.0, 0.05, 0.0]
    changes = change_table(result)
    assert list(changes.columns) == ["Change", "At, s", "By", "Unit", "Between, s", "Truth at, s"]
    assert [row[-1] for row in changes.rows] == ["1.500", "3.000"]
    for (_, low, high), true in zip(result.track.changes, (1.5, 3.0), strict=True):
        assert low < true < high


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


def test_masses_that_cannot_be_are_not_passed_on(result: TrackResult) -> None:
    less, still = Stretch(0.0, 1.0, -0.2, 0.01), Stretch(1.0, 2.0, 0.1, 3.0)
    found = replace(result, track=replace(result.track, stretches=[less, still, less]))
    assert found.statuses == [
        StretchStatus.NEGATIVE_MASS,
        StretchStatus.WEAK_EXCITATION,
        StretchStatus.NEGATIVE_MASS,
    ]
    judged = verdict(found)
    assert judged.grade == "failed"
    assert "2 of 3 stretches have a negative mass" in judged.sentence
    assert [reason.text for reason in judged.reasons[:2]] == [
        "stretch 2 moves too little to be weighed",
        "stretches 1 and 3: negative payload mass",
    ]


def test_the_arm_of_another_log_is_told(files: tuple[Path, Path], tmp_path: Path) -> None:
    other, _ = algid.synthesise(
        "case2", duration=2.0, excitation="wide", sensors=Sensors(1e-3, 1e-2)
    )
    write_log(tmp_path / "other.mcap", other)
    judged = verdict(track_log(tmp_path / "other.mcap", files[1], l1=CASE.arm.l1, l2=CASE.arm.l2))
    assert judged.grade == "failed"


@pytest.mark.parametrize("knows", ["identified", "stated"])
def test_lengths_that_contradict_the_arms_result_fail_whoever_takes_them(
    picking: algid.Log, knows: str
) -> None:
    arm, noise = CASE.arm, Sensors(1e-3, 1e-2)
    unloaded, loaded = algid.synthesise("case1", duration=2.0, excitation="wide", sensors=noise)
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
    assert "LENGTH_CONTRADICTED" not in [one.code for one in right.notices]


def test_names_that_attack_stay_text(result: TrackResult) -> None:
    hostile = replace(
        result,
        arm=HOSTILE,
        log=result.log.model_copy(update={"path": HOSTILE}),
        notices=(Notice("HOSTILE", HOSTILE),),
    )
    own = re.sub(
        r"<(script|style)[^>]*>.*?</\1>", "", page(track_document(hostile)), flags=re.DOTALL
    )
    assert "<img" not in own
    assert "<script" not in own


def test_the_command_prints_json_alone_and_keeps_what_is_there(
    files: tuple[Path, Path], tmp_path: Path
) -> None:
    lengths = ["--l1", str(CASE.arm.l1), "--l2", str(CASE.arm.l2)]
    command = ["track", str(files[0]), "--parameters", str(files[1]), *lengths, "-o", str(tmp_path)]
    done = CliRunner().invoke(app, [*command, "--format", "json", "--export", "mcap"])
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["schema_version"] == 2
    folder = tmp_path / "picking.track"
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


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    opened = Browser()
    yield opened
    opened.close()


@pytest.mark.slow
@pytest.mark.skipif(
    DRIVER is None or shutil.which("chromium") is None,
    reason="chromium and chromium-driver are not installed",
)
@pytest.mark.parametrize(("width", "dark"), [(1400, False), (400, True)])
def test_the_page_is_drawn_whole(
    browser: Browser, result: TrackResult, tmp_path: Path, width: int, dark: bool
) -> None:
    write_track(result, tmp_path)
    path = tmp_path / "report.html"
    seen = browser.look(path, width, dark)
    assert_sound(seen, path, "picking.mcap · algid")
    assert seen.drawn == 1


def test_a_track_is_read_back_as_it_was(result: TrackResult, tmp_path: Path) -> None:
    folder = tmp_path / "picking.track"
    write_track(result, folder)
    again = read_track(folder)
    assert track_json(again) == track_json(result)
    assert verdict(again) == verdict(result)
    for name in ("t", "m_p", "left", "changes", "holes"):
        np.testing.assert_array_equal(getattr(again.track, name), getattr(result.track, name))
    # the band is kept as its upper end: rounding of m_p, over the interval's half width
    np.testing.assert_allclose(again.track.std, result.track.std, rtol=1e-9)


def test_the_report_of_a_track_is_made_again(result: TrackResult, tmp_path: Path) -> None:
    folder = tmp_path / "picking.track"
    write_track(result, folder)
    markdown_before = (folder / "report.md").read_text(encoding="utf-8")
    (folder / "report.html").unlink()
    (folder / "report.md").unlink()
    done = CliRunner().invoke(app, ["report", str(folder)])
    assert done.exit_code == 0, done.output
    assert "Payload by stretch" in done.stdout
    assert "Payload in time" in (folder / "report.html").read_text(encoding="utf-8")
    assert (folder / "report.md").read_text(encoding="utf-8") == markdown_before


@pytest.mark.parametrize("damage", ['{"stretches": []}', "[]", "{", '{"stretches": 3}'])
def test_a_damaged_track_is_refused_in_one_line(
    result: TrackResult, tmp_path: Path, damage: str
) -> None:
    folder = tmp_path / "picking.track"
    write_track(result, folder)
    (folder / "track.json").write_text(damage)
    with pytest.raises(
        ResultError, match=r"track\.json: (not JSON|.*(required|expected|valid))"
    ) as refused:
        read_track(folder)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("key", "value"), [("stretches", []), ("excess", -1.0)], ids=["no stretch", "a negative square"]
)
def test_numbers_that_no_track_has_are_refused(
    result: TrackResult, tmp_path: Path, key: str, value: Any
) -> None:
    folder = tmp_path / "picking.track"
    write_track(result, folder)
    file = folder / "track.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {key: value}))
    with pytest.raises(ResultError, match=rf"track\.json: .*{key}"):
        read_track(folder)


@pytest.mark.parametrize("column", COLUMNS)
def test_a_curve_without_a_number_in_every_row_is_refused(
    result: TrackResult, tmp_path: Path, column: str
) -> None:
    folder = tmp_path / "picking.track"
    write_track(result, folder)
    path = folder / CURVE
    for value in (None, math.inf, -math.inf):
        pl.read_parquet(path).with_columns(pl.lit(value, pl.Float64).alias(column)).write_parquet(
            path
        )
        with pytest.raises(ResultError, match=rf"{column}.*expected a number in every row"):
            read_track(folder)


@pytest.mark.parametrize(
    ("column", "value", "expected"),
    [("t", -1e9, "times"), ("high", -1e9, "not below m_p"), ("stretch", 7777, "from 0 to")],
)
def test_a_curve_that_no_track_has_is_refused(
    result: TrackResult, tmp_path: Path, column: str, value: float, expected: str
) -> None:
    folder = tmp_path / "picking.track"
    write_track(result, folder)
    table = pl.read_parquet(folder / CURVE)
    last = pl.int_range(pl.len()) == table.height - 1
    changed = pl.when(last).then(pl.lit(value)).otherwise(pl.col(column))
    table.with_columns(changed.cast(table.schema[column]).alias(column)).write_parquet(
        folder / CURVE
    )
    with pytest.raises(ResultError, match=rf"track\.parquet: {column}: expected .*{expected}"):
        read_track(folder)


def test_what_a_track_cannot_explain_is_told_by_how_much(result: TrackResult) -> None:
    def judged(**changes: Any) -> Verdict:
        return verdict(replace(result, track=replace(result.track, **changes)))

    nothing = "arm and payload explain only 0 % of the torque: is it this arm, in these units?"
    assert judged(explained=-0.3).sentence == f"Failed: {nothing}; do not use these masses."
    strange = judged(explained=0.95, colour=250_000.0).sentence
    assert strange.startswith(
        "Failed: arm and payload miss the torque by 500 times its sensors' noise: is it this arm"
    )
    assert judged(explained=0.995, colour=250_000.0).grade == "reservations"  # very quiet sensors
    poor = judged(explained=0.8)
    assert (poor.grade, poor.reasons[0].text) == (
        "reservations",
        "arm and payload explain only 80 % of the torque",
    )
    wider = judged(colour=9.0)
    assert wider.reasons[0].text.startswith("the torque has errors of 3.0 times its sensors' noise")
    lost = verdict(replace(result, data_lost=True))
    assert [reason.code for reason in lost.reasons] == ["DATA_LOST"]
    assert lost.sentence.endswith(", but samples of the log are lost.")


def test_one_stretch_and_many_are_told_in_words(result: TrackResult) -> None:
    first = result.track.stretches[0]
    alone = replace(
        result.track, stretches=[replace(first, m_p=0.2, std=0.001)], changes=np.zeros((0, 3))
    )
    assert verdict(replace(result, track=alone)).sentence == (
        "Good: the payload does not change: 0.2000 ± 0.0020 kg throughout."
    )
    many = [replace(first, m_p=0.1 * place, std=0.001) for place in range(1, 8)]
    changes = np.stack([np.arange(1.0, 7.0)] * 3, axis=1)
    told = verdict(
        replace(result, track=replace(result.track, stretches=many, changes=changes))
    ).sentence
    assert (
        "the payload changes 6 times, in 7 stretches, the least certain to ± 0.0020 kg (95 %)"
        in told
    )
    still = [replace(first, m_p=0.1, std=3.0)]
    weak = verdict(replace(result, track=replace(alone, stretches=still)))
    assert weak.sentence.startswith("Failed: the arm moves too little to weigh anything")
    light = verdict(
        replace(result, track=replace(alone, stretches=[replace(first, m_p=-0.2, std=0.001)]))
    )
    assert light.sentence.startswith(
        "Failed: the payload has a negative mass: the arm's constants do not fit"
    )


def test_a_track_fits_a_terminal_of_eighty_columns(result: TrackResult) -> None:
    assert len(shown(track_document(result))) <= 25
