"""Parquet and Feather (Arrow) files through pyarrow: only the needed columns, batch by batch."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from algid.log import CANONICAL_COLUMNS, KEY, Companion, loads
from algid.notices import Notice
from algid.readers.table import as_log_error
from algid.readers.table_cells import BATCH_ROWS, TableFile

if TYPE_CHECKING:
    import pyarrow as pa


def open_parquet(path: Path) -> TableFile:
    """Open a Parquet file.

    Raises
    ------
    LogError
        If the file is damaged.
    """
    import pyarrow.parquet as pq

    with as_log_error("Parquet"):
        about = pq.read_metadata(path)
        schema = about.schema.to_arrow_schema()
        names = set(schema.names)  # damaged ones are no text
        # Arrow's schema lacks what its writer, or another one, states beside it
        schema = schema.with_metadata({**(about.metadata or {}), **(schema.metadata or {})})
        text = schema.metadata.get(KEY.encode())
    with as_log_error("truth in the Parquet"):
        companion = Companion(None, {}) if text is None else loads(text)
    notices: tuple[Notice, ...] = ()
    if not companion.sums and {"stamp_ns", *CANONICAL_COLUMNS} <= names:
        notices = (Notice("NO_CHECKSUM", numbers={"case": "values"}),)

    def batches(columns: Sequence[str]) -> Iterator[pa.RecordBatch]:
        with (
            as_log_error("Parquet"),
            pq.ParquetFile(path, page_checksum_verification=True, pre_buffer=False) as file,
        ):
            yield from file.iter_batches(BATCH_ROWS, columns=list(columns), use_threads=False)

    return TableFile("parquet", schema, about.num_rows, batches, companion, notices)


def open_feather(path: Path) -> TableFile:
    """Open a Feather file.

    Raises
    ------
    LogError
        If the file is damaged.
    """
    import pyarrow as pa

    def batches(columns: Sequence[str]) -> Iterator[pa.RecordBatch]:
        with as_log_error("Feather"), pa.memory_map(str(path)) as source:
            places = [names.index(name) for name in columns]
            options = pa.ipc.IpcReadOptions(included_fields=places)
            reader = pa.ipc.open_file(source, options=options)
            for number in range(reader.num_record_batches):
                batch = reader.get_batch(number)
                batch.validate(full=True)
                for first in range(0, batch.num_rows, BATCH_ROWS):
                    yield batch.slice(first, BATCH_ROWS)

    with as_log_error("Feather"), pa.memory_map(str(path)) as source:
        schema = pa.ipc.open_file(source).schema
        names = list(schema.names)  # damaged ones are no text
    rows = sum(batch.num_rows for batch in batches(names[:1]))
    return TableFile("feather", schema, rows, batches)
