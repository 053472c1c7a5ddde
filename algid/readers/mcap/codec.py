"""From a channel's schema and message encoding to a walk over its messages."""

from __future__ import annotations

from typing import Any

from algid.errors import LogError
from algid.readers.mcap import cdr, ros2msg
from algid.readers.mcap.layout import Walk


def walk_for(path: str, channel: Any, schema: Any) -> Walk:
    """The walk over messages of a channel.

    Raises
    ------
    LogError
        If the encoding of the messages or the schema is not known, or the schema cannot be read.
    """
    place = f"{path}: topic {channel.topic!r}"
    encoding = (channel.message_encoding, schema.encoding if schema else "")
    if channel.message_encoding == "cdr" and schema is not None and schema.encoding == "ros2msg":
        try:
            types = ros2msg.parse(schema.name, schema.data.decode("utf-8", errors="replace"))
        except ros2msg.DefinitionError as error:
            raise LogError(f"{place}: the message definition cannot be read: {error}") from error
        return lambda payload: cdr.walk(payload, schema.name, types)
    raise LogError(
        f"{place}: message encoding {encoding[0]!r} with schema encoding {encoding[1]!r}; "
        "expected cdr with ros2msg, protobuf, or json"
    )
