from __future__ import annotations

import json
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pyarrow.parquet as pq
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from algid.base.errors import OutputError
from algid.report.export import START_KEY, export_mcap
from tests.report.folders import START_NS


@pytest.fixture(scope="module")
def messages(case_folder: Path) -> dict[str, list[Any]]:
    """The exported messages by topic, as another library reads them."""
    return read(export_mcap(case_folder))


def read(path: Path) -> dict[str, list[Any]]:
    found = defaultdict(list)
    with path.open("rb") as stream:
        for message in make_reader(
            stream, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            found[message.channel.topic].append(message)
    return found


def test_topics_hold_every_column_bit_for_bit(
    messages: dict[str, list[Any]], case_folder: Path
) -> None:
    topics = ("torque", "log2/torque", "estimates", "loaded")
    assert set(messages) == {f"/algid/{topic}" for topic in topics}
    rows = pl.read_parquet(case_folder / "torque.parquet")
    for log, topic in ((0, "torque"), (1, "log2/torque")):
        own = rows.filter(pl.col("log") == log).drop("log", "t")
        found = [message.decoded_message for message in messages[f"/algid/{topic}"]]
        for name in own.columns:
            np.testing.assert_array_equal([getattr(one, name) for one in found], own[name])
        left = own["tau2"] - own["tau2_predicted"]
        np.testing.assert_array_equal([one.residual2 for one in found], left)
    paper = pl.read_parquet(case_folder / "loaded.parquet")
    of = [one.decoded_message.k5_k3_z1_z2 for one in messages["/algid/loaded"]]
    np.testing.assert_array_equal(of, paper["k5+k3+z1+z2"])


def test_stamps_are_those_of_the_original_log(messages: dict[str, list[Any]]) -> None:
    found = messages["/algid/torque"]
    stamps = [START_NS + 1_000_000 * place for place in range(3)]
    assert [message.message.log_time for message in found[:3]] == stamps
    stamp = found[1].decoded_message.header.stamp
    assert stamp.sec * 1_000_000_000 + stamp.nanosec == stamps[1]
    assert messages["/algid/loaded"][0].message.log_time == START_NS


def test_stamps_that_no_message_holds_are_refused(folder: Path) -> None:
    (folder / "estimates.mcap").unlink(missing_ok=True)
    path = folder / "torque.parquet"
    table = pq.read_table(path)
    late = {START_KEY: json.dumps([2**31 * 10**9] * 2)}
    pq.write_table(table.replace_schema_metadata({**(table.schema.metadata or {}), **late}), path)
    with pytest.raises(OutputError, match=r"torque\.parquet: ROS 2 messages hold times from 1970"):
        export_mcap(folder)
    assert not (folder / "estimates.mcap").exists()
