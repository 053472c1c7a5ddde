"""MCAP files against the mcap library's reader."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from algid.base.errors import OutputError
from algid.log import Log, Origin
from algid.writers import mcap, write_log

ROWS = 1000
TOPICS = (mcap.TOPIC, mcap.REFERENCES)


def log_of(rows: int, *, velocity: bool, start: int = 1_700_000_000_000_000_000) -> Log:
    draw = np.random.default_rng(1)
    theta, tau, omega = draw.normal(size=(3, 2, rows))
    stamps = start + 1_000_000 * np.arange(rows)
    return Log(stamps, theta, tau, Origin("", "", {}), omega if velocity else None)


def facts(path: Path) -> list[tuple[str, int, int, bytes]]:
    """Topic, stamp, sequence and content of each message, as the mcap library reads them."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        return [
            (channel.topic, one.log_time, one.sequence, one.data)
            for _, channel, one in reader.iter_messages()
        ]


@pytest.mark.parametrize("velocity", [True, False])
@pytest.mark.parametrize("block", [ROWS, 333])
def test_every_sample_is_a_message_however_the_log_is_cut(
    tmp_path: Path, velocity: bool, block: int
) -> None:
    log = log_of(ROWS, velocity=velocity)
    log = replace(log, reference=-log.theta)
    path = tmp_path / "log.mcap"
    mcap.write(path, [log.part(at, min(at + block, ROWS)) for at in range(0, ROWS, block)])
    states, followed = ([one for one in facts(path) if one[0] == topic] for topic in TOPICS)
    stamps = log.stamp_ns.tolist()
    contents = [row.tobytes() for row in mcap.messages(path, log)[TOPICS[0]]]
    numbers = range(ROWS)
    assert states == [*zip([TOPICS[0]] * ROWS, stamps, numbers, contents, strict=True)]
    assert [one[1:3] for one in followed] == [*zip(stamps, numbers, strict=True)]


def test_a_log_without_samples_is_a_file_without_messages(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    mcap.write(path, [log_of(0, velocity=False)])
    assert facts(path) == []


@pytest.mark.parametrize("start", [-1, 2**31 * 10**9 - 5_000_000])
def test_stamps_that_no_header_holds_are_refused_in_one_line(tmp_path: Path, start: int) -> None:
    path = tmp_path / "log.mcap"
    with pytest.raises(
        OutputError, match=r"log\.mcap: .* times from 1970 to 2038 .* found "
    ) as told:
        write_log(path, log_of(ROWS, velocity=False, start=start))
    assert "\n" not in str(told.value)
    assert list(tmp_path.iterdir()) == []
