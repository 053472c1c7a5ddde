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
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING, Any, ClassVar

from algid.base.errors import LogError
from algid.base.limits import LIMITS
from algid.base.text import repeated
from algid.log import Companion
from algid.notices import Notice
from algid.readers.annotations import BAD, GOOD, GROUPS, object_in, several, units_in
from algid.readers.column_names import STEMS
from algid.readers.table import as_log_error

if TYPE_CHECKING:
    import polars as pl
    import pyarrow as pa

ATTRS = "PANDAS_ATTRS"
"""The key of metadata under which pandas saves the attributes of a frame."""
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
    kind : str
        Its format.
    schema : pyarrow.Schema
        Names and types of the columns; what the file states of them is in the metadata.
    rows : int
        0 where the file does not tell.
    batches : callable
        A fresh pass over some columns in record batches, in which whatever way of missing a value
        the format has is a null.
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

    kind: str
    schema: pa.Schema
    rows: int
    batches: Callable[[Sequence[str]], Iterator[pa.RecordBatch]]
    companion: Companion = field(default_factory=lambda: Companion(None, {}))
    notices: tuple[Notice, ...] = ()
    others: tuple[str, ...] = ()
    expected: int = 0
    said: tuple[str, ...] = ()

    @cached_property
    def metadata(self) -> dict[str, str]:
        """What it states of itself as text, the attributes of a pandas frame too.

        Those by a column's name are the column's.
        """
        metadata = decoded(self.schema.metadata)
        saved: Any = object_in(metadata.pop(ATTRS, ""))  # by pandas itself, or by Arrow
        saved = saved or object_in(metadata.get("pandas", "")).get("attributes")
        for key, value in saved.items() if isinstance(saved, dict) else ():
            metadata[key] = json.dumps(value) if isinstance(value, dict) else str(value)
        return metadata


@dataclass(frozen=True, eq=False)
class Cell:
    """A number of each row: a column's, or what an `expression` of polars makes of `columns`.

    `joint` is the one whose name stands beside the number; `unit` is what the column's own
    attributes state.
    """

    columns: tuple[str, ...]
    type: pa.DataType
    expression: pl.Expr | None = None
    joint: str = ""
    unit: str = ""
    topic: ClassVar[str] = ""
    column: ClassVar[str] = ""

    @property
    def is_number(self) -> bool:
        """Whether it holds integers, floats or decimals."""
        import pyarrow as pa

        kind = self.type.value_type if pa.types.is_dictionary(self.type) else self.type
        return _is_plain(kind) or pa.types.is_decimal128(kind)

    @property
    def is_clock(self) -> bool:
        """Whether it holds dates, durations, or times of a day."""
        import pyarrow as pa

        kind = self.type
        return pa.types.is_timestamp(kind) or pa.types.is_duration(kind) or pa.types.is_time(kind)

    @property
    def is_column(self) -> bool:
        """Whether it is a column as it stands."""
        return self.expression is None and (_is_plain(self.type) or self.is_clock)

    @property
    def taken(self) -> pl.Expr:
        """What takes it out of the columns."""
        own = _whole(self.columns[0]) if self.expression is None else self.expression
        return own if _is_plain(self.type) or self.is_clock else own.cast(float)


def cell_batches(
    table: TableFile, cells: Mapping[str, Cell], sources: Mapping[str, str]
) -> Iterator[pa.RecordBatch]:
    """Some cells of each batch of rows, by channel: integers, floats, or for a clock its ticks.

    Of rows that a flag takes out each is null.
    """
    import pyarrow as pa

    chosen = [cells[source] for source in sources.values()]
    columns = [column for one in chosen for column in one.columns]
    bad, made = list[Any](), list[Any]()
    for name in [one for one in cells if one.lower() in GOOD or one.lower() in BAD]:
        flag, kind = _whole(name), cells[name].type
        if is_text(kind):
            flag = ~flag.str.strip_chars().str.to_lowercase().is_in(_NO)
        elif not (pa.types.is_boolean(kind) or _is_plain(kind)):
            continue
        columns.append(name)
        bad.append(flag.cast(float).ne(0).fill_null(value=True) ^ (name.lower() in GOOD))
    if bad or not all(one.is_column for one in chosen):
        import polars as pl  # plain columns need not wait for it

        for place, one in enumerate(chosen):
            value = pl.when(~pl.any_horizontal(bad)).then(one.taken) if bad else one.taken
            made.append(value.alias(str(place)))
    for batch in table.batches(list(dict.fromkeys(columns))):
        arrays = [batch.column(one.columns[0]) for one in chosen]
        if made:
            arrays = [series.to_arrow() for series in pl.DataFrame(batch).select(made)]
        for place, one in enumerate(chosen):
            if one.is_clock:
                ticks = pa.int32() if one.type.bit_width == 32 else pa.int64()
                arrays[place] = arrays[place].cast(one.type).view(ticks)
        yield pa.RecordBatch.from_arrays(arrays, names=[*sources])


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
        raise LogError(f"the column {twice[0][:80]!r} stands in the file twice; rename one")
    nested = [one.name for one in table.schema if is_list(one.type) or pa.types.is_struct(one.type)]
    frame: Any = None
    if nested:
        import polars as pl

        with as_log_error(table.kind):
            none = table.schema.empty_table().select(nested)
            frame = pl.DataFrame(next(table.batches(nested), none))
    metadata = table.metadata
    label, joints = _spoken(table)
    fills = {key.lower(): value for key, value in metadata.items() if key.lower() in _FILLS}
    cells: dict[str, Cell] = {}
    for one in table.schema:
        own = decoded(one.metadata) | object_in(metadata.get(one.name, ""))
        own = {key.lower(): str(value) for key, value in own.items()}
        said = fills | own
        if one.name == label:
            continue
        lists: Any = _lists(_whole(one.name), one.type) if is_list(one.type) else None
        if joints and lists is not None and _is_quantity(one.name):
            called = _lists(_whole(label), table.schema.field(label).type)
            for joint in joints[: LIMITS.joints]:
                number = _beside(joint, called, lists)
                cell = Cell((one.name, label), one.type.value_type, number, joint)
                cells[f"/{label}/{joint}/{one.name}"] = _marked(cell, said)
            continue
        # structures may come in any order, too, where they have a name of their own
        inner = one.type if lists is None else one.type.value_type
        fields = [*inner] if lists is not None and pa.types.is_struct(inner) else []
        names = [field.name for field in fields if field.name.lower() in LABELS]
        if names and is_text(inner.field(names[0]).type):
            known = frame[one.name].explode().struct.field(names[0]).drop_nulls()
            known = known.unique(maintain_order=True)[: LIMITS.joints]
            called = lists.eval(pl.element().struct.field(names[0])).list
            for joint, field in product(known, fields):
                number = _beside(
                    joint, called, lists.eval(pl.element().struct.field(field.name)).list
                )
                cell = Cell((one.name,), field.type, number, joint)
                cells[f"/{one.name}/{joint}/{field.name}"] = _marked(cell, said)
            continue
        named = [text[key] for text in (own, metadata) for key in LABELS if key in text]
        names = next(filter(None, map(_names, named)), [])
        parts: list[Any] = [(one.name, one.type, None)]
        if one.name in nested:
            parts = [*_within(one.name, one.type, _whole(one.name), frame)]
        for name, kind, part in parts:
            place = _PLACE.fullmatch(name)
            if place and _is_quantity(place[1]) and int(place[2]) < len(names):
                name = f"/joint_names/{names[int(place[2])]}/{place[1]}"
            cells[name] = _marked(Cell((one.name,), kind, part), said)
            if len(cells) > LIMITS.columns:
                raise LogError(f"more than {LIMITS.columns} columns; expected a log of an arm")
    return cells


def _whole(column: str) -> pl.Expr:
    """A column by its name, which is no pattern."""
    from polars import selectors

    return selectors.by_name(column).as_expr()


def _lists(values: pl.Expr, kind: pa.DataType) -> Any:
    """What polars does with lists, of a fixed size too."""
    import pyarrow as pa

    return (values.arr.to_list() if pa.types.is_fixed_size_list(kind) else values).list


def _within(
    name: str, kind: pa.DataType, values: pl.Expr, frame: pl.DataFrame
) -> Iterator[tuple[str, pa.DataType, pl.Expr]]:
    """Names, types and `values` of the cells of a column, of which a `frame` has some rows."""
    import pyarrow as pa

    if pa.types.is_struct(kind):
        for place, one in enumerate(kind):
            yield from _within(f"{name}.{one.name}", one.type, values.struct[place], frame)
    elif is_list(kind):
        lists = _lists(values, kind)
        for place in range(min(frame.select(lists.len().max()).item() or 0, LIMITS.list_cells)):
            number = lists.get(place, null_on_oob=True)
            yield from _within(f"{name}[{place}]", kind.value_type, number, frame)
    else:
        yield name, kind, values


_PLACE = re.compile(r"(.+)\[(\d+)\]")


def _beside(joint: str, called: Any, numbers: Any) -> pl.Expr:
    """In each row the number at the place of a joint's name, null where there is none."""
    import polars as pl

    mine = called.eval(pl.element() == joint).list
    at = pl.when(mine.any() & (numbers.len() == called.len())).then(mine.arg_max())
    number: pl.Expr = numbers.get(at, null_on_oob=True)
    return number


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
            rows = (row.as_py() for batch in table.batches([one.name]) for row in batch.column(0))
            return one.name, next((row for row in rows if len(row or ()) > 1), [])
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


def _marked(cell: Cell, said: Mapping[str, str]) -> Cell:
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
                    f"{key} of the column {cell.columns[0]!r} is {said[key][:40]!r}; "
                    "expected a number"
                ) from error
    if not numbers:
        return cell
    scale, offset = numbers.pop("scale_factor", 1.0), numbers.pop("add_offset", 0.0)
    known = cell.taken.cast(float)
    for fill in numbers.values():
        known = known.replace(fill, None)
    return replace(cell, type=pa.float64(), expression=known * scale + offset)


def units_of(table: TableFile, cells: Mapping[str, Cell]) -> dict[str, str]:
    """By cell the unit that the file's metadata state of it, of its column, or of its quantity.

    A column of texts such as ``torque_unit`` states one too, in its first row.
    """
    metadata = dict(table.metadata)
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


def _values(table: TableFile, name: str) -> Iterator[Any]:
    """The values of a column, each once a batch."""
    for batch in table.batches([name]):
        yield from batch.column(0).drop_null().unique().to_pylist()
