"""Logs as drivers of robots name them, and what is said where there is a choice."""

from __future__ import annotations

import json
from itertools import zip_longest
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from algid.inspection.checks import inspect_log
from algid.profile import Profile
from algid.readers import read_log
from tests.readers.logs import EPOCH_NS, noise_log
from tests.readers.mcaps import ANY, TOPIC, joint_state, write_mcap
from tests.readers.ways import States, sent, written

LOG = noise_log(80, start_ns=EPOCH_NS)
DRIVERS = {
    "libfranka": "state.q[{}] state.tau_J[{}] state.dq[{}] state.q_d[{}] state.tau_J_d[{}]",
    "franka_ros": (
        "franka_state.q[{}] franka_state.tau_J[{}] franka_state.dq[{}] franka_state.dtheta[{}]"
    ),
    "unitree": (
        "motor_state[{}].q motor_state[{}].tau_est motor_state[{}].dq motor_state[{}].temperature"
    ),
    "low_state": (
        "low_state.motor_state[{}].q low_state.motor_state[{}].tau_est low_state.motor_state[{}].dq"
    ),
    "PlotJuggler": (
        "/low_state/motor_state[{}]/q /low_state/motor_state[{}]/tau_est "
        "/low_state/motor_state[{}]/dq"
    ),
}
"""Names of angle, torque, velocity, and others of a joint."""


def columns(driver: str, joints: int) -> dict[str, object]:
    """The log as a table of a driver's names, with more joints of other values."""
    table: dict[str, object] = {"t": LOG.t}
    for joint in range(joints):
        own = joint - (joints - 2)
        for name, pair in zip_longest(DRIVERS[driver].split(), (LOG.theta, LOG.tau, LOG.omega)):
            beside = np.full(len(LOG), 7.0 if pair is None else 0.5 + joint)
            table[name.format(joint)] = beside if pair is None or own < 0 else pair[own]
    return table


@pytest.mark.parametrize("driver", DRIVERS)
@pytest.mark.parametrize("joints", [2, 7])
def test_names_of_drivers_are_known(driver: str, joints: int) -> None:
    chosen = None if joints == 2 else Profile(joints=("5", "6"))
    log = read_log(pl.DataFrame(columns(driver, joints)), chosen)
    assert np.array_equal(log.theta, LOG.theta)
    assert np.array_equal(log.tau, LOG.tau)
    assert np.array_equal(log.omega, LOG.omega)


def test_plain_columns_stand_before_those_of_a_state() -> None:
    turned = dict(zip(("q1", "q2", "tau1", "tau2"), [*(LOG.theta + 1), *LOG.tau], strict=True))
    log = read_log(pl.DataFrame(columns("libfranka", 2) | turned))
    assert np.array_equal(log.theta, LOG.theta + 1)


def test_of_two_topics_with_both_joints_it_is_said_which_was_taken(tmp_path: Path) -> None:
    messages = sent(LOG) + sent(LOG, topic="/arm/state")
    path = written("cdr", tmp_path, States(messages))
    log = read_log(path)
    (notice,) = (notice for notice in log.notices if notice.code == "JOINT_ORDER")
    assert notice.note
    assert (
        notice.text == "the joints are taken from '/joint_states'; there are two also on /arm/state"
    )
    assert [remedy.settings for remedy in notice.remedies] == [{"topic": "/arm/state"}]
    chosen = read_log(path, Profile(topic="/arm/state"))
    assert not [notice for notice in chosen.notices if notice.code == "JOINT_ORDER"]


def test_a_torque_beside_one_of_zeros_is_taken_by_its_topic_and_field(tmp_path: Path) -> None:
    messages = []
    for row, stamp in enumerate(LOG.stamp_ns.tolist()):
        state = joint_state(stamp, position=LOG.theta[:, row].tolist(), effort=[0.0, 0.0]).done()
        wrench = {"wrench": {"force": {"z": 1.0}, "torque": {"z": float(LOG.tau[0, row])}}}
        messages += [(TOPIC, stamp, state), ("/ft", stamp, json.dumps(wrench).encode())]
    write_mcap(tmp_path / "a.mcap", messages, {"/ft": ANY})
    found = inspect_log(tmp_path / "a.mcap").findings
    zeros = [one.remedies[0].settings for one in found if one.code == "EFFORT_ZERO"]
    assert zeros == [{"tau1.source": None}, {"tau2.source": None}]
    profile = {"tau1": {"topic": "/ft", "source": "wrench.torque.z"}}
    named = read_log(tmp_path / "a.mcap", Profile.model_validate(profile))
    assert np.array_equal(named.tau[0], LOG.tau[0])
