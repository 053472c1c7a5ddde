"""From a channel's message encoding and schema to what reads its messages."""

from __future__ import annotations

from functools import partial

from algid.base.errors import LogError
from algid.readers.messages import cdr, protobuf
from algid.readers.messages.definitions import DefinitionError, parse
from algid.readers.messages.json import JsonRecords
from algid.readers.messages.layout import Codec
from algid.readers.messages.message_file import MessageChannel


def codec_for(path: str, channel: MessageChannel) -> Codec:
    """What reads a channel's messages.

    Raises
    ------
    LogError
        If the encoding of the messages or of the schema is not known, or the schema cannot be read.
    """
    place = f"{path}: topic {channel.topic!r}"
    root, text = channel.type, channel.definition.decode("utf-8", errors="replace")
    form = channel.encoding, channel.definition_encoding
    try:
        if form in (("cdr", "ros2msg"), ("cdr", "ros2idl"), ("ros1", "ros1msg")):
            ros1 = channel.encoding == "ros1"
            root, types = parse(root, text, idl=form[1] == "ros2idl", ros1=ros1)
            return Codec(partial(cdr.parse_layout, root=root, types=types, ros1=ros1))
        if form == ("protobuf", "protobuf"):
            messages = protobuf.parse(root, channel.definition)
            return Codec(partial(protobuf.parse_layout, root=root, types=messages))
    except DefinitionError as error:
        raise LogError(f"{place}: the message definition cannot be read: {error}") from error
    if channel.encoding == "json":
        records = JsonRecords()
        return Codec(records.parse, records.records)
    if form == ("cdr", ""):
        raise LogError(
            f"{place}: the file holds no definition of {root}, and none is known; record with MCAP"
        )
    raise LogError(
        f"{place}: message encoding {form[0]!r} with schema encoding {form[1]!r}; expected cdr "
        "with ros2msg or ros2idl, ros1 with ros1msg, protobuf, or json"
    )
