"""Hostile schemas and messages: each is read, told or refused in one line, and none takes long or
much.
"""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf import descriptor_pb2
from mcap.writer import Writer

from algid.base.errors import LogError
from algid.base.ros2 import JOINT_STATE, JOINT_STATE_DEFINITION
from algid.profile import Profile
from algid.readers import read_log
from algid.readers.messages import protobuf
from algid.readers.messages.layout import Codec, Decoder, MisfitError
from algid.readers.messages.message_file import Messages
from tests.readers.logs import EPOCH_NS, noise_log, same
from tests.readers.mcaps import (
    ANY,
    TOPIC,
    messages_of,
    protobuf_file,
    protobuf_schema,
    protobuf_types,
    write_mcap,
)
from tests.readers.ways import States, json_mcap, json_state, sent, written

LOG = noise_log(200, start_ns=EPOCH_NS, velocity=False)


def changed_json(folder: Path, row: int, change: Callable[[Any], object]) -> Path:
    """The log as JSON joint states, one of them changed."""
    objects = [json_state(one) for one in sent(LOG)]
    change(objects[row])
    return json_mcap(folder, zip(LOG.stamp_ns.tolist(), map(json.dumps, objects), strict=True))


@pytest.mark.parametrize("digits", [20, 400])
def test_json_integers_beyond_64_bits_are_no_traceback(digits: int, tmp_path: Path) -> None:
    number = int("9" * digits)
    path = changed_json(tmp_path, 7, lambda one: one["position"].__setitem__(0, number))
    if digits > 308:
        with pytest.raises(LogError, match=r"theta1 .* sample 8: expected a finite number"):
            read_log(path)
    else:
        assert read_log(path).theta[0, 7] == float(number)


@pytest.mark.parametrize("encoding", ["cdr", "json"])
@pytest.mark.parametrize("name", ["a1", "1"])
def test_a_joint_named_twice_is_refused_and_read_by_its_place(
    name: str, encoding: str, tmp_path: Path
) -> None:
    path = written(encoding, tmp_path, States(sent(LOG, name=[name, name])))
    with pytest.raises(LogError, match=rf"joint '{name}' twice.*theta1\.source"):
        read_log(path)
    if name == "a1":
        assert same(read_log(path, named("position[0] position[1] effort[0] effort[1]")), LOG)


STRUCTURES = """Arm arm
================
MSG: arm/Arm
builtin_interfaces/Time stamp
Joint[] joints
================
MSG: arm/Joint
wstring name
float64 position
float64 effort
================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


@pytest.mark.parametrize("encoding", ["cdr", "json", "protobuf"])
def test_structures_in_any_order_are_known_by_their_names_and_have_their_own_stamp(
    encoding: str, tmp_path: Path
) -> None:
    """Of protobuf a map, whose entries come in any order, beside the recorder's stamps."""
    file = protobuf_file(("position", 1, 1), ("effort", 1, 1), name="Joint")
    state = file.message_type.add(name="State")
    entry = state.nested_type.add(name="JointsEntry")
    entry.options.map_entry = True
    entry.field.add(name="key", number=1, type=9, label=1)
    entry.field.add(name="value", number=2, type=11, label=1, type_name=".arm.Joint")
    state.field.add(name="joints", number=1, type=11, label=3, type_name=".arm.State.JointsEntry")
    schema, made = protobuf_types(file)
    known = {"cdr": ("arm/msg/State", "ros2msg", STRUCTURES.encode()), "json": ANY}
    messages = []
    for row, stamp in enumerate(LOG.stamp_ns.tolist()):
        sec, nanosec = divmod(stamp, 10**9)
        joints = [("1]", *sample(0, row)), ("2]", *sample(1, row))][:: -1 if row % 3 else 1]
        if encoding == "json":
            own = [dict(zip(("name", "position", "effort"), one, strict=True)) for one in joints]
            arm = {"stamp": {"sec": sec, "nanosec": nanosec}, "joints": own}
            data = json.dumps({"arm": arm}).encode()
        elif encoding == "cdr":
            data = struct.pack("<iII", sec, nanosec, len(joints))
            for name, *values in joints:
                data += struct.pack("<III", 2, *map(ord, name))
                data += bytes(-len(data) % 8) + struct.pack("<dd", *values)
            data = b"\0\1\0\0" + data
        else:
            parts = []
            for name, position, effort in joints:
                parts.append(made(joints={name: {"position": position, "effort": effort}}))
            data = b"".join(part.SerializeToString() for part in parts)
        messages.append(("/arm", stamp if encoding == "protobuf" else stamp + 7, data))
    path = tmp_path / "log.mcap"
    write_mcap(path, messages, known.get(encoding, ("arm.State", "protobuf", schema)))
    assert same(read_log(path), LOG)


def sample(joint: int, row: int) -> tuple[float, float]:
    """Angle and torque of a joint in a row of the log."""
    return float(LOG.theta[joint, row]), float(LOG.tau[joint, row])


def test_a_unit_in_a_comment_of_protobuf_is_told(tmp_path: Path) -> None:
    data, kind = protobuf_schema()
    schema = descriptor_pb2.FileDescriptorSet.FromString(data)
    schema.file[1].source_code_info.location.add(leading_comments=" motor current [A]\n")
    messages = []
    for one in sent(LOG):
        message = kind(name=one.name, position=one.position, effort=one.effort)
        messages.append((TOPIC, one.stamp, message.SerializeToString()))
    known = {TOPIC: ("arm.State", "protobuf", schema.SerializeToString())}
    log = read_log(write_mcap(tmp_path / "log.mcap", messages, known))
    (notice,) = (one for one in log.notices if one.code == "STATED_UNUSED")
    assert "motor current [A]" in notice.text


ARM = ("theta1", "theta2", "tau1", "tau2")


def named(sources: str, **more: Any) -> Profile:
    """Settings that name each channel's field."""
    places = {name: {"source": one} for name, one in zip(ARM, sources.split(), strict=True)}
    return Profile.model_validate({"topic": TOPIC, **places, **more})


@pytest.mark.parametrize(
    ("kind", "late", "told"),
    [
        (("std_msgs/msg/Int8", "int8 data"), 0, "200 messages .*(std_msgs/msg/Int8)"),
        ((JOINT_STATE, JOINT_STATE_DEFINITION), 0, "'publisher of /joint_states' has .* 1 and 2"),
        ((JOINT_STATE, JOINT_STATE_DEFINITION), 10**9, "200 samples repeat a stamp"),
    ],
)
def test_what_another_publisher_sends_on_a_topic_is_told(
    kind: tuple[str, str], late: int, told: str, tmp_path: Path
) -> None:
    path = tmp_path / "log.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=2048)
        writer.start()
        own, other = (
            writer.register_channel(
                TOPIC, "cdr", writer.register_schema(name, "ros2msg", text.encode())
            )
            for name, text in ((JOINT_STATE, JOINT_STATE_DEFINITION), kind)
        )
        for _, stamp, data in messages_of(LOG):
            writer.add_message(own, stamp, data, stamp)
            again = data if kind[0] == JOINT_STATE else b"\0\1\0\0\7"
            writer.add_message(other, stamp + late, again, stamp)
        writer.finish()  # type: ignore[no-untyped-call]
    found = read_log(path)
    assert same(found, LOG)
    assert re.search(told, found.notices[0].text)


def test_messages_that_do_not_fit_are_left_out_and_counted(tmp_path: Path) -> None:
    path, messages = tmp_path / "log.mcap", messages_of(LOG)
    messages[40] = (TOPIC, messages[40][1], messages[40][2][:50])
    write_mcap(path, messages)
    found = read_log(path)
    assert len(found) == len(LOG) - 1
    (notice,) = found.notices
    assert notice.lossy
    assert "1 message on '/joint_states' of another form than the schema says" in notice.text
    write_mcap(
        path,
        [(TOPIC, ns, data[: 90 if row else 200]) for row, (_, ns, data) in enumerate(messages)],
    )
    with pytest.raises(LogError, match="cannot be read"):
        read_log(path)


def test_a_definition_that_cannot_be_read_on_another_topic_does_not_matter(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    schema = {"/bad": ("a/msg/B", "ros2msg", b"float64[" + b"9" * 5000 + b"] effort")}
    write_mcap(path, [("/bad", 1, b"\0\1\0\0"), *messages_of(LOG)], schema)
    assert same(read_log(path), LOG)
    with pytest.raises(LogError, match="definition cannot be read"):
        read_log(path, Profile(topic="/bad"))


def test_a_protobuf_type_that_is_missing_is_refused_where_it_is_needed() -> None:
    file = protobuf_file(("x", 1, 1), ("other", 11, 1))
    file.message_type[0].field[1].type_name = ".arm.Gone"
    data = descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString()
    types = protobuf.parse("arm.State", data)
    with pytest.raises(MisfitError, match=r"type '\.arm\.Gone', nested too deep or not defined"):
        protobuf.parse_layout(b"\x12\x00", "arm.State", types)
    for root, broken in (
        ("arm.Gone", data),
        ("arm.State", data[:-3]),
        ("arm.State", b"\xff" * 100),
    ):
        with pytest.raises(MisfitError):
            protobuf.parse(root, broken)


def test_a_protobuf_number_written_in_another_type_is_no_number() -> None:
    data, _ = protobuf_schema()
    types = protobuf.parse("arm.State", data)
    assert protobuf.parse_layout(b"\x30\x07", "arm.State", types).find("mode") is not None
    # an unknown field beside one left out
    assert protobuf.parse_layout(b"\x78\x07", "arm.State", types).find("mode") is not None
    # fixed for a varint, a varint for doubles, a broken list, a list for one number; a wire type
    # that is none, a number and an entry without an end
    for wrong in (
        b"\x0f",
        b"\x30" + b"\xff" * 11,
        b"\x19\0\0",
        b"\x35\0\0\0\0",
        b"\x18\x01",
        b"\x32\x02\x81\x82",
        b"\x32\x03\x02\x04\x06",
    ):
        with pytest.raises(MisfitError):
            protobuf.parse_layout(wrong, "arm.State", types)


_UNSIGNED_64, _UNSIGNED_32 = (4, 6), (7, 13)  # varint or fixed
_SIGNED_64, _SIGNED_32 = (3, 16, 18), (5, 15, 17)  # varint, fixed or zigzag


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        (1, [0.0, -1.5, 1e300, 5e-324]),
        (2, [0.0, -1.5, 3.4e38]),
        *((kind, [0, 1, 127, 128, 2**63, 2**64 - 1]) for kind in _UNSIGNED_64),
        *((kind, [0, 1, 127, 128, 2**31, 2**32 - 1]) for kind in _UNSIGNED_32),
        *((kind, [0, 1, -1, 2**63 - 1, -(2**63)]) for kind in _SIGNED_64),
        *((kind, [0, 1, -1, 2**31 - 1, -(2**31)]) for kind in _SIGNED_32),
        (8, [False, True]),
    ],
)
def test_every_protobuf_number_is_read_as_protobuf_itself_wrote_it(
    kind: int, values: list[float]
) -> None:
    schema, made = protobuf_types(protobuf_file(("value", kind, 1)))
    messages = [made(value=value).SerializeToString() for value in values]
    types = protobuf.parse("arm.State", schema)
    codec = Codec(lambda data: protobuf.parse_layout(data, "arm.State", types))
    stamps = np.zeros(len(messages), np.int64)
    held, columns = Decoder({"value": "value"}, codec).columns(Messages.of(messages, stamps))
    assert held.all()
    parsed = [float(made.FromString(one).value) for one in messages]
    assert (
        columns["value"].astype(np.float64).tolist()
        == parsed
        == np.array(values, "f4" if kind == 2 else "f8").tolist()
    )


@pytest.mark.parametrize("presence", ["proto3", "proto2", "optional", "oneof", "message"])
def test_a_protobuf_number_that_is_unset_is_no_zero(presence: str, tmp_path: Path) -> None:
    """A number that can be told to be unset in one of the ways of protobuf, or cannot (proto3)."""
    file = protobuf_file(*((name, 1, 1) for name in ARM))
    file.syntax = "proto2" if presence == "proto2" else "proto3"
    (arm,) = file.message_type
    own, source = arm.field[3], "tau2"
    if presence in ("oneof", "optional"):
        arm.oneof_decl.add(name="_tau2")
        own.oneof_index = 0
        own.proto3_optional = presence == "optional"
    if presence == "message":
        file.message_type.add(name="Joint").field.add(name="value", number=1, type=1, label=1)
        own.type, own.type_name, source = 11, ".arm.Joint", "tau2.value"
    schema, made = protobuf_types(file)
    messages = []
    for row in range(40):
        values: dict[str, Any] = dict.fromkeys(ARM, row + 1.0)
        if row % 2:
            del values["tau2"]
        elif presence == "message":
            values["tau2"] = {"value": row + 1.0}
        messages.append((TOPIC, row * 10**6, made(**values).SerializeToString()))
    path = write_mcap(tmp_path / "log.mcap", messages, ("arm.State", "protobuf", schema))
    log = read_log(path, named(f"theta1 theta2 tau1 {source}", clock="log"))
    lost = [one.text for one in log.notices if one.code == "MESSAGES_LEFT_OUT" and one.lossy]
    if presence == "proto3":  # it cannot tell 0 from unset
        assert (len(log), lost) == (40, [])
        assert log.tau[1, 1] == 0
    else:
        assert log.tau[1].tolist() == [row + 1.0 for row in range(0, 40, 2)]
        assert lost == [f"20 messages on '{TOPIC}' left out for want of {source}"]


def test_messages_that_a_flag_calls_no_measurement_are_left_out(tmp_path: Path) -> None:
    definition = b"float64[2] q\nfloat64[2] tau\nuint8 other\nbool valid\nint32 error_code\n"
    messages = []
    for row, one in enumerate(sent(LOG)):
        numbers = *one.position, *one.effort, row % 256, row not in range(50, 60), 17 * (row >= 190)
        content = b"\0\1\0\0" + struct.pack("<4dBB2xi", *numbers)
        messages.append((TOPIC, one.stamp, content))
    known = ("arm_msgs/msg/State", "ros2msg", definition)
    found = read_log(
        write_mcap(tmp_path / "log.mcap", messages, known), named("q[0] q[1] tau[0] tau[1]")
    )
    assert np.array_equal(found.theta, LOG.theta[:, np.r_[:50, 60:190]])
    (notice,) = (one for one in found.notices if one.key == "MESSAGES_LEFT_OUT:fields")
    assert (notice.numbers["count"], notice.numbers["fields"]) == (20, "valid")
