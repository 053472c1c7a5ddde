"""Messages serialised by rosbags, read by algid: the same to the last bit."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from algid.profile import Profile
from algid.readers import read_log
from tests.readers.logs import EPOCH_NS, noise_log, same
from tests.readers.mcaps import write_mcap

TOPIC = "/arm"
CHANNELS = ("theta1", "theta2", "tau1", "tau2")
CUSTOM = {
    "control_msgs/msg/InterfaceValue": "string[] interface_names\nfloat64[] values\n",
    "control_msgs/msg/DynamicJointState": (
        "std_msgs/Header header\nstring[] joint_names\ncontrol_msgs/InterfaceValue[] "
        "interface_values\n"
    ),
    "lab/msg/Joint": "bool[3] flags\nfloat32 temperature\nfloat64 angle\nchar mode\nfloat64[2] "
    "torques\n",
    "lab/msg/State": (
        "uint8 READY=1\nstring<=16 label\nuint16 errors\nlab/Joint[2] joints\nint8[] spare\n"
        "lab/Joint[<=3] more\nstring[] words\nbyte last\n"
    ),
}


@functools.cache
def store() -> Any:
    """The types of ROS 2, and those above."""
    types = get_typestore(Stores.ROS2_HUMBLE)
    types.register(
        {
            key: kind
            for name, text in CUSTOM.items()
            for key, kind in get_types_from_msg(text, name).items()
        }
    )
    return types


def made(name: str, /, **fields: Any) -> Any:
    """A message, or a part of one."""
    return store().types[name](**fields)


def header(stamp: int, frame: str) -> Any:
    """A stamped header."""
    time = made("builtin_interfaces/msg/Time", sec=stamp // 10**9, nanosec=stamp % 10**9)
    return made("std_msgs/msg/Header", stamp=time, frame_id=frame)


def dynamic(stamp: int, values: Sequence[float], draw: np.random.Generator) -> Any:
    """Joints and interfaces in any order."""
    joints = []
    names = draw.permutation(["shoulder", "elbow"]).tolist()
    for name in names:
        joint = ("shoulder", "elbow").index(name)
        told = {
            "position": values[joint],
            "effort": values[2 + joint],
            "temperature": draw.normal(),
        }
        kinds = draw.permutation([*told]).tolist()
        numbers = np.array([told[kind] for kind in kinds])
        joints.append(
            made("control_msgs/msg/InterfaceValue", interface_names=kinds, values=numbers)
        )
    kind = "control_msgs/msg/DynamicJointState"
    return made(kind, header=header(stamp, ""), joint_names=names, interface_values=joints)


def custom(_stamp: int, values: Sequence[float], draw: np.random.Generator) -> Any:
    """Numbers of every width in every place."""

    def joint(angle: float, torque: float) -> Any:
        flags, torques = draw.integers(0, 2, 3).astype(bool), np.array([draw.normal(), torque])
        warm = float(np.float32(draw.normal()))
        return made(
            "lab/msg/Joint", flags=flags, temperature=warm, angle=angle, mode=7, torques=torques
        )

    words = ["w" * int(size) for size in draw.integers(0, 5, int(draw.integers(0, 3)))]
    return made(
        "lab/msg/State",
        label="l" * int(draw.integers(0, 16)),
        errors=int(draw.integers(0, 1 << 16)),
        joints=[joint(values[0], values[2]), joint(values[1], values[3])],
        spare=draw.integers(-100, 100, int(draw.integers(0, 4))).astype(np.int8),
        more=[joint(0.0, 0.0)] * int(draw.integers(0, 3)),
        words=words,
        last=3,
    )


PLACES = ("joints[0].angle", "joints[1].angle", "joints[0].torques[1]", "joints[1].torques[1]")
NAMED = {name: {"source": path} for name, path in zip(CHANNELS, PLACES, strict=True)}


@pytest.mark.parametrize("little", [True, False], ids=["little", "big"])
@pytest.mark.parametrize(
    ("kind", "make", "settings"),
    [
        ("control_msgs/msg/DynamicJointState", dynamic, {"joints": ["shoulder", "elbow"]}),
        ("lab/msg/State", custom, {"topic": TOPIC} | NAMED),
    ],
)
def test_every_type_reads_as_rosbags_wrote_it(
    kind: str,
    make: Callable[[int, Sequence[float], np.random.Generator], Any],
    settings: dict[str, Any],
    little: bool,
    tmp_path: Path,
) -> None:
    log, draw = noise_log(60, start_ns=EPOCH_NS, velocity=False), np.random.default_rng(8)
    rows, messages = np.concatenate([log.theta, log.tau]).T.tolist(), []
    for stamp, row in zip(log.stamp_ns.tolist(), rows, strict=True):
        data = store().serialize_cdr(make(stamp, row, draw), kind, little_endian=little)
        messages.append((TOPIC, stamp, bytes(data)))
    definition, _ = store().generate_msgdef(kind, ros_version=2)
    write_mcap(tmp_path / "log.mcap", messages, (kind, "ros2msg", definition.encode()))
    assert same(read_log(tmp_path / "log.mcap", Profile.model_validate(settings)), log)
