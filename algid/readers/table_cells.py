"""What a row of a table holds: a number a cell, and what the file says of it applied to it.

``q[0]`` is a cell of a column of lists, ``q.x`` one of structures; beside joints' names each joint
has its own. Attributes scale cells (CF: value = scale_factor · stored + add_offset) and mark
missing values, and flags say which rows are no measurements. Columns that say whose a row is are
told where they have several values.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from algid.base.arrow import column_of, numbers_of, whole_column
from algid.base.errors import LogError
from algid.base.limits import LIMITS
from algid.base.text import repeated
from algid.log import Companion
from algid.notices import Notice
from algid.readers.annotations import BAD, GOOD, GROUPS, object_in, several, units_in
from algid.readers.column_names import STEMS

if TYPE_CHECKING:
    import pyarrow as pa

BATCH_ROWS = 1 << 14
"""Rows that are decoded at once: few enough to stay in a core's cache."""
LABELS = ("name", "names", "joint_name", "joint_names")
"""What a list of the joints' names is called: a column, or a key of metadata."""
_FILLS = ("_fillvalue", "missing_value")
_NO = ("false", "no", "0", "")
ATTRIBUTES = ("unit", "units", "scale_factor", "add_offset", *_FILLS)
"""Attributes of a column, in lower case."""
_NO_UNIT = ("", "-", "1", "none", "null", "unknown", "dimensionless")


@dataclass(frozen=True, eq=False)
class TableFile:
    """An opened file, or object in memory, of named columns.

    Attributes
    ----------
    path, kind : str
        What messages call it, and its format.
    schema : pyarrow.Schema
        Names and types of the columns; what the file states of them is in the metadata.
    rows : int
        0 where the file does not tell.
    batches : callable
        A fresh pass over some columns in record batches, of which nobody takes more rows than a
        number if one is given. Whatever way of missing a value the format has is a null.
    companion : Companion
        Truth and sums that algid wrote with the columns.
    notices : tuple of Notice
        What is to be said of the file.
    others : tuple of str
        What else it holds, of another length.
    expected : int
        Rows to expect where `rows` is 0.
    said : tuple of str
        What it states in words, such as comments.
    """

    path: str
    kind: str
    schema: pa.Schema
    rows: int
    batches: Callable[[Sequence[str], int | None], Iterator[pa.RecordBatch]]
    companion: Companion = field(default_factory=lambda: Companion(None, {}))
    notices: tuple[Notice, ...] = ()
    others: tuple[str, ...] = ()
    expected: int = 0
    said: tuple[str, ...] = ()


@dataclass(frozen=True)
class Cell:
    """A number of each row: a column's, or one within its lists and structures.

    `steps` are the places in these; `label` is the column with the joints' names, if the number of
    `joint` stands beside its name; `fills` are values that stand for a missing one; `unit` is what
    the column's own attributes state.
    """

    column: str
    type: pa.DataType
    steps: tuple[int, ...] = ()
    label: str = ""
    joint: str = ""
    fills: tuple[float, ...] = ()
    scale: float = 1.0
    offset: float = 0.0
    unit: str = ""
    topic: ClassVar[str] = ""

    @property
    def is_number(self) -> bool:
        """Whether it holds integers, floats or decimals."""
        import pyarrow as pa

        kind = self.type.value_type if pa.types.is_dictionary(self.type) else self.type
        return _is_plain(kind) or pa.types.is_decimal(kind)

    @property
    def is_clock(self) -> bool:
        """Whether it holds dates, durations, or times of a day."""
        import pyarrow as pa

        kind = self.type
        return pa.types.is_timestamp(kind) or pa.types.is_duration(kind) or pa.types.is_time(kind)

    def of(self, batch: pa.RecordBatch) -> pa.Array:
        """The numbers of a batch: integers, floats, or for a clock ticks of its type."""
        import pyarrow as pa

        values = batch.column(self.column)
        if self.label:
            values = self._beside_its_name(values, batch.column(self.label))
        changed = bool(self.fills) or (self.scale, self.offset) != (1.0, 0.0)
        if self.steps or changed:
            import pyarrow.compute as pc  # plain numbers need not wait for it
        for step in self.steps:
            if pa.types.is_struct(values.type):
                values = pc.struct_field(values, [step])
            else:
                numbers = values.flatten()
                sizes = whole_column(pc.list_value_length(values).fill_null(0))
                size = sizes[0] if len(sizes) else 0
                if (
                    size > step
                    and np.all(sizes == size)
                    and not numbers.null_count
                    and _is_plain(numbers.type)
                ):
                    values = column_of(whole_column(numbers)[step::size])
                else:
                    one = pc.list_slice(values, step, step + 1, return_fixed_size_list=True)
                    values = pc.if_else(values.is_valid(), one.values, None)
        if self.is_clock:
            values = values.view(pa.int32() if self.type.bit_width == 32 else pa.int64())
        elif not _is_plain(values.type):
            if pa.types.is_dictionary(values.type):
                values = values.dictionary_decode()
            if pa.types.is_decimal128(values.type):  # Arrow rounds twice
                import polars as pl

                values = pl.Series(pl.from_arrow(values)).cast(pl.Float64).to_arrow()
            values = values.cast(pa.float64())
        if not changed:
            return values
        values = values.cast(pa.float64())
        for fill in self.fills:
            missing = pc.is_nan(values) if np.isnan(fill) else pc.equal(values, fill)
            values = pc.if_else(missing, None, values)
        return pc.add(pc.multiply(values, self.scale), self.offset)

    def _beside_its_name(self, values: pa.Array, names: pa.Array) -> pa.Array:
        import polars as pl

        frame = pl.DataFrame({"values": pl.from_arrow(values), "names": pl.from_arrow(names)})
        mine = pl.col("names").list.eval(pl.element() == self.joint)
        first = pl.when(mine.list.any()).then(mine.list.arg_max())
        number = pl.col("values").cast(pl.List(pl.Float64)).list.get(first, null_on_oob=True)
        return frame.select(number).to_series().to_arrow()


def cell_batches(
    table: TableFile, cells: Mapping[str, Cell], names: Sequence[str], most: int | None
) -> Iterator[list[pa.Array]]:
    """Some cells of each batch of rows; of rows that a flag takes out each is null."""
    import pyarrow as pa

    chosen = [cells[name] for name in names]
    columns = [one.column for one in chosen] + [one.label for one in chosen if one.label]
    flags = []
    for name in [one for one in cells if one.lower() in GOOD or one.lower() in BAD]:
        kind = cells[name].type
        if pa.types.is_boolean(kind) or _is_plain(kind) or is_text(kind):
            flags.append(name)
    for batch in table.batches(list(dict.fromkeys((*columns, *flags))), most):
        arrays = [cell.of(batch) for cell in chosen]
        flagged = np.zeros(batch.num_rows, np.bool_)
        for name in flags:
            flagged |= _flag(batch.column(name)) == (name.lower() not in GOOD)
        if flagged.any():
            import pyarrow.compute as pc

            mask = pa.array(flagged)
            arrays = [pc.if_else(mask, pa.scalar(None, one.type), one) for one in arrays]
        yield arrays


def cells_of(table: TableFile) -> dict[str, Cell]:
    """Every cell of a row by name; the first rows tell how many cells the lists have.

    Raises
    ------
    LogError
        If a name stands there twice, there are more cells than any log has, or an attribute that
        should be a number is none.
    """
    import pyarrow as pa

    twice = repeated(filter(None, table.schema.names))
    if twice:
        raise LogError(
            f"{table.path}: the column {twice[0][:80]!r} stands in the file twice; rename one"
        )
    nested = [one.name for one in table.schema if is_list(one.type) or pa.types.is_struct(one.type)]
    first = next(table.batches(nested, BATCH_ROWS), None) if nested else None
    metadata = decoded(table.schema.metadata)
    label, joints = _spoken(table)
    cells: dict[str, Cell] = {}
    for one in table.schema:
        own = decoded(one.metadata)
        said = {key.lower(): value for key, value in metadata.items() if key.lower() in _FILLS}
        said |= {key.lower(): value for key, value in own.items()}
        if one.name == label:
            continue
        if joints and is_list(one.type) and _is_quantity(one.name):
            for joint in joints[: LIMITS.joints]:
                cell = Cell(one.name, one.type.value_type, label=label, joint=joint)
                cells[f"/{label}/{joint}/{one.name}"] = _marked(table.path, cell, said)
            continue
        named = [text[key] for text in (own, metadata) for key in LABELS if key in text]
        names = next(filter(None, map(_names, named)), [])
        values = first.column(one.name) if first and one.name in nested else None
        for name, steps, kind in _within(one.name, one.type, values):
            place = _PLACE.fullmatch(name)
            if place and _is_quantity(place[1]) and int(place[2]) < len(names):
                name = f"/joint_names/{names[int(place[2])]}/{place[1]}"
            cells[name] = _marked(table.path, Cell(one.name, kind, steps), said)
            if len(cells) > LIMITS.columns:
                raise LogError(
                    f"{table.path}: more than {LIMITS.columns} columns; expected a log of an arm"
                )
    return cells


def _within(
    name: str, kind: pa.DataType, values: pa.Array | None, steps: tuple[int, ...] = ()
) -> Iterator[tuple[str, tuple[int, ...], pa.DataType]]:
    """Names, steps and types of the cells of a column, of which some `values` are given."""
    import pyarrow as pa

    if not (pa.types.is_struct(kind) or is_list(kind)):
        yield name, steps, kind
        return
    import pyarrow.compute as pc  # a plain table need not wait for it

    if pa.types.is_struct(kind):
        for place, one in enumerate(kind):
            inner = values and pc.struct_field(values, [place])
            yield from _within(f"{name}.{one.name}", one.type, inner, (*steps, place))
    else:
        size = values and pc.max(pc.list_value_length(values)).as_py()
        for place in range(min(size or 0, LIMITS.list_cells)):
            inner = values and values.flatten()
            yield from _within(f"{name}[{place}]", kind.value_type, inner, (*steps, place))


_PLACE = re.compile(r"(.+)\[(\d+)\]")


def _is_quantity(name: str) -> bool:
    """Whether a name is one of a joint's quantity."""
    plain = name.lower().replace(".", "_")
    return any(plain in stems for stems in STEMS.values())


def _spoken(table: TableFile) -> tuple[str, list[str]]:
    """The column of lists of the joints' names, and those of the first row that has two.

    Of another order later on the numbers follow the names, and rows that name none of them have
    no value.
    """
    for one in table.schema:
        if one.name.lower() in LABELS and is_list(one.type) and is_text(one.type.value_type):
            for batch in table.batches([one.name], None):
                for row in batch.column(0):
                    if len(row.as_py() or ()) > 1:
                        return one.name, row.as_py()
            return one.name, []
    return "", []


def _names(text: str) -> list[str]:
    """Names in a JSON list, or between commas."""
    try:
        names = json.loads(text)
    except ValueError:
        names = [one.strip() for one in text.split(",")]
    if not (isinstance(names, list) and all(isinstance(one, str) and one for one in names)):
        return []
    return names if len(set(names)) == len(names) > 1 else []


def _marked(path: str, cell: Cell, said: Mapping[str, str]) -> Cell:
    """The cell with unit, scale, offset and marks of missing values that a file states of it."""
    import pyarrow as pa

    unit = said.get("units", said.get("unit", "")).strip()
    cell = replace(cell, unit="" if unit.lower() in _NO_UNIT else unit[: LIMITS.unit_letters])
    numbers = {}
    for key in ("scale_factor", "add_offset", *_FILLS):
        if key in said and _is_plain(cell.type):
            try:
                numbers[key] = float(said[key])
            except ValueError as error:
                raise LogError(
                    f"{path}: {key} of the column {cell.column!r} is {said[key][:40]!r}; "
                    "expected a number"
                ) from error
    if not numbers:
        return cell
    scale, offset = numbers.pop("scale_factor", 1.0), numbers.pop("add_offset", 0.0)
    fills = tuple(numbers.values())
    return replace(cell, type=pa.float64(), fills=fills, scale=scale, offset=offset)


def units_of(table: TableFile, cells: Mapping[str, Cell]) -> dict[str, str]:
    """By cell the unit that the file's metadata state of it, of its column, or of its quantity.

    A column of texts such as ``torque_unit`` states one too, in its first row.
    """
    metadata = decoded(table.schema.metadata)
    for one in table.schema:
        if one.name.lower().endswith(("_unit", "_units")) and is_text(one.type):
            metadata[one.name] = next(_values(table, one.name), "")
    units = units_in(metadata, list(cells))
    return units | {name: cell.unit for name, cell in cells.items() if cell.unit}


def groups_in(table: TableFile) -> Iterator[Notice]:
    """What to say of columns that say whose a row is, and have several values."""
    import pyarrow as pa

    for one in table.schema:
        if one.name.lower() in GROUPS and not pa.types.is_nested(one.type):
            found: set[object] = set()
            for value in _values(table, one.name):
                found.add(value)
                if len(found) > LIMITS.joints:
                    break
            if len(found) > 1:
                yield several(one.name, found)


def decoded(metadata: Mapping[bytes, bytes] | None) -> dict[str, str]:
    """Metadata of Arrow as text."""
    texts = {}
    for key, value in (metadata or {}).items():
        texts[key.decode(errors="replace")] = value.decode(errors="replace")
    return texts


def attributed(schema: pa.Schema, attributes: Mapping[str, Any] | None = None) -> pa.Schema:
    """A schema with the attributes of a pandas frame, or those that pandas saved with it.

    Those by a column's name are the column's, others the table's.
    """
    import pyarrow as pa

    metadata = decoded(schema.metadata)
    if attributes is None:
        saved = object_in(metadata.pop("PANDAS_ATTRS", ""))  # by pandas itself, or by Arrow
        attributes = saved or object_in(metadata.get("pandas", "")).get("attributes")
        if not isinstance(attributes, Mapping):
            return schema
    fields = []
    for one in schema:
        own = attributes.get(one.name)
        said = {str(k): str(v) for k, v in own.items()} if isinstance(own, Mapping) else {}
        fields.append(one.with_metadata(decoded(one.metadata) | said))
    for key, value in attributes.items():
        if key not in schema.names:
            text = json.dumps(value, default=str) if isinstance(value, Mapping) else str(value)
            metadata[str(key)] = text
    return pa.schema(fields, metadata=metadata)


def is_text(kind: pa.DataType) -> bool:
    """Whether a column holds texts."""
    import pyarrow as pa

    return "string" in str(kind) and not pa.types.is_nested(kind)


def is_list(kind: pa.DataType) -> bool:
    """Whether a column holds lists."""
    import pyarrow as pa

    types = pa.types
    return types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind)


def _is_plain(kind: pa.DataType) -> bool:
    """Whether NumPy has the type."""
    import pyarrow as pa

    return pa.types.is_integer(kind) or pa.types.is_floating(kind)


def _flag(values: pa.Array) -> Any:
    """Whether flags (N,) are set: numbers but zero, texts but a no; NaN where one is missing."""
    if is_text(values.type):
        return np.array([str(text).strip().lower() not in _NO for text in values.to_pylist()])
    return numbers_of(values) != 0


def _values(table: TableFile, name: str) -> Iterator[Any]:
    """The values of a column, each once a batch."""
    for batch in table.batches([name], None):
        yield from batch.column(0).drop_null().unique().to_pylist()
