"""From a channel's message encoding and schema to what reads its messages."""

from __future__ import annotations

from collections.abc import Mapping

from algid.base.errors import LogError
from algid.readers.messages import cdr, protobuf
from algid.readers.messages import json as jsontext
from algid.readers.messages.definitions import DefinitionError, parse_idl, parse_msg
from algid.readers.messages.layout import ColumnDecoder, Decoder, Parser
from algid.readers.messages.message_file import MessageChannel


def parser_for(path: str, channel: MessageChannel) -> Parser:
    """What gives the layout of a channel's messages.

    Raises
    ------
    LogError
        If the encoding of the messages or of the schema is not known, or the schema cannot be read.
    """
    place = f"{path}: topic {channel.topic!r}"
    root, text = channel.type, channel.definition.decode("utf-8", errors="replace")
    encoding, form = channel.encoding, channel.definition_encoding
    try:
        if (encoding, form) in (("cdr", "ros2msg"), ("ros1", "ros1msg"), ("cdr", "ros2idl")):
            ros1 = encoding == "ros1"
            types = parse_idl(root, text) if form == "ros2idl" else parse_msg(root, text, ros1=ros1)
            return lambda payload: cdr.parse_layout(payload, root, types, ros1=ros1)
        if (encoding, form) == ("protobuf", "protobuf"):
            messages = protobuf.parse(root, channel.definition)
            return lambda payload: protobuf.parse_layout(payload, root, messages)
    except DefinitionError as error:
        raise LogError(f"{place}: the message definition cannot be read: {error}") from error
    if encoding == "json":
        return jsontext.parse_layout
    if encoding == "cdr" and not form:
        raise LogError(
            f"{place}: the file holds no definition of {root}, and none is known; record with MCAP"
        )
    raise LogError(
        f"{place}: message encoding {encoding!r} with schema encoding {form!r}; expected cdr with "
        "ros2msg or ros2idl, ros1 with ros1msg, protobuf, or json"
    )


def decoder_for(path: str, channel: MessageChannel, wanted: Mapping[str, str]) -> Decoder:
    """What reads the numbers `wanted`, by name a path each, out of a channel's messages.

    Raises
    ------
    LogError
        As `parser_for`.
    """
    if channel.encoding == "json":
        return jsontext.JsonDecoder(wanted)
    return ColumnDecoder(wanted, parse=parser_for(path, channel))
