"""Definitions of messages, in IDL and as .msg."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from algid.profile import Profile
from algid.readers import read_log
from algid.readers.messages.layout import MisfitError
from algid.readers.messages.ros import Field, parse
from tests.readers.logs import EPOCH_NS, noise_log, same
from tests.readers.mcaps import write_mcap


def test_every_kind_of_member_takes_its_place(tmp_path: Path) -> None:
    text = """
    module arm {
      module msg {
        module State_Constants {
          const uint8 BRAKED = 1; @unit (value="s") const string<5> NAME = "};"; };
        typedef float float__3[3];
        typedef float__3 currents;
        struct Joint { octet flags; double angle, torque; };
        typedef Joint Joint__2[2];
      };
      struct Clock { long long ns; };
    };
    module arm { module msg {
        struct State {
          @default (value=TRUE) boolean ready;
          ::arm::Clock clock;
          unsigned long long count; unsigned short small; short tiny[3];
          string<8> label; wstring note; sequence<string, 4> tags;
          sequence<float, 3> few; currents amps;
          sequence<Joint> spare; Joint__2 joints;
        };
    }; };
    """
    log = noise_log(30, start_ns=EPOCH_NS, velocity=False)
    form = "<B7xqQH3hI3sxIII4sI6s2xI3f3fIB3x2dB7x2dB7x2d"  # each number at a multiple of its size
    texts = (3, b"ab", 0, 2, 4, b"one", 6, b"three")
    lists = (3, 0.1, 0.2, 0.3, 1.0, 2.0, 3.0, 1, 9, 0.5, 0.25)
    messages = []
    for row, stamp in enumerate(log.stamp_ns.tolist()):
        (q1, q2), (tau1, tau2) = log.theta[:, row], log.tau[:, row]
        start = (1, stamp, row, 7, 1, 2, 3)
        data = struct.pack(form, *start, *texts, *lists, 0, q1, tau1, 1, q2, tau2)
        messages.append(("/state", stamp, b"\0\1\0\0" + data))
    write_mcap(tmp_path / "log.mcap", messages, ("arm/msg/State", "ros2idl", text.encode()))
    paths = {
        f"{name}{joint + 1}": {"source": f"joints[{joint}].{part}"}
        for name, part in (("theta", "angle"), ("tau", "torque"))
        for joint in (0, 1)
    }
    found = read_log(tmp_path / "log.mcap", Profile.model_validate({"topic": "/state", **paths}))
    assert same(found, log)


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ("union U switch (long) { case 1: long a; };", "Could not parse"),
        ("struct T { sequence<sequence<double>> x; };", "'sequence<sequence' is not what ROS 2"),
        ("typedef double D[2]; struct T { sequence<D> x; };", "Multidimensional"),
        ("struct T { Other x; };", "'a/msg/Other' is not defined"),
        ("struct T { @optional double x; };", "'@optional' is not what ROS 2 writes"),
        ("struct T { double x", "Could not parse"),
        ("struct Other { double x; };", "'a/msg/T' is not defined"),
        ("module a {" * 1000, "recursion"),
    ],
)
def test_what_cannot_be_read_is_refused_in_one_line(body: str, told: str) -> None:
    with pytest.raises(MisfitError, match=told) as refused:
        parse("a/msg/T", f"module a {{ module msg {{ {body} }}; }};", idl=True)
    assert "\n" not in str(refused.value)


def test_a_text_of_another_recorder_is_read_as_ros_writes_it() -> None:
    """Constants of any name, other line ends and lines between types; types in the same package."""
    text = "int8 debug=1\r\nB[2] b # of two\r\nstring<=5 s\r\n===\r\nMSG: a/B\r\nfloat64[<=3] x\n"
    root, types = parse("a/T", text)
    two = Field("b", "a/msg/B", 2), Field("s", "string", None)
    assert types == {root: two, "a/msg/B": (Field("x", "float64", -1),)}
    assert parse("a/T", "int8 debug=1")[1]["a/msg/T"][0].type == "uint8"  # nothing is a byte
    capitals = "Arm/State two\n===\nMSG: Arm/State\nfloat64 x\n"
    assert parse("Arm/Both", capitals)[1]["Arm/msg/Both"] == (Field("two", "Arm/msg/State", None),)
    with pytest.raises(MisfitError, match=r"Could not parse: int8 9x\)$"):
        parse("a/T", "int8 y\nint8 9x\n")
