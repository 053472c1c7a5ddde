"""What is said of files that are rare: where reading refuses, leaves out or names its sources."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import algid
from algid.base.errors import LogError
from algid.log import Log
from algid.profile import Profile
from algid.readers import read_log
from algid.readers.memory import checked, with_profile
from tests.readers.logs import EPOCH_NS, noise_log
from tests.readers.ways import json_mcap, json_state, sent

LOG = noise_log(40, start_ns=EPOCH_NS, velocity=False)
HEAD = "t,theta1,theta2,tau1,tau2"
ROWS = [f"{row / 100},{row % 7},{row % 5},{row % 3},{row % 4}" for row in range(40)]
STATES = [json_state(one) for one in sent(LOG)]


def csv(folder: Path, *rows: str) -> Path:
    path = folder / "log.csv"
    path.write_text("\n".join(rows))
    return path


def states(folder: Path, *texts: str) -> Path:
    return json_mcap(folder, zip(LOG.stamp_ns.tolist(), texts, strict=True))


def test_header_stamps_that_messages_lack_are_refused(tmp_path: Path) -> None:
    path = states(tmp_path, *(json.dumps(one | {"header": {}}) for one in STATES))
    with pytest.raises(LogError, match=r"'/arm' carry no stamp: .*--set clock=log"):
        read_log(path, Profile(clock="header"))
    assert len(read_log(path)) == 40
    stamped = states(tmp_path, *map(json.dumps, STATES))
    assert len(read_log(stamped, Profile(clock="header"))) == 40


def test_a_json_message_that_names_a_field_twice_is_left_out(tmp_path: Path) -> None:
    texts = list(map(json.dumps, STATES))
    texts[7] = texts[7].replace("{", '{"effort": [1.0, 2.0], ', 1)
    found = read_log(states(tmp_path, *texts))
    (left_out,) = (one.text for one in found.notices if one.code == "MESSAGES_LEFT_OUT")
    assert len(found) == 39
    assert "a JSON message that names 'effort' twice" in left_out


def test_a_table_of_lists_without_rows_is_refused(tmp_path: Path) -> None:
    lists = pa.list_(pa.float64())
    empty = pa.table({name: pa.array([], lists) for name in ("position", "effort")})
    pq.write_table(empty.append_column("t", pa.array([], pa.float64())), tmp_path / "log.parquet")
    with pytest.raises(LogError, match=r"log\.parquet: "):
        read_log(tmp_path / "log.parquet")


def test_joints_whose_columns_are_all_named_are_the_users(tmp_path: Path) -> None:
    path = csv(tmp_path, HEAD, *ROWS)
    assert read_log(path).origin.reading.joints_told == "names"
    told = {name: {"source": name} for name in HEAD.split(",")[1:]}
    assert read_log(path, Profile(**told)).origin.reading.joints_told == "profile"  # type: ignore[arg-type]


def test_channels_are_listed_by_their_topics(tmp_path: Path) -> None:
    (entry,) = algid.inspect(states(tmp_path, *map(json.dumps, STATES))).entries
    assert (entry.name, entry.count) == ("/arm", 40)


def test_a_log_in_memory_takes_what_is_said_of_it_and_has_two_samples() -> None:
    arrays = np.arange(8.0).reshape(4, 2)
    log = Log.from_arrays(np.array([0.0, 0.1]), arrays[:2], arrays[2:], name="run")
    assert with_profile(log, Profile(zero="hanging")).theta[0, 0] != log.theta[0, 0]
    with pytest.raises(LogError, match="run: expected two samples or more, found 1; record"):
        checked(log.part(0, 1))
