"""How every panel looks: plotly's template, in the page's colours.

Pieces of HTML: foreign text escaped, tables, figures, and data inside a script.
"""

from __future__ import annotations

import html
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from algid.report.figures.base import Figure, Legend, Missing
from algid.report.table import Column, Table
from algid.report.text import visible
from algid.results import Status

_AXIS: dict[str, Any] = {
    "gridcolor": "@grid",
    "linecolor": "@line",
    "zerolinecolor": "@line",
    "zerolinewidth": 1,
    "tickcolor": "@line",
    "tickfont": {"color": "@muted", "size": 12},
    "title": {"font": {"color": "@muted", "size": 12}, "standoff": 6},
    "automargin": True,
    "exponentformat": "power",
}

TEMPLATE: dict[str, Any] = {
    "layout": {
        "font": {"family": "system-ui, -apple-system, Segoe UI, Roboto, sans-serif", "size": 12, "color": "@ink"},
        "paper_bgcolor": "@page",
        "plot_bgcolor": "@page",
        "margin": {"l": 58, "r": 12, "t": 22, "b": 40},
        "showlegend": False,
        "hoverlabel": {"bgcolor": "@card", "bordercolor": "@line", "font": {"color": "@ink", "size": 12}},
        "modebar": {"bgcolor": "@page/0", "color": "@muted", "activecolor": "@ink"},
        "xaxis": _AXIS,
        "yaxis": _AXIS,
        "coloraxis": {},
    },
    "data": {"heatmap": [{"colorbar": {"tickfont": {"color": "@muted"}}}]},
}


LONGEST_TEXT = 4_000
CARDED = 3  # columns; a row of a wider table stands as a card on a phone, so that no column is out of sight
ANSWERS = ("yes", "no", "none")
LONG_CELL = 40  # beyond, a cell breaks into lines
KEYS = "Arrow keys move, plus and minus zoom, 0 resets."


def escaped(text: str) -> str:
    """`text` as the content of an element or of a quoted attribute, every control character shown."""
    return html.escape(visible(text, LONGEST_TEXT), quote=True)


def script_json(value: object) -> str:
    """`value` as JSON that cannot end the script element it stands in."""
    text = json.dumps(value, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


@dataclass(frozen=True)
class Drawn:
    """A column of drawings by the name of their row, after the column `after`, or last; `small` ones share a line."""

    heading: str
    rows: Mapping[str, str]
    after: str = ""
    small: bool = False


def table_html(table: Table, drawn: Sequence[Drawn] = (), links: Mapping[str, str] | None = None) -> str:
    """A table that scrolls sideways by itself where the page is narrow.

    `links` holds where the names of rows lead.
    """
    slots = _slots(table.columns, drawn)
    head = "".join(map(_heading, slots))
    body = "".join(f"<tr{_doubtful(table, row)}>{_row(slots, row, links or {})}</tr>\n" for row in table.rows)
    note = f'<p class="note">{escaped(table.note)}</p>' if table.note else ""
    cards = " cards" if len(slots) > CARDED else ""
    return (
        f'<div class="scroll{cards}" role="region" tabindex="0" aria-label="{escaped(table.title)}"><table>'
        f"<caption>{escaped(table.title)}</caption>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{body}</tbody>"
        f"</table></div>{note}\n"
    )


Slot = tuple[int, Column] | Drawn
"""A column of the table with its place in a row, or one of drawings."""


def _slots(columns: Sequence[Column], drawn: Sequence[Drawn]) -> list[Slot]:
    slots: list[Slot] = []
    for place, column in enumerate(columns):
        slots += [(place, column), *(one for one in drawn if one.after == column.heading)]
    return [*slots, *(one for one in drawn if one not in slots)]


def _heading(slot: Slot) -> str:
    if isinstance(slot, Drawn):
        return f'<th scope="col" class="drawn">{escaped(slot.heading)}</th>'
    return f'<th scope="col"{_class(slot[1])}>{escaped(slot[1].heading)}</th>'


def _row(slots: Sequence[Slot], row: tuple[str, ...], links: Mapping[str, str]) -> str:
    return "".join(
        f'<td class="drawn{" small" if slot.small else ""}" data-label="{escaped(slot.heading)}">'
        f"{slot.rows.get(row[0], '')}</td>"
        if isinstance(slot, Drawn)
        else _cell(slot[1], row[slot[0]], links)
        for slot in slots
    )


def _doubtful(table: Table, row: tuple[str, ...]) -> str:
    """The class of a row whose number must not be used as it is."""
    kinds = {column.kind: text for column, text in zip(table.columns, row, strict=True)}
    poor = "doubtful status" in kinds or kinds.get("status", Status.OK.value) != Status.OK.value
    return ' class="doubtful"' if poor else ""


def _cell(column: Column, text: str, links: Mapping[str, str]) -> str:
    if column.kind == "name":
        shown = f'<a href="{escaped(links[text])}">{escaped(text)}</a>' if text in links else escaped(text)
        return f'<th scope="row">{shown}</th>'
    if column.kind == "doubtful status":
        return f'<td class="status">{escaped(text)}</td>'
    if column.kind == "status":
        return f'<td class="status{" ok" if text == Status.OK.value else ""}">{escaped(text)}</td>'
    main = " estimate" if column.heading == "Estimate" else ""
    long = " long" if column.kind == "text" and len(text) > LONG_CELL else ""
    heading = escaped(column.heading.removesuffix(" std"))  # beside an estimate ± is enough
    bare = column.kind == "number" or text in ANSWERS  # says nothing on a card without its heading
    label = f' data-label="{heading}"' if bare and not main else ""
    return f'<td class="{column.kind}{main}{long}"{label}>{escaped(text)}</td>'


def _class(column: Column) -> str:
    return ' class="number"' if column.kind == "number" else ""


def figure_html(figure: Figure | Missing) -> str:
    """A figure's place on the page, which the script fills; or why there is none."""
    head = f'<h2 id="{figure.key}">{escaped(figure.title)}</h2>\n'
    if isinstance(figure, Missing):
        return f'{head}<p class="missing">Not shown: {escaped(figure.why)}.</p>\n'
    panels = "".join(_panel(figure, place) for place in range(len(figure.panels)))
    note = f'<p class="note">{escaped(figure.note)}</p>' if figure.note else ""
    columns = " two" if figure.columns == 2 else ""
    return (
        f'<figure aria-labelledby="{figure.key}">{head}{_views(figure)}{_legend(figure)}'
        f'<div class="panels{columns}">{panels}</div>\n'
        f'<figcaption><p class="reading">{escaped(figure.reading)}</p>{note}</figcaption></figure>\n'
    )


def panel_id(figure: Figure, place: int) -> str:
    """Where the panel of that place is drawn."""
    return f"{figure.key}-{place}"


def _panel(figure: Figure, place: int) -> str:
    panel = figure.panels[place]
    title = f"<h3>{escaped(panel.title)}</h3>" if panel.title else ""
    return (
        f'<div class="panel">{title}<div class="plot" id="{panel_id(figure, place)}" role="img" tabindex="0" '
        f'style="min-height:{panel.height}px" aria-label="{escaped(panel.says)}. {KEYS}"></div></div>'
    )


def _views(figure: Figure) -> str:
    """A choice among the logs, which the script makes the panels show."""
    if not figure.views:
        return ""
    options = "".join(
        f'<option value="{low:.9g},{high:.9g}">{escaped(name)}</option>' for name, low, high in figure.views
    )
    return (
        f'<label class="views">Show <select data-figure="{figure.key}"><option value="">all logs</option>{options}'
        "</select></label>"
    )


def _legend(figure: Figure) -> str:
    if not figure.legend:
        return ""
    entries = "".join(f"<li>{_entry(figure.key, entry)}</li>" for entry in figure.legend)
    return f'<ul class="legend" aria-label="Legend">{entries}</ul>'


def _entry(key: str, entry: Legend) -> str:
    name, _, opacity = entry.colour.removeprefix("@").partition("/")
    style = f"--tint:var(--{name});opacity:{opacity or 1}"
    words = (
        f'<span class="swatch {entry.mark}" style="{style}"></span><span class="words">{escaped(entry.words)}</span>'
    )
    if not entry.group:
        return f'<span class="entry">{words}</span>'
    data = f'data-figure="{key}" data-group="{escaped(entry.group)}"'
    return f'<button type="button" aria-pressed="true" {data}>{words}</button>'
