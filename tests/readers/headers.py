"""Logs of which only the columns' names and units matter."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pyarrow as pa

from algid.profile import Profile, with_settings
from algid.readers import open_log
from algid.readers.log_reader import TableReader as TableReader


def opened(
    columns: str | Iterable[str],
    settings: Mapping[str, Any] | None = None,
    units: Mapping[str, str] | None = None,
) -> TableReader:
    """A log of two samples with such columns, and what the file states of their units."""
    stated = units or {}
    fields = []
    for name in columns.split() if isinstance(columns, str) else columns:
        metadata = {"unit": stated[name]} if name in stated else None
        fields.append(pa.field(name, pa.float64(), metadata=metadata))
    values = [pa.array(np.arange(2) * 1e-3)] * len(fields)
    table = pa.Table.from_arrays(values, schema=pa.schema(fields))
    return open_log(table, with_settings(Profile(), dict(settings or {})))
