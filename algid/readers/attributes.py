"""What a table says of its columns beside their names, applied to them before they are chosen.

Attributes scale them (CF: value = scale_factor · stored + add_offset) and mark missing values,
lists of joints' names stand beside lists of numbers, and flags say which rows are no measurements.
Columns that say whose a row is are told where they have several values.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from algid.base.arrow import numbers_of
from algid.base.errors import LogError
from algid.base.limits import LIMITS
from algid.readers.names import STEMS
from algid.readers.stated import BAD, GOOD, GROUPS, several

if TYPE_CHECKING:
    import pyarrow as pa

    from algid.readers.flat import TableFile

LABELS = ("name", "names", "joint_name", "joint_names")
"""What a list of the joints' names is called: a column, or a key of metadata."""
_FILLS = ("_fillvalue", "missing_value")
_NO = ("false", "False", "FALSE", "no", "0", "")
ATTRIBUTES = ("unit", "units", "scale_factor", "add_offset", *_FILLS)
"""Attributes of a column, in lower case."""
_QUANTITIES = frozenset(stem for stems in STEMS.values() for stem in stems)


@dataclass(frozen=True)
class _Column:
    """A column made of others: its field, those that it needs, and what makes it of a batch."""

    field: pa.Field
    sources: tuple[str, ...]
    of: Callable[[pa.RecordBatch], pa.Array]


def honoured(table: TableFile) -> TableFile:
    """The table with what it says of its columns applied to them.

    Raises
    ------
    LogError
        If an attribute that should be a number is none.
    """
    import pyarrow as pa

    names = table.schema.names
    if len(set(names)) < len(names):  # told by whoever reads it
        return table
    metadata = decoded(table.schema.metadata)
    said = {key.lower(): value for key, value in metadata.items() if key.lower() in _FILLS}
    columns: dict[str, _Column] = {}
    for field in table.schema:
        own = said | {key.lower(): value for key, value in decoded(field.metadata).items()}
        columns[field.name] = _scaled(table.path, field, own)
    columns = _by_joint(table, columns, metadata)
    flags = [one for one in names if one.lower() in GOOD | BAD and _is_flag(table.schema, one)]
    notices = list(table.notices)
    units = {}
    for field in table.schema:
        if field.name.lower().endswith(("_unit", "_units")) and is_text(field.type):
            units[field.name] = next(_values(table, field.name), "")
        elif field.name.lower() in GROUPS and not pa.types.is_nested(field.type):
            found: set[object] = set()
            for value in _values(table, field.name):
                found.add(value)
                if len(found) > LIMITS.joints:
                    break
            if len(found) > 1:
                notices.append(several(field.name, found))

    def batches(wanted: Sequence[str], most: int | None) -> Iterator[pa.RecordBatch]:
        sources = [source for name in wanted for source in columns[name].sources]
        for batch in table.batches(list(dict.fromkeys((*sources, *flags))), most):
            arrays = [columns[name].of(batch) for name in wanted]
            flagged = np.zeros(batch.num_rows, np.bool_)
            for name in flags:
                value = _flag(batch.column(name))
                flagged |= (value == 0) if name.lower() in GOOD else (value != 0)
            if flagged.any():
                import pyarrow.compute as pc

                mask = pa.array(flagged)
                arrays = [pc.if_else(mask, pa.scalar(None, one.type), one) for one in arrays]
            fields = [columns[name].field for name in wanted]
            yield pa.RecordBatch.from_arrays(arrays, schema=pa.schema(fields))

    schema = pa.schema([one.field for one in columns.values()], metadata=metadata | units)
    return replace(table, schema=schema, batches=batches, notices=tuple(notices))


def decoded(metadata: Mapping[bytes, bytes] | None) -> dict[str, str]:
    """Metadata of Arrow as text."""
    texts = {}
    for key, value in (metadata or {}).items():
        texts[key.decode(errors="replace")] = value.decode(errors="replace")
    return texts


def is_text(kind: pa.DataType) -> bool:
    """Whether a column holds texts."""
    import pyarrow as pa

    return "string" in str(kind) and not pa.types.is_nested(kind)


def _is_flag(schema: pa.Schema, name: str) -> bool:
    import pyarrow as pa

    kind = schema.field(name).type
    numbers = pa.types.is_boolean(kind) or pa.types.is_integer(kind) or pa.types.is_floating(kind)
    return numbers or is_text(kind)


def _flag(values: pa.Array) -> Any:
    """Flags (N,) as numbers, 1 for any text but a no."""
    if not is_text(values.type):
        return numbers_of(values)
    return np.array([float(text not in _NO) for text in values.to_pylist()])


def _values(table: TableFile, name: str) -> Iterator[Any]:
    """The values of a column, each once a batch."""
    for batch in table.batches([name], None):
        yield from batch.column(0).drop_null().unique().to_pylist()


def _scaled(path: str, field: pa.Field, said: Mapping[str, str]) -> _Column:
    """A column in the unit of its field: nulls for the value that marks a missing one, scaled."""
    import pyarrow as pa

    name, kind = field.name, field.type
    inner = kind.value_type if _is_list(kind) else kind
    plain = pa.types.is_integer(inner) or pa.types.is_floating(inner)
    numbers = {}
    for key in ("scale_factor", "add_offset", *_FILLS):
        if plain and key in said:
            try:
                numbers[key] = float(said[key])
            except ValueError as error:
                raise LogError(
                    f"{path}: {key} of the column {name!r} is {said[key][:40]!r}; expected a number"
                ) from error
    scale, offset = numbers.pop("scale_factor", 1.0), numbers.pop("add_offset", 0.0)
    if not numbers and (scale, offset) == (1.0, 0.0):
        return _Column(field, (name,), lambda batch: batch.column(name))

    def of(values: pa.Array) -> pa.Array:
        import pyarrow.compute as pc

        if _is_list(values.type):
            within = of(values.values)
            if pa.types.is_fixed_size_list(values.type):
                return pa.FixedSizeListArray.from_arrays(within, values.type.list_size)
            return type(values).from_arrays(values.offsets, within, mask=values.is_null())
        values = values.cast(pa.float64())
        for fill in numbers.values():
            missing = pc.is_nan(values) if np.isnan(fill) else pc.equal(values, fill)
            values = pc.if_else(missing, pa.scalar(None, pa.float64()), values)
        if (scale, offset) == (1.0, 0.0):
            return values
        return pc.add(pc.multiply(values, scale), offset)

    made = pa.float64()
    if pa.types.is_fixed_size_list(kind):
        made = pa.list_(made, kind.list_size)
    elif _is_list(kind):
        made = pa.large_list(made) if pa.types.is_large_list(kind) else pa.list_(made)
    return _Column(field.with_type(made), (name,), lambda batch: of(batch.column(name)))


def _is_list(kind: pa.DataType) -> bool:
    import pyarrow as pa

    types = pa.types
    return types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind)


def _by_joint(
    table: TableFile, columns: dict[str, _Column], metadata: Mapping[str, str]
) -> dict[str, _Column]:
    """A column a joint in place of lists beside which the joints' names stand.

    The names are a column of lists, or in the metadata of the file or the field. Those of the
    first row with two joints are taken: of another order later on the numbers follow the names,
    and rows that name none of them have no value.
    """
    label, joints = "", list[str]()
    for field in table.schema:
        if field.name.lower() in LABELS and _is_list(field.type) and is_text(field.type.value_type):
            rows = (row for batch in table.batches([field.name], None) for row in batch.column(0))
            label = field.name
            joints = next((row.as_py() for row in rows if len(row.as_py() or ()) > 1), [])
            break
    by_joint: dict[str, _Column] = {}
    for name, column in columns.items():
        stem, bracket, place = name.partition("[")
        said = {**metadata, **decoded(column.field.metadata)}
        own = joints or next((_names(said[key]) for key in LABELS if key in said), [])
        quantity = stem.lower().replace(".", "_") in _QUANTITIES
        if not (own and quantity):
            if name != label:
                by_joint[name] = column
        elif bracket and place[:-1].isdigit() and int(place[:-1]) < len(own):
            named = f"/joint_names/{own[int(place[:-1])]}/{stem}"
            by_joint[named] = replace(column, field=column.field.with_name(named))
        elif _is_list(column.field.type):
            for number, joint in enumerate(own[: LIMITS.joints]):
                named = f"/{label or 'joint_names'}/{joint}/{name}"
                by_joint[named] = _of_joint(column, named, label, joint, number)
        else:
            by_joint[name] = column
    return by_joint


def _names(text: str) -> list[str]:
    """Names in a JSON list, or between commas."""
    try:
        names = json.loads(text)
    except ValueError:
        names = [one.strip() for one in text.split(",")]
    if not (isinstance(names, list) and all(isinstance(one, str) and one for one in names)):
        return []
    return names if len(set(names)) == len(names) > 1 else []


def _of_joint(column: _Column, named: str, label: str, joint: str, number: int) -> _Column:
    """The number of one joint in lists: beside its name in the lists `label`, or at a place."""
    import pyarrow as pa

    def of(batch: pa.RecordBatch) -> pa.Array:
        lists = column.of(batch)
        starts, sizes, values = _unrolled(lists)
        places = np.full(len(lists), number)
        if label:
            first, count, texts = _unrolled(batch.column(label))
            rows = np.repeat(np.arange(len(lists)), count)
            within = np.arange(rows.size) - np.repeat(np.cumsum(count) - count, count)
            spoken = np.array(texts.to_pylist(), object)[np.repeat(first, count) + within]
            places[:] = -1
            mine = np.flatnonzero(spoken == joint)[::-1]  # of two alike the first one counts
            places[rows[mine]] = within[mine]
        there = (places >= 0) & (places < sizes)
        numbers = np.full(len(lists), np.nan)
        numbers[there] = numbers_of(values)[starts[there] + places[there]]
        return pa.array(numbers, mask=~there)

    sources = (*column.sources, label) if label else column.sources
    return _Column(pa.field(named, pa.float64(), metadata=column.field.metadata), sources, of)


def _unrolled(lists: pa.Array) -> tuple[Any, Any, pa.Array]:
    """First places and sizes (N,) of lists within all of their values, and the values."""
    import pyarrow as pa

    if pa.types.is_fixed_size_list(lists.type):
        size = lists.type.list_size
        starts = (lists.offset + np.arange(len(lists))) * size
        return starts, np.full(len(lists), size), lists.values
    ends = np.asarray(lists.offsets.to_numpy(), np.int64)
    return ends[:-1], np.diff(ends), lists.values
