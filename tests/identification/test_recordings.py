"""Logs opened, and passes over them: what is refused, counted, hashed, kept, and told
on the way.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from algid.base.errors import LogError, SettingError
from algid.identification.identify import identify
from algid.identification.recordings import (
    Recordings,
    Staged,
    open_source,
    open_sources,
)
from algid.log import Log, Origin, Truth
from algid.notices import of_codes
from algid.settings import Settings
from algid.synth.cases import load_case
from algid.writers import write_log
from pipelines.saturation import log_of
from tests.identification.fits import in_blocks

ARM = load_case("case1").arm


def moving(
    name: str = "log.csv", samples: int = 600, payload: float | None = None, **origin: object
) -> Log:
    """An arm that swings at 1 kHz, whose first stamp is not zero."""
    t = np.arange(samples) * 1e-3
    theta = np.stack([np.sin(9 * t) - 1.5, np.cos(7 * t)])
    truth = None if payload is None else Truth(ARM, payload)
    stamps = 5_000_000_000 + np.arange(samples) * 1_000_000
    came = Origin(name, "csv", {}, truth, **origin)  # type: ignore[arg-type]
    return Log(stamps, theta, 3 * np.cos(theta), came)


@pytest.mark.parametrize(
    ("payload", "role", "said"),
    [
        (
            0.2,
            "unloaded",
            (
                "expected a log of the unloaded arm, its metadata say a payload of 0.2 kg; give "
                "it as a loaded one"
            ),
        ),
        (
            0.0,
            "loaded",
            (
                "expected a log of the loaded arm, its metadata say no payload; give it as an "
                "unloaded one"
            ),
        ),
    ],
)
def test_a_log_of_the_other_role_is_refused_and_one_of_its_own_is_not(
    payload: float, role: str, said: str
) -> None:
    log = moving(payload=payload)
    with pytest.raises(LogError, match=f"^log.csv: {said}$"):
        open_source(log, role)  # type: ignore[arg-type]
    open_source(log, "loaded" if role == "unloaded" else "unloaded")
    open_source(log, role, changing=True)  # type: ignore[arg-type]
    open_source(moving(), role)  # type: ignore[arg-type]


def test_hashes_are_those_of_the_bytes(tmp_path: Path) -> None:
    log = moving()
    write_log(tmp_path / "log.csv", log)
    expected = hashlib.sha256((tmp_path / "log.csv").read_bytes()).hexdigest()
    source = open_source(tmp_path / "log.csv", "unloaded")
    assert Recordings([source]).summary(source).sha256 == expected
    copy = open_source(Staged(tmp_path / "log.csv", "s3://bucket/log.csv"), "unloaded")
    summary = Recordings([copy]).summary(copy)
    assert (summary.path, summary.sha256) == ("s3://bucket/log.csv", expected)
    arrays = b"".join(array.tobytes() for array in (log.stamp_ns, *log.theta, *log.tau))
    memory = open_source(log, "unloaded")
    assert Recordings([memory]).summary(memory).sha256 == hashlib.sha256(arrays).hexdigest()


def test_no_samples_count_twice_whatever_their_file() -> None:
    """Copies, rounded as a text format does or cut out, against a second run of the same motion."""
    rng = np.random.default_rng(0)
    one, other = moving("one.csv"), moving("other.csv")
    for log in (one, other):
        log.tau[:] += 1e-2 * rng.standard_normal(log.tau.shape)
    rounded = replace(one, tau=np.round(one.tau, 4), origin=replace(one.origin, path="text.csv"))
    part = one.part(100, len(one) // 2)
    first, last = one.part(0, 2 * len(one) // 3), one.part(len(one) // 3, len(one))

    def counted(*logs: Log) -> tuple[list[int], list[str]]:
        survey = Recordings(open_sources(logs, None))
        survey.count_once()
        return [log.rows or 0 for log in survey.logs], [
            notice.text
            for log in survey.logs
            for notice in log.notices
            if notice.code == "SAME_LOG"
        ]

    assert counted(one, other) == ([len(one), len(other)], [])
    twice = "text.csv and one.csv have the same samples, and count once"
    assert counted(part, one, other, rounded) == ([len(one), len(other)], [twice])
    half = "50 % of the samples of one.csv (2) are in one.csv too, and count twice"
    again = "one.csv (3) has the same samples, and counts once"
    assert counted(first, last, first) == ([len(first), len(last)], [half, again])
    assert counted(one) == ([0], [])
    assert open_sources(None, None) == []
    assert [source.name for source in open_sources(iter([one]), None)] == ["one.csv"]


@pytest.mark.parametrize(("cuts", "alone"), [([], True), ([599], False), ([300], False)])
def test_the_named_checks_refuse_a_log_only_where_they_see_all_of_it(
    cuts: list[int], alone: bool
) -> None:
    dead = replace(moving(), tau=np.zeros((2, 600)))
    survey = Recordings([in_blocks(dead, cuts)])
    if alone:
        with pytest.raises(LogError, match="EFFORT_ZERO"):
            list(survey.segments(survey.logs[0]))
    else:
        assert sum(map(len, survey.segments(survey.logs[0]))) == 600
        assert any(notice.code == "EFFORT_ZERO" for notice in survey.whole(survey.logs[0]).notices)


def test_a_log_whose_payload_changes_is_sent_to_track() -> None:
    log = moving(payload=0.0)
    assert log.origin.truth is not None
    truth = replace(log.origin.truth, schedule=((0.3, 0.2),))
    with pytest.raises(LogError, match=r"^log.csv: .* payload changes; weigh it with algid track$"):
        open_source(replace(log, origin=replace(log.origin, truth=truth)), "unloaded")


def test_stamps_that_no_arm_is_sampled_by_are_refused_by_the_name_of_their_log() -> None:
    log = moving()
    fast = replace(log, stamp_ns=np.arange(len(log), dtype=np.int64))
    with pytest.raises(LogError, match=r"^log.csv: its stamps are 1 ns apart"):
        identify(fast)


def test_samples_beyond_a_limit_are_counted_over_all_blocks() -> None:
    _, log = log_of("case1", "sensor", 0.6, 0)
    recording = in_blocks(log, [3000, 7000])
    survey = Recordings([recording])
    list(survey.segments(recording))
    told = of_codes(survey.noticed()[0], "CLIPPED_TORQUE")
    for one, tau in zip(told, log.tau, strict=True):
        assert one.numbers["count"] == np.count_nonzero(np.abs(tau) >= one.numbers["level"]) > 700


def test_one_log_cannot_be_cross_validated() -> None:
    with pytest.raises(SettingError, match="expected two unloaded logs or more, found one"):
        identify(moving(samples=3000), settings=Settings(cross_validate=True))
