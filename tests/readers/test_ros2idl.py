"""Definitions in IDL, with ros2msg and rosbags as oracles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from algid.profile import Profile
from algid.readers import read_log
from algid.readers.messages.definitions import DefinitionError, parse_idl, parse_msg
from tests.readers.logs import EPOCH_NS, noise_log, same
from tests.readers.mcaps import Cdr, write_mcap

LINE = "=" * 80 + "\n"
STORE = get_typestore(Stores.ROS2_HUMBLE)
IDL_NAMES = {
    "bool": "boolean",
    "byte": "octet",
    "char": "uint8",
    "float32": "float",
    "float64": "double",
}


def idl_of(name: str) -> str:
    """The sections of a type of the store and of all it is made of, built from its ros2msg text."""
    definition, _ = STORE.generate_msgdef(name, ros_version=2)
    types = parse_msg(name, definition)
    sections = []
    for owner, fields in types.items():
        package, _, last = owner.replace("/msg/", "/").partition("/")
        lines, typedefs = [], []
        for one in fields:
            kind = IDL_NAMES.get(one.type, "::".join(_full(one.type)))
            if one.count == -1:
                kind = f"sequence<{kind}>"
            elif one.count is not None:
                alias = f"{kind.replace('::', '__')}__{one.count}"
                typedefs.append(f"typedef {kind} {alias}[{one.count}];")
                kind = alias
            lines.append(f"{kind} {one.name};")
        text = (
            f"module {package} {{ module msg {{ {' '.join(typedefs)} struct {last} {{ "
            f"{' '.join(lines)} }}; }}; }};"
        )
        sections.append(f"{LINE}IDL: {package}/msg/{last}\n{text}\n")
    return "".join(sections)


def _full(kind: str) -> list[str]:
    package, _, last = kind.replace("/msg/", "/").partition("/")
    return [package, "msg", last] if last else [package]


@pytest.mark.parametrize("package", ["geometry_msgs", "sensor_msgs", "std_msgs", "trajectory_msgs"])
def test_every_type_has_the_same_fields_as_in_ros2msg(package: str) -> None:
    names = [name for name in STORE.fielddefs if name.startswith(f"{package}/msg/")]
    assert len(names) > 3
    for name in names:
        definition, _ = STORE.generate_msgdef(name, ros_version=2)
        wanted = parse_msg(name, definition)
        found = parse_idl(name, idl_of(name))
        for owner, fields in wanted.items():
            other = found["/".join(_full(owner))]
            for one, another in zip(fields, other, strict=True):
                kind = {"char": "uint8"}.get(one.type, "/".join(_full(one.type)))
                assert (another.name, another.type, another.count) == (one.name, kind, one.count)


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
    draw = np.random.default_rng(3)
    messages = []
    for row, stamp in enumerate(log.stamp_ns.tolist()):
        data = Cdr().put("B", 1).put("q", stamp).put("Q", row).put("H", 7).put("h", 1, 2, 3)
        data.text("x" * int(draw.integers(0, 8))).put("I", 0).put("I", 2).text("one").text("three")
        data.put("I", 3).put("f", 0.1, 0.2, 0.3).put("f", 1, 2, 3)
        data.put("I", 1).put("B", 9).put("d", 0.5, 0.25)
        for joint in (0, 1):
            data.put("B", joint).put("d", log.theta[joint, row], log.tau[joint, row])
        messages.append(("/state", stamp, data.done()))
    write_mcap(
        tmp_path / "log.mcap", messages, {"/state": ("arm/msg/State", "ros2idl", text.encode())}
    )
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
    with pytest.raises(DefinitionError, match=told) as refused:
        parse_idl("a/msg/T", f"module a {{ module msg {{ {body} }}; }};")
    assert "\n" not in str(refused.value)
