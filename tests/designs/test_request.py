"""Limits out of flags and files: every form that is taken, and the exact line that refuses what is
not.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from algid.base.errors import SettingError
from algid.designs.limits import limits_of, request

LENGTHS = np.array([0.4, 0.3])
GIVEN: dict[str, Any] = {"range": "1.2", "speed": "3", "torque": "5"}


UP = np.array([-np.pi / 2, 0.0])
"""The middle of a range that is given to both sides of hanging."""


@pytest.mark.parametrize(
    ("name", "given", "expected"),
    [
        ("speed", "3", [3, 3]),
        ("speed", "3,4.5", [3, 4.5]),
        ("speed", (1, 2), [1, 2]),
        ("acceleration", "1e1", [10, 10]),
        ("torque", "5,inf", [5, np.inf]),
        ("torque", 5.0, [5, 5]),
        ("range", " 1.2 , 1 ", np.stack([UP - [1.2, 1], UP + [1.2, 1]], axis=1)),
        ("range", "-2.7:-0.4,-1.2:1.2", [[-2.7, -0.4], [-1.2, 1.2]]),
        ("range", ((-2.7, -0.4), (-1.2, 1.2)), [[-2.7, -0.4], [-1.2, 1.2]]),
        ("runs", "2,0", [2, 0]),
        ("runs", (0, 1), [0, 1]),
    ],
)
def test_text_numbers_and_lines_of_a_file_mean_the_same(
    name: str, given: Any, expected: Any, tmp_path: Path
) -> None:
    np.testing.assert_allclose(getattr(request(None, GIVEN | {name: given}), name), expected)
    file = tmp_path / "limits.toml"
    content = GIVEN | {name: given}
    lines = [f"{key} = {json.dumps(value)}" for key, value in content.items()]
    file.write_text("\n".join(lines), encoding="utf-8")
    np.testing.assert_allclose(getattr(request(file, {}), name), expected)
    over = request(file, {name: content[name], "rate": 250})
    np.testing.assert_allclose(getattr(over, name), expected)
    assert (over.rate, over.duration) == (250, 10)


@pytest.mark.parametrize(
    ("line", "place"),
    [
        ("speed = 0", "speed"),
        ("speed = [1, 2, 3]", "speed"),
        ("torque = -1", "torque"),
        ("runs = [1.5, 1]", "runs"),
        ("runs = [-1, 1]", "runs"),
        ("rate = inf", "rate"),
        ("duration = 0", "duration"),
        ("range = 'wide'", "range"),
        ("pace = 1", "pace"),
    ],
)
def test_a_line_of_a_file_that_means_nothing_is_named(
    line: str, place: str, tmp_path: Path
) -> None:
    file = tmp_path / "limits.toml"
    name = line.partition(" =")[0]
    given = {key: value for key, value in GIVEN.items() if key != name}
    file.write_text(f"{line}\n", encoding="utf-8")
    with pytest.raises(SettingError) as refused:
        request(file, given)
    assert str(refused.value).startswith(f"{file}: {place}")
    assert "\n" not in str(refused.value)


def test_limits_are_a_pair_of_joints_and_infinite_where_none_is_told() -> None:
    limits = limits_of(request(None, {**GIVEN, "torque": "5,0.5", "range": "1.2,0.7"}), LENGTHS)
    np.testing.assert_allclose(limits.ends, np.add.outer([-1, 1], [0, 0]) * [1.2, 0.7] + UP)
    assert limits.allowed["torque"].tolist() == [5.0, 0.5]
    assert limits.allowed["acceleration"].tolist() == [np.inf, np.inf]
    assert limits.height == -np.inf
    whole = limits_of(request(None, {**GIVEN, "range": "inf", "tip_height": 0.1}), LENGTHS)
    np.testing.assert_array_equal(whole.ends, [[-np.inf] * 2, [np.inf] * 2])
    np.testing.assert_array_equal(whole.middle, [-np.pi / 2, 0])
    assert whole.height == 0.1
    with pytest.raises(SettingError, match=r"^--set tip_height: the link lengths are not known"):
        limits_of(request(None, {**GIVEN, "tip_height": 0.1}), np.full(2, np.nan))
