"""Logs given in memory, as a frame of columns or a dict of arrays, read as if from a file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeGuard

import numpy as np

from algid.base.errors import LogError, SettingError
from algid.log import Log
from algid.readers.arrays import of_arrays, of_arrow
from algid.readers.table_cells import ATTRS, TableFile

if TYPE_CHECKING:
    from algid.profile import Profile

NAME = "log"
"""What a log in memory is called, as by `algid.Log.from_arrays`."""

FrameOrArrays = Any
"""A pandas or polars frame, a pyarrow table, or a mapping of names to arrays."""


def is_columns(given: object) -> TypeGuard[FrameOrArrays]:
    """Whether columns are given: a mapping, or an object that exports Arrow, as frames do."""
    return isinstance(given, Mapping) or any(
        hasattr(given, name) for name in ("__arrow_c_stream__", "__dataframe__")
    )


_OF_A_LOG = (
    "accept", "angle_unit", "drive", "effort", "end", "gravity", "offsets", "passive", "prior",
    "prior_error", "second_angle", "signs", "start", "torque_unit", "velocity", "zero",
)  # fmt: skip
"""What a profile may say of arrays: where they are from has been said by giving them."""
_OF_ANY_LOG = ("accept", "effort", "end", "gravity", "prior", "prior_error", "start", "velocity")
"""What it may say of a log that was read by a profile before."""
_OF_A_CHANNEL = ("counts", "gear_ratio", "offset", "sign", "torque_constant", "unit", "unwrap")

_MAKE = "algid.Log.from_arrays makes a log of times in s and plain numbers"


def checked(log: Log) -> Log:
    """The log, if its arrays are as `Log` has them.

    Raises
    ------
    LogError
        If there are fewer than two samples, stamps are no integers that increase, or an array
        holds anything but finite numbers in double precision.
    """
    stamps, wrong = log.stamp_ns, ""
    if stamps.size < 2:
        wrong = f"expected two samples or more, found {stamps.size}; record longer"
    elif stamps.dtype != np.int64 or not np.all(stamps[1:] > stamps[:-1]):
        wrong = f"stamp_ns: expected increasing integers (int64, ns), found {stamps.dtype}; {_MAKE}"
    for channel in ("theta", "tau", "omega"):
        values = getattr(log, channel)
        if not (values is None or (values.dtype == np.float64 and np.isfinite(values).all())):
            wrong = f"{channel}: expected finite float64, its type is {values.dtype}; {_MAKE}"
    if wrong:
        raise LogError(f"{log.origin.path}: {wrong}")
    return log


def with_profile(log: Log, profile: Profile | None) -> Log:
    """A log in memory with the settings of a profile over its arrays, as if they were columns.

    Parameters
    ----------
    log : Log
    profile : Profile or None
        What the user says of this log.

    Raises
    ------
    LogError
        As `checked`.
    SettingError
        If a setting says where channels are found, or again how a log is meant that was read.
    """
    from algid.notices import flat
    from algid.profile import with_settings
    from algid.readers import open_log

    checked(log)
    if profile is None:
        return log
    reading, given = log.origin.reading, profile.model_dump(exclude_unset=True)
    for name in flat(given):
        channel, dot, key = name.partition(".")
        if (key not in _OF_A_CHANNEL) if dot else (channel not in _OF_A_LOG):
            raise SettingError(
                f"{name}: {log.origin.path} is a Log in memory, whose channels are known; leave it "
                "out"
            )
        if reading.channels and name not in _OF_ANY_LOG:
            raise SettingError(
                f"{name}: {log.origin.path} has been read already; give it to algid.read_log"
            )
    columns = {"t": log.stamp_ns}
    signals = {"theta": log.theta, "tau": log.tau, "omega": log.omega, "q_des": log.reference}
    for quantity, values in signals.items():
        for joint, row in enumerate(() if values is None else values, start=1):
            columns[f"{quantity}{joint}"] = row
    accept = set(profile.accept) | set(reading.accepted)
    if not (profile.channel("theta1").unit or profile.channel("theta2").unit):
        accept.add("DEGREES")  # a log's angles are in rad, however far joints turn
    settings = {"time": "t", "time_unit": "ns", "accept": sorted(accept)}
    read = open_log(columns, with_settings(profile, settings)).whole()
    origin = replace(log.origin, mapping=read.origin.mapping, reading=read.origin.reading)
    if reading.channels:
        cut = replace(reading, start=profile.start, end=profile.end, accepted=tuple(sorted(accept)))
        origin = replace(log.origin, reading=cut)
    return replace(read, origin=origin, notices=log.notices + read.notices)


def open_columns(given: FrameOrArrays) -> TableFile:
    """Open a log of columns in memory.

    Parameters
    ----------
    given : frame, table or mapping
        A mapping may hold matrices too, (N, 2) or (2, N); an index of a pandas frame counts as a
        column if it has a name.

    Raises
    ------
    LogError
        If these are no columns, as an array without a name, or they cannot be taken over.
    """
    if not is_columns(given):
        raise LogError(
            f"{NAME}: expected a path, a Log, a frame or a dict of arrays, found "
            f"{type(given).__name__}; arrays become a log by algid.Log.from_arrays(t, theta, tau)"
        )
    if isinstance(given, Mapping):
        arrays = {}
        for name, values in given.items():
            try:
                arrays[str(name)] = np.asanyarray(values)
            except Exception as error:  # whatever the values' own library raises
                raise LogError(
                    f"{NAME}: {name!r} is no array ({error}); give numbers of one shape"
                ) from error
        return of_arrays("dict", arrays)
    import pyarrow as pa

    try:
        table = pa.table(given)
    except Exception as error:  # whatever the frame's own library raises
        reason = str(error).split("\n", maxsplit=1)[0][:200]
        raise LogError(
            f"{NAME}: the frame cannot be taken over ({reason}); give columns of numbers"
        ) from error
    attributes = getattr(given, "attrs", None)  # of pandas
    if isinstance(attributes, Mapping) and attributes:
        said = {str(key): value for key, value in attributes.items()}
        known = table.schema.metadata or {}
        table = table.replace_schema_metadata({**known, ATTRS: json.dumps(said, default=str)})
    return of_arrow("frame", table)
