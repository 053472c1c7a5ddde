"""Parquet logs: flat canonical columns, stamps in ns, the truth in the file's metadata."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

from algid.base.arrow import table_of_columns
from algid.base.errors import OutputError
from algid.base.files import whole_file
from algid.log import KEY, Companion, Log, Truth
from algid.writers import UNITS, columns


def write(
    path: Path, blocks: Iterable[Log], *, truth: Truth | None = None, force: bool = True
) -> None:
    """Write the blocks of a log, a row group a block: t in s … stamp_ns last.

    Raises
    ------
    OutputError
        If the file cannot be written there, or exists and `force` is not set, or there is no block.
    """
    import pyarrow.parquet as pq

    sums: dict[str, int] = {}
    writer = None
    with whole_file(path, force=force) as temporary:
        try:
            for block in blocks:
                table = table_of_columns(columns(block, sums))
                # floats of a measured signal hardly ever repeat: a dictionary would only cost time
                writer = writer or pq.ParquetWriter(
                    temporary,
                    table.schema,
                    compression="zstd",
                    use_dictionary=False,
                    write_page_checksum=True,
                )
                writer.write_table(table)
            if writer is None:
                raise OutputError(f"{path}: there is no sample to write")
            units = {name: unit for name in sums if (unit := UNITS.get(name[:-1]))}
            stated = {KEY: Companion(truth, sums).dumps(), "units": json.dumps(units)}
            writer.add_key_value_metadata(stated)
        finally:
            if writer is not None:
                writer.close()
