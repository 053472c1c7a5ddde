"""From a channel's message encoding and schema to what reads its messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from algid.errors import LogError
from algid.readers.mcap import cdr, protobuf
from algid.readers.mcap import json as jsontext
from algid.readers.mcap.columnar import Decoder, Fields, Walk
from algid.readers.mcap.definitions import DefinitionError, parse_idl, parse_msg
from algid.readers.mcap.messages import Messages

_DEFINITIONS = {"ros2msg": parse_msg, "ros2idl": parse_idl}


class Decodes(Protocol):
    """Reads wanted numbers out of batches of messages.

    Counts the messages that lack a needed one, and those that do not fit their schema, with why the first does not.
    """

    @property
    def wanted(self) -> Mapping[str, str]:
        """The fields wanted, by name: where each stands in a message."""
        ...

    @property
    def skipped(self) -> int:
        """Messages that lack a field that is needed."""
        ...

    @property
    def misfits(self) -> int:
        """Messages that do not fit their schema."""
        ...

    @property
    def misfit(self) -> str:
        """Why the first of them does not; empty where all fit."""
        ...

    def columns(self, messages: Messages) -> tuple[NDArray[np.bool_], Fields]:
        """Which messages hold what is needed (N,), and the numbers of those, by name."""
        ...


def walk_for(path: str, channel: Any, schema: Any) -> Walk:
    """The walk over single messages of a channel.

    Raises
    ------
    LogError
        If the encoding of the messages or of the schema is not known, or the schema cannot be read.
    """
    place = f"{path}: topic {channel.topic!r}"
    encoding = (channel.message_encoding, schema.encoding if schema else "")
    try:
        if encoding[0] == "cdr" and encoding[1] in _DEFINITIONS:
            types = _DEFINITIONS[encoding[1]](schema.name, schema.data.decode("utf-8", errors="replace"))
            return lambda payload: cdr.walk(payload, schema.name, types)
        if encoding == ("protobuf", "protobuf"):
            messages = protobuf.parse(schema.name, schema.data)
            return lambda payload: protobuf.walk(payload, schema.name, messages)
    except DefinitionError as error:
        raise LogError(f"{place}: the message definition cannot be read: {error}") from error
    if encoding[0] == "json":
        return jsontext.walk
    raise LogError(
        f"{place}: message encoding {encoding[0]!r} with schema encoding {encoding[1]!r}; "
        "expected cdr with ros2msg or ros2idl, protobuf, or json"
    )


def decoder_for(
    path: str, channel: Any, schema: Any, wanted: Mapping[str, str], works: Callable[[int], bool]
) -> Decodes:
    """What reads the numbers `wanted`, by name a path each, out of a channel's messages; `works` as in `Decoder`.

    Raises
    ------
    LogError
        As `walk_for`.
    """
    walk = walk_for(path, channel, schema)
    if channel.message_encoding == "json":
        return jsontext.JsonDecoder(wanted, frozenset(wanted), works)
    return Decoder(walk, wanted, frozenset(wanted), works)
