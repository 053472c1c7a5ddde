"""Every refusal that a flag overrides: what is refused, the flag that its message names, and the
warning that stays.

`REFUSALS` is the table of them. A refusal that is not in it cannot be overridden: the file is
missing, damaged, cut off, of another format, or changed since algid wrote it.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from algid.base.errors import LogError, SettingError
from algid.log import Log
from algid.profile import Profile, load_profile, with_settings
from algid.readers import read_log
from algid.writers import write_log
from tests.cli.commands import profile_from
from tests.inspection.test_checks import moving_log, noticed, spoiled
from tests.readers.logs import EPOCH_NS
from tests.readers.ways import Message, States, written

ROWS = 40


@dataclass(frozen=True)
class Refusal:
    """A log that is refused, words of the message, flags that it names, and the code of the
    warning that stays.
    """

    make: Callable[[Path], Path]
    words: str
    flags: str
    warning: str | None = None


def table(header: str, **columns: Any) -> Callable[[Path], Path]:
    """A CSV file; columns that are not given move."""

    def make(folder: Path) -> Path:
        names = header.split(",")
        t = np.arange(ROWS) * 1e-3
        values = [columns.get(name, np.sin(5 * t + place)) for place, name in enumerate(names)]
        rows = [[f"{value[row]:.9g}" for value in values] for row in range(ROWS)]
        if names[0] not in columns:
            for row in range(ROWS):
                rows[row][0] = f"{t[row]:.6f}"
        (folder / "log.csv").write_text("\n".join([header, *map(",".join, rows)]) + "\n")
        return folder / "log.csv"

    return make


def found(code: str) -> Callable[[Path], Path]:
    """The log that a check is for, in a file."""

    def make(folder: Path) -> Path:
        log = spoiled(code)
        write_log(folder / "log.parquet", log)
        return folder / "log.parquet"

    return make


def continuous(folder: Path) -> Path:
    """Joints many turns from their zero, under torques of which no convention makes sense."""
    log = moving_log()
    theta = log.theta.copy()
    theta[0] += 2 * np.pi * 8
    tau = np.random.default_rng(2).standard_normal(log.tau.shape)
    write_log(folder / "log.parquet", Log(log.stamp_ns, theta, tau, log.origin))
    return folder / "log.parquet"


def states(topics: tuple[str, ...], names: tuple[str, ...]) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        found = []
        for stamp in range(EPOCH_NS, EPOCH_NS + ROWS * 1_000_000, 1_000_000):
            values = [0.1 * place + np.sin(stamp) for place in range(len(names))]
            found += [Message(values, values, stamp, stamp, names, topic=topic) for topic in topics]
        return Path(written("cdr", folder, States(found)))

    return make


def no_stamps(folder: Path) -> Path:
    """JSON joint states whose headers are beyond every date."""
    rows = enumerate(np.sin(np.arange(ROWS)))
    found = [Message((q, 1 + q), (q, 1 - q), 10**309, row * 1_000_000) for row, q in rows]
    return Path(written("json", folder, States(found)))


def with_nan() -> Callable[[Path], Path]:
    broken = np.sin(np.arange(ROWS))
    broken[7] = np.nan
    return table("t,q1,q2,tau1,tau2", q2=broken)


REFUSALS = {
    "continuous joints": Refusal(continuous, "DEGREES", "--angle-unit rad", "DEGREES"),
    "degrees by velocity": Refusal(found("DEGREES"), "DEGREES", "--angle-unit rad", "DEGREES"),
    "current without its constant": Refusal(
        table("t,q1,q2,current1,current2"),
        "torque_constant",
        "--set tau1.torque_constant=0.1 --set tau2.torque_constant=0.1",
    ),
    "current that is a torque": Refusal(
        table("t,q1,q2,current1,current2"), "unit",
        "--set 'tau1.unit=\"N m\"' --set 'tau2.unit=\"N m\"'", "OTHER_UNIT",
    ),
    "counts": Refusal(
        table("t,q1_counts,q2_counts,tau1,tau2"), "counts a turn", "--set theta1.counts=4096 "
                                                                   "--set theta2.counts=4096"
    ),
    "inches": Refusal(
        table("t,q1 [inch],q2,tau1,tau2"), "is in 'inch'; expected one of rad, mrad",
        '--set theta1.unit="rad"', "OTHER_UNIT",
    ),
    "a torque in degrees": Refusal(
        table("t,q1,q2,tau1 [deg],tau2"), "expected one of", "--set 'tau1.unit=\"N m\"'"
    ),
    "motor torques beside joint angles": Refusal(
        table("t,joint1_pos,joint2_pos,motor1_torque,motor2_torque"),
        "motors beside",
        "--set tau1.gear_ratio=1 --set tau2.gear_ratio=1",
    ),
    "missing columns": Refusal(table("t,q1,q2,tau1,b"), "no column for tau1, tau2",
                               "--set tau1.source=tau1 --set tau2.source=b"),
    "missing time": Refusal(table("when,q1,q2,tau1,tau2"), "no column for t", "--set time=when"),
    "three joints": Refusal(table("t,q1,q2,q3,tau1,tau2,tau3"), "3 joints", "--joints 1,3"),
    "joints that are not there": Refusal(
        table("t,a_pos,b_pos,a_torque,b_torque"), "", "--joints a,b"
    ),
    "one name twice": Refusal(table("t,q1,q_1,q2,tau1,tau2"), "are both q of joint 1",
                              "--set theta1.source=q1 --set theta2.source=q2"),
    "time that stands still": Refusal(
        table("t,q1,q2,tau1,tau2,time_s", t=np.zeros(ROWS), time_s=np.arange(ROWS) * 1e-3),
        "time stands still", "--set time=time_s"),
    "a value that is no number": Refusal(
        with_nan(), "finite number", "--accept NOT_FINITE", "NOT_FINITE"
    ),
    "header stamps that are none": Refusal(no_stamps, "header stamp with", "--set clock=log"),
    "two topics": Refusal(states(("/one", "/two"), ("j1", "j2")), "/one, /two", "--topic /two"),
    "three joints of a topic": Refusal(
        states(("/one",), ("j1", "j2", "j3")), "3 joints", "--joints j1,j3"
    ),
}  # fmt: skip


def settings_of(flags: str) -> Profile:
    """The profile that flags of the command line mean."""
    words, given = shlex.split(flags), dict[str, Any]()
    for flag, value in zip(words[::2], words[1::2], strict=True):
        if flag == "--set":
            given.setdefault("set", []).append(value)
        else:
            given[flag[2:].replace("-", "_")] = value
    return profile_from(given)


@pytest.mark.parametrize("name", REFUSALS)
def test_each_refusal_yields_to_the_flag_it_names(name: str, tmp_path: Path) -> None:
    refusal = REFUSALS[name]
    path = refusal.make(tmp_path)
    if refusal.words:
        with pytest.raises(LogError) as refused:
            noticed(read_log(path))
        assert refusal.words in str(refused.value)
        first = re.match(r"--[\w-]+ '?[\w./]+", refusal.flags)
        named = first[0].rpartition(" ")[0] if "--set" not in refusal.flags else first[0]
        assert named in str(refused.value)
        assert flag_first(str(refused.value)), refused.value
        assert "\n" not in str(refused.value)
    log = read_log(path, settings_of(refusal.flags))
    seen = (*log.notices, *noticed(log))
    if refusal.warning:
        assert refusal.warning in [notice.code for notice in seen]


TAKEN = {"source": "position[a]", "topic": "/other"}
WRONG: dict[str, tuple[Callable[[Path], Path], dict[str, Any], str]] = {
    "a column that is not there": (
        table("t,q1,q2,tau1,tau2"), {"theta1": {"source": "b"}}, "--set theta1.source=NAME"
    ),
    "a time that is not there": (table("t,q1,q2,tau1,tau2"), {"time": "b"}, "--set time=NAME"),
    "a field that is not there": (
        states(("/one",), ("a", "b")), {"theta1": {"source": "b", "topic": "/one"}},
        "--set theta1.source=NAME",
    ),
    "a topic that is not there": (
        states(("/one",), ("a", "b")), {"tau1": TAKEN}, "--set tau1.topic=NAME"
    ),
    "joints that are not there": (
        states(("/one",), ("a", "b")), {"joints": ("c", "d")}, "--joints A,B"
    ),
}  # fmt: skip
"""Logs that a profile makes invalid, the profile, and the flag that the message names."""


def flag_first(message: str) -> bool:
    """Whether a flag stands before the first word of a profile in a message."""
    place = re.search(r"\bprofiles?\b", message)
    return place is None or re.search(r"--[a-z]", message[: place.start()]) is not None


@pytest.mark.parametrize("name", WRONG)
def test_what_a_profile_says_wrongly_is_mended_by_a_flag(name: str, tmp_path: Path) -> None:
    make, settings, flag = WRONG[name]
    with pytest.raises(LogError) as refused:
        read_log(make(tmp_path), with_settings(Profile(), settings))
    assert f" {flag}" in str(refused.value)
    assert flag_first(str(refused.value)), refused.value


@pytest.mark.parametrize(
    "header", ["t,q1,q2,q_cmd,q_ref,tau1,tau2", "t,max_pos,min_pos,q1,q2,tau1,tau2"]
)
def test_words_that_are_no_joints_are_let_be(header: str, tmp_path: Path) -> None:
    assert read_log(table(header)(tmp_path)).origin.mapping["theta1"] == "q1"


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("topics = 1", "topics.*not permitted"),
        ('[theta1]\nunit = "grad"', "theta1.unit"),
        ("[tau1]\ntorque_constant = -1", "torque_constant"),
        ("signs = [2, 1]", "signs"),
        ("gravity = nan", "gravity"),
        ("= 3", "not TOML"),
    ],
)
def test_profiles_are_strict(text: str, told: str, tmp_path: Path) -> None:
    (tmp_path / "algid.toml").write_text(text)
    with pytest.raises(SettingError, match=told):
        load_profile(tmp_path / "algid.toml")
    with pytest.raises(SettingError, match="cannot read it"):
        load_profile(tmp_path / "none.toml")
