"""Hostile schemas and messages: each is read, told or refused in one line, and none takes long or
much.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.writer import Writer

from algid.base.errors import LogError
from algid.base.ros2 import JOINT_STATE, JOINT_STATE_DEFINITION
from algid.log import Log
from algid.profile import Profile
from algid.readers import read_log
from algid.readers.messages import protobuf
from algid.readers.messages.definitions import DefinitionError
from algid.readers.messages.layout import Codec, Decoder, MisfitError
from algid.readers.messages.message_file import Messages
from tests.readers.logs import EPOCH_NS, noise_log, same
from tests.readers.mcaps import TOPIC, joint_state, messages_of, protobuf_schema, write_mcap


def json_messages(log: Log, **more: Any) -> list[tuple[str, int, bytes]]:
    """The samples of a log as JSON; what is in `more` by row stands in place of its fields."""
    messages = []
    for row, stamp in enumerate(log.stamp_ns.tolist()):
        content = {
            "header": {"stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9}},
            "name": ["a1", "a2"],
            "position": log.theta[:, row].tolist(),
            "effort": log.tau[:, row].tolist(),
        }
        messages.append((TOPIC, stamp, json.dumps(content | more.get(f"row{row}", {})).encode()))
    return messages


def write_json(path: Path, messages: list[tuple[str, int, bytes]]) -> None:
    write_mcap(path, messages, {TOPIC: ("arm", "jsonschema", b"{}")}, encoding="json")


@pytest.mark.parametrize("digits", [20, 400])
def test_json_integers_beyond_64_bits_are_no_traceback(digits: int, tmp_path: Path) -> None:
    log = noise_log(20, start_ns=EPOCH_NS, velocity=False)
    messages = json_messages(log)
    messages[7] = (
        TOPIC,
        messages[7][1],
        messages[7][2].replace(b'"position": [', b'"position": [' + b"9" * digits + b", "),
    )
    write_json(tmp_path / "log.mcap", messages)
    if digits > 308:
        with pytest.raises(LogError, match=r"theta1 .* sample 8: expected a finite number"):
            read_log(tmp_path / "log.mcap")
    else:
        assert read_log(tmp_path / "log.mcap").theta[0, 7] == float("9" * digits)


@pytest.mark.parametrize("seconds", [float("nan"), float("inf"), 1e300, 10**30])
def test_seconds_that_are_no_time_late_in_json_are_refused(seconds: float, tmp_path: Path) -> None:
    log = noise_log(200, start_ns=EPOCH_NS, velocity=False)
    write_json(
        tmp_path / "log.mcap",
        json_messages(log, row150={"header": {"stamp": {"sec": seconds, "nanosec": 0}}}),
    )
    with pytest.raises(LogError, match=r"header stamp with .* --set clock=log"):
        read_log(tmp_path / "log.mcap")
    assert same(read_log(tmp_path / "log.mcap", Profile(clock="log")), log)


@pytest.mark.parametrize("names", [["a1", "a1"], ["1", "1"]])
def test_a_joint_named_twice_is_refused_and_read_by_its_place(
    names: list[str], tmp_path: Path
) -> None:
    log = noise_log(20, start_ns=EPOCH_NS, velocity=False)
    sources = {
        f"{name}{joint}": {"source": f"{field}[{joint - 1}]"}
        for name, field in (("theta", "position"), ("tau", "effort"))
        for joint in (1, 2)
    }
    profile = Profile.model_validate({"topic": TOPIC, **sources})
    for encoding in ("cdr", "json"):
        path = tmp_path / f"{encoding}.mcap"
        if encoding == "json":
            write_json(
                path, json_messages(log, **{f"row{row}": {"name": names} for row in range(20)})
            )
        else:
            rows = zip(log.stamp_ns.tolist(), log.theta.T.tolist(), log.tau.T.tolist(), strict=True)
            write_mcap(
                path,
                [
                    (TOPIC, ns, joint_state(ns, names, one, (), other).done())
                    for ns, one, other in rows
                ],
            )
        with pytest.raises(LogError, match=rf"joint '{names[0]}' twice.*theta1\.source"):
            read_log(path)
        if names[0] == "a1":
            assert same(read_log(path, profile), log)


def test_two_types_on_one_topic_are_told_apart(tmp_path: Path) -> None:
    log = noise_log(100, start_ns=EPOCH_NS)
    with (tmp_path / "log.mcap").open("wb") as stream:
        writer = Writer(stream, chunk_size=2048)
        writer.start()
        schema = writer.register_schema(JOINT_STATE, "ros2msg", JOINT_STATE_DEFINITION.encode())
        channel = writer.register_channel(TOPIC, "cdr", schema)
        other = writer.register_channel(
            TOPIC, "cdr", writer.register_schema("std_msgs/msg/Int8", "ros2msg", b"int8 data")
        )
        for _, stamp, data in messages_of(log):
            writer.add_message(channel, stamp, data, stamp)
            writer.add_message(other, stamp, b"\0\1\0\0\7", stamp)
        writer.finish()  # type: ignore[no-untyped-call]
    found = read_log(tmp_path / "log.mcap")
    assert same(found, log)
    (notice,) = found.notices
    assert notice.code == "MESSAGES_LEFT_OUT"
    assert notice.lossy
    assert "100 messages" in notice.text
    assert "std_msgs/msg/Int8" in notice.text


def test_messages_that_do_not_fit_are_left_out_and_counted(tmp_path: Path) -> None:
    log = noise_log(300, start_ns=EPOCH_NS)
    messages = messages_of(log)
    messages[40] = (TOPIC, messages[40][1], messages[40][2][:50])
    write_mcap(tmp_path / "log.mcap", messages)
    found = read_log(tmp_path / "log.mcap")
    assert len(found) == 299
    (notice,) = found.notices
    assert notice.lossy
    assert "1 message on '/joint_states' of another form than the schema says" in notice.text
    write_mcap(
        tmp_path / "log.mcap",
        [(TOPIC, ns, data[: 90 if row else 200]) for row, (_, ns, data) in enumerate(messages)],
    )
    with pytest.raises(LogError, match="cannot be read"):
        read_log(tmp_path / "log.mcap")


def test_a_definition_that_cannot_be_read_on_another_topic_does_not_matter(tmp_path: Path) -> None:
    log = noise_log(50, start_ns=EPOCH_NS)
    schema = {"/bad": ("a/msg/B", "ros2msg", b"float64[" + b"9" * 5000 + b"] effort")}
    write_mcap(tmp_path / "log.mcap", [("/bad", 1, b"\0\1\0\0"), *messages_of(log)], schema)
    assert same(read_log(tmp_path / "log.mcap"), log)
    with pytest.raises(LogError, match="definition cannot be read"):
        read_log(tmp_path / "log.mcap", Profile(topic="/bad"))


def descriptors(**types: list[tuple[str, str]]) -> bytes:
    """A descriptor set: by type its fields, each with a name and the type of message it is, empty
    for a double.
    """
    file = descriptor_pb2.FileDescriptorProto(name="a.proto", package="a", syntax="proto3")
    for name, fields in types.items():
        message = file.message_type.add(name=name)
        for number, (field, kind) in enumerate(fields, start=1):
            message.field.add(
                name=field, number=number, type=11 if kind else 1, label=1, type_name=kind
            )
    return descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString()


def test_a_protobuf_type_that_is_missing_is_refused_where_it_is_needed() -> None:
    data = descriptors(State=[("x", ""), ("other", ".a.Gone")], Fine=[("effort", "")])
    types = protobuf.parse("a.State", data)
    with pytest.raises(MisfitError, match=r"type '\.a\.Gone', nested too deep or not defined"):
        protobuf.parse_layout(b"\x12\x00", "a.State", types)
    for root, broken in (("a.Gone", data), ("a.State", data[:-3]), ("a.State", b"\xff" * 100)):
        with pytest.raises(DefinitionError):
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


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        pytest.param(1, [0.0, -1.5, 1e300, 5e-324], id="double"),
        pytest.param(2, [0.0, -1.5, 3.4e38], id="float"),
        pytest.param(3, [0, 1, -1, 2**63 - 1, -(2**63)], id="int64"),
        pytest.param(4, [0, 1, 127, 128, 2**63 - 1, 2**63, 2**64 - 1], id="uint64"),
        pytest.param(5, [0, 1, -1, 2**31 - 1, -(2**31)], id="int32"),
        pytest.param(6, [0, 2**63, 2**64 - 1], id="fixed64"),
        pytest.param(7, [0, 2**31, 2**32 - 1], id="fixed32"),
        pytest.param(8, [False, True], id="bool"),
        pytest.param(13, [0, 128, 2**31, 2**32 - 1], id="uint32"),
        pytest.param(15, [0, -1, -(2**31)], id="sfixed32"),
        pytest.param(16, [0, -1, -(2**63)], id="sfixed64"),
        pytest.param(17, [0, 1, -1, 2**31 - 1, -(2**31)], id="sint32"),
        pytest.param(18, [0, 1, -1, 2**63 - 1, -(2**63)], id="sint64"),
    ],
)
def test_every_protobuf_number_is_read_as_protobuf_itself_wrote_it(
    kind: int, values: list[float]
) -> None:
    file = descriptor_pb2.FileDescriptorProto(name="n.proto", package="n", syntax="proto3")
    file.message_type.add(name="N").field.add(name="value", number=1, type=kind, label=1)
    written = proto_class(file, "n.N")
    messages = [written(value=value).SerializeToString() for value in values]
    types = protobuf.parse("n.N", descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString())
    codec = Codec(lambda data: protobuf.parse_layout(data, "n.N", types))
    stamps = np.zeros(len(messages), np.int64)
    held, columns = Decoder({"value": "value"}, codec).columns(Messages.of(messages, stamps))
    assert held.all()
    parsed = [float(written.FromString(one).value) for one in messages]
    assert (
        columns["value"].astype(np.float64).tolist()
        == parsed
        == np.array(values, "f4" if kind == 2 else "f8").tolist()
    )


def proto_class(file: descriptor_pb2.FileDescriptorProto, name: str) -> Any:
    """The class of a message that a file describes."""
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(name))


ARM = ("theta1", "theta2", "tau1", "tau2")


def arm_file(presence: str) -> descriptor_pb2.FileDescriptorProto:
    """Messages of four numbers that can be told to be unset in one of the ways of protobuf, or
    cannot (proto3).
    """
    file = descriptor_pb2.FileDescriptorProto(name="p.proto", package="p")
    file.syntax = "proto2" if presence == "proto2" else "proto3"
    arm = file.message_type.add(name="Arm")
    if presence == "message":
        joint = file.message_type.add(name="Joint")
        joint.field.add(name="value", number=1, type=1, label=1)
    for number, name in enumerate(ARM, start=1):
        field = arm.field.add(name=name, number=number, type=1, label=1)
        if presence in ("oneof", "optional"):
            arm.oneof_decl.add(name=f"_{name}")
            field.oneof_index = number - 1
            field.proto3_optional = presence == "optional"
        if presence == "message":
            field.type, field.type_name = 11, ".p.Joint"
    return file


@pytest.mark.parametrize("presence", ["proto3", "proto2", "optional", "oneof", "message"])
def test_a_protobuf_number_that_is_unset_is_no_zero(presence: str, tmp_path: Path) -> None:
    file = arm_file(presence)
    made = proto_class(file, "p.Arm")
    messages = []
    for row in range(40):
        one = made()
        for place, name in enumerate(ARM):
            value = float((row + 1) * 10 + place)
            if name == "tau2" and row % 2:
                continue
            if presence == "message":
                getattr(one, name).value = value
            else:
                setattr(one, name, value)
        messages.append(("/arm", row * 10**6, one.SerializeToString()))
    schema = descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString()
    write_mcap(
        tmp_path / "log.mcap",
        messages,
        {"/arm": ("p.Arm", "protobuf", schema)},
        encoding="protobuf",
    )
    places = {name: {"source": f"{name}.value" if presence == "message" else name} for name in ARM}
    log = read_log(
        tmp_path / "log.mcap", Profile.model_validate({"topic": "/arm", "clock": "log", **places})
    )
    lost = [
        notice.text for notice in log.notices if notice.code == "MESSAGES_LEFT_OUT" and notice.lossy
    ]
    if presence == "proto3":  # it cannot tell 0 from unset
        assert (len(log), lost) == (40, [])
        assert log.tau[1, 1] == 0
    else:
        assert len(log) == 20
        assert log.tau[1].tolist() == [(row + 1) * 10.0 + 3 for row in range(0, 40, 2)]
        assert lost == [f"20 messages on '/arm' left out for want of {places['tau2']['source']}"]


@pytest.mark.parametrize("encoding", ["cdr", "protobuf"])
@pytest.mark.parametrize(("flag", "bad"), [("valid", 0), ("error_code", 17)])
def test_messages_that_a_flag_calls_no_measurement_are_left_out(
    encoding: str, flag: str, bad: int, tmp_path: Path
) -> None:
    log, wild = noise_log(200, start_ns=EPOCH_NS, velocity=False), range(50, 60)
    definition = b"float64[2] q\nfloat64[2] tau\nuint8 other\nbool valid\nint32 error_code\n"
    known: tuple[str, str, bytes] = ("arm_msgs/msg/State", "ros2msg", definition)
    if encoding == "protobuf":
        own = descriptor_pb2.FileDescriptorProto(name="state.proto", syntax="proto3")
        kinds = (
            ("q", 1, 3),
            ("tau", 1, 3),
            ("other", 13, 1),
            ("valid", 8, 1),
            ("error_code", 5, 1),
        )
        state = own.message_type.add(name="State")
        for place, (name, kind, label) in enumerate(kinds, start=1):
            state.field.add(name=name, number=place, type=kind, label=label)
        made = proto_class(own, "State")
        known = (
            "State",
            "protobuf",
            descriptor_pb2.FileDescriptorSet(file=[own]).SerializeToString(),
        )
    messages = []
    for row, stamp in enumerate(log.stamp_ns.tolist()):
        says = {"valid": 1, "error_code": 0} | ({flag: bad} if row in wild else {})
        theta, tau = log.theta[:, row] + (row in wild), log.tau[:, row]
        content = struct.pack("<4B4dBB2xi", 0, 1, 0, 0, *theta, *tau, row % 256, *says.values())
        if encoding == "protobuf":
            one = made(
                q=theta, tau=tau, other=row, valid=says["valid"], error_code=says["error_code"]
            )
            content = one.SerializeToString()
        messages.append((TOPIC, stamp, content))
    write_mcap(tmp_path / "log.mcap", messages, {TOPIC: known}, encoding=encoding)
    places = {"theta1": "q[0]", "theta2": "q[1]", "tau1": "tau[0]", "tau2": "tau[1]"}
    sources = {name: {"source": path} for name, path in places.items()}
    profile = Profile.model_validate({"topic": TOPIC, **sources})
    found = read_log(tmp_path / "log.mcap", profile)
    kept = np.delete(np.arange(200), wild)
    np.testing.assert_array_equal(found.theta, log.theta[:, kept])
    np.testing.assert_array_equal(found.tau, log.tau[:, kept])
    (notice,) = (one for one in found.notices if one.key == "MESSAGES_LEFT_OUT:fields")
    assert notice.numbers["count"] == 10
    assert notice.numbers["fields"] == flag
