from __future__ import annotations

import json
import shutil
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pyarrow.parquet as pq
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from algid.base.errors import OutputError, ResultError
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


def test_the_log_holds_predicted_torque_residual_and_estimates(
    messages: dict[str, list[Any]],
) -> None:
    assert set(messages) == {
        "/algid/measured",
        "/algid/log2/measured",
        "/algid/predicted",
        "/algid/residual",
        "/algid/log2/predicted",
        "/algid/log2/residual",
        "/algid/estimates",
        "/algid/loaded",
    }


def test_torques_are_bit_for_bit_those_of_the_parquet(
    messages: dict[str, list[Any]], case_folder: Path
) -> None:
    rows = pl.read_parquet(case_folder / "torque.parquet").filter(pl.col("log") == 0)
    predicted = np.array(
        [message.decoded_message.effort for message in messages["/algid/predicted"]]
    )
    residual = np.array([message.decoded_message.effort for message in messages["/algid/residual"]])
    np.testing.assert_array_equal(
        predicted, rows.select("tau1_predicted", "tau2_predicted").to_numpy()
    )
    measured = rows.select("tau1", "tau2").to_numpy()
    np.testing.assert_array_equal(residual, measured - predicted)
    assert messages["/algid/predicted"][0].decoded_message.name == ["joint1", "joint2"]


def test_what_was_measured_stands_beside_it_bit_for_bit(
    messages: dict[str, list[Any]], case_folder: Path
) -> None:
    rows = pl.read_parquet(case_folder / "torque.parquet")
    for log, topic in ((0, "/algid/measured"), (1, "/algid/log2/measured")):
        own = rows.filter(pl.col("log") == log)
        for field, name in (("position", "theta"), ("velocity", "omega"), ("effort", "tau")):
            found = np.array(
                [getattr(message.decoded_message, field) for message in messages[topic]]
            )
            np.testing.assert_array_equal(found, own.select(f"{name}1", f"{name}2").to_numpy())


def test_stamps_are_those_of_the_original_log(messages: dict[str, list[Any]]) -> None:
    found = messages["/algid/residual"]
    assert [message.message.log_time for message in found[:3]] == [
        START_NS,
        START_NS + 1_000_000,
        START_NS + 2_000_000,
    ]
    stamp = found[1].decoded_message.header.stamp
    assert stamp.sec * 1_000_000_000 + stamp.nanosec == START_NS + 1_000_000
    assert messages["/algid/loaded"][0].message.log_time == START_NS


def test_a_folder_without_a_result_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ResultError, match=r"result\.json: cannot read it"):
        export_mcap(tmp_path)
    (tmp_path / "run1.algid").mkdir()
    with pytest.raises(ResultError, match=r"; name .*run1\.algid$"):
        export_mcap(tmp_path)


@pytest.mark.parametrize("name", ["torque", "estimates"])
def test_stamps_that_no_message_holds_are_refused(
    name: str, case_folder: Path, tmp_path: Path
) -> None:
    folder = Path(shutil.copytree(case_folder, tmp_path / case_folder.name))
    (folder / "estimates.mcap").unlink(missing_ok=True)
    path = folder / f"{name}.parquet"
    table = pq.read_table(path)
    late = {START_KEY: json.dumps([2**31 * 10**9] * 2)}
    pq.write_table(table.replace_schema_metadata({**(table.schema.metadata or {}), **late}), path)
    with pytest.raises(OutputError, match=rf"{name}\.parquet: ROS 2 messages hold times from 1970"):
        export_mcap(folder)
    assert not (folder / "estimates.mcap").exists()
