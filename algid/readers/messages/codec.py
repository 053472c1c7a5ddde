"""From a channel's message encoding and schema to what reads its messages."""

from __future__ import annotations

from collections.abc import Mapping

from algid.base.errors import LogError
from algid.readers.messages import cdr, protobuf
from algid.readers.messages import json as jsontext
from algid.readers.messages.columnar import ColumnDecoder, Decoder, Walk
from algid.readers.messages.definitions import DefinitionError, parse_idl, parse_msg, parse_ros1
from algid.readers.messages.message_file import MessageChannel

_PARSERS = {
    ("cdr", "ros2msg"): (parse_msg, cdr.walk),
    ("cdr", "ros2idl"): (parse_idl, cdr.walk),
    ("ros1", "ros1msg"): (parse_ros1, cdr.walk_ros1),
}


def walk_for(path: str, channel: MessageChannel) -> Walk:
    """The walk over single messages of a channel.

    Raises
    ------
    LogError
        If the encoding of the messages or of the schema is not known, or the schema cannot be read.
    """
    place = f"{path}: topic {channel.topic!r}"
    encoding = (channel.encoding, channel.definition_encoding)
    try:
        if encoding in _PARSERS:
            parse, walk = _PARSERS[encoding]
            types = parse(channel.type, channel.definition.decode("utf-8", errors="replace"))
            return lambda payload: walk(payload, channel.type, types)
        if encoding == ("protobuf", "protobuf"):
            messages = protobuf.parse(channel.type, channel.definition)
            return lambda payload: protobuf.walk(payload, channel.type, messages)
    except DefinitionError as error:
        raise LogError(f"{place}: the message definition cannot be read: {error}") from error
    if encoding[0] == "json":
        return jsontext.walk
    if encoding == ("cdr", ""):
        raise LogError(
            f"{place}: the file holds no definition of {channel.type}, and none is known; "
            "record with MCAP"
        )
    raise LogError(
        f"{place}: message encoding {encoding[0]!r} with schema encoding {encoding[1]!r}; "
        "expected cdr with ros2msg or ros2idl, ros1 with ros1msg, protobuf, or json"
    )


def decoder_for(path: str, channel: MessageChannel, wanted: Mapping[str, str]) -> Decoder:
    """What reads the numbers `wanted`, by name a path each, out of a channel's messages.

    Raises
    ------
    LogError
        As `walk_for`.
    """
    walk = walk_for(path, channel)
    if channel.encoding == "json":
        return jsontext.JsonDecoder(wanted)
    return ColumnDecoder(wanted, walk=walk)
