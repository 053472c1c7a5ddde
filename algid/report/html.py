"""A document's parts as HTML: escaped text, tables with drawings, places for the scripts."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

from algid.notices import Notice
from algid.report.arm import ArmDrawing, arm_html
from algid.report.document import (
    Bullets,
    Column,
    Content,
    Document,
    Drawn,
    ReadingAid,
    References,
    Section,
    Table,
)
from algid.report.figures.base import Figure, Missing, Panel
from algid.report.text import escaped
from algid.results import Status
from algid.verdict import MOST_REASONS, Verdict
from algid.words import counted

# columns; a row of a wider table stands as a card on a phone, so that no column is out of sight
CARDED = 3
ANSWERS = ("yes", "no", "none")
PLAIN = frozenset({"Format", "Log", "Meaning", "Parameter", "Robot", "Unit", "What", "Why"})
"""Headings of texts that say themselves what they are, but for an answer."""
LONG_CELL = 40  # beyond, a cell breaks into lines
KEYS = "Arrow keys move, plus and minus zoom, 0 resets."
SIGNS = {"good": "✓", "reservations": "!", "failed": "✕"}


_WHOLE = re.compile(r"(?<![\w-])(?:--[a-z][\w-]*|\d{4}-\d\d-\d\d(?![\w-]))")


def unbroken(text: str) -> str:
    """`text` for an element; no line of it ends within a flag or a date."""
    return _WHOLE.sub(r'<span class="whole">\g<0></span>', escaped(text))


def banner(judged: Verdict) -> str:
    """The verdict in its colour: headline, the first reasons, what to run first.

    The rest is folded away.
    """
    first, rest = judged.reasons[:MOST_REASONS], judged.reasons[MOST_REASONS:]
    shown = ""
    if first:
        shown = f"<ul>{_listed(_sentences(first))}</ul>"
    if judged.command:
        shown += f'<p class="cause">Run first: <code>{unbroken(judged.command)}</code></p>'
    shown += _folded(counted(len(rest), "more reason"), rest)
    shown += _folded(f"data notes ({len(judged.notes)})", judged.notes)
    return (
        f'<div class="verdict {judged.grade}"><span class="sign" '
        f'aria-hidden="true">{SIGNS[judged.grade]}</span>'
        f"<div><p><strong>{judged.word}</strong>: "
        f"{escaped(judged.headline)}.</p>{shown}</div></div>"
    )


def _sentences(notices: Iterable[Notice]) -> tuple[str, ...]:
    return tuple(one.sentence for one in notices)


def _folded(title: str, notices: Sequence[Notice]) -> str:
    """Notices behind their title; nothing where there is none."""
    if not notices:
        return ""
    return (
        f"<details><summary>{escaped(title)}</summary>"
        f"<ul>{_listed(_sentences(notices))}</ul></details>"
    )


def _listed(sentences: Iterable[str]) -> str:
    return _items(map(unbroken, sentences))


def _items(entries: Iterable[str]) -> str:
    """Entries of a list, which are HTML."""
    return "".join(f"<li>{entry}</li>" for entry in entries)


def contents(document: Document) -> str:
    """The page's contents: numbers first, then sections, and figures without a heading."""
    links = [("numbers", "Numbers")]
    for section in document.sections:
        links += _links(section)
    listed = _items(f'<a href="#{key}">{escaped(title)}</a>' for key, title in links)
    return (
        '<nav aria-label="Contents"><details '
        f"open><summary>Contents</summary><ul>{listed}</ul></details></nav>"
    )


def _links(section: Section) -> Iterator[tuple[str, str]]:
    if not section.listed:
        return
    if section.key and section.content:
        yield section.key, section.title
    elif not section.key:
        for one in section.content:
            if isinstance(one, Figure | Missing | ArmDrawing):
                yield one.key, one.title


def section_html(section: Section) -> str:
    """A part of the page; nothing where it would be empty."""
    if not section.content:
        return ""
    inner = "\n".join(map(content_html, section.content))
    key, title = section.key, unbroken(section.title)
    if section.fold:
        opened = " open" if section.fold == "open" else ""
        kind = "paper" if section.listed else "paper one"
        return (
            f'<details class="{kind}" '
            f'id="{key}"{opened}><summary>{title}</summary>\n{inner}</details>'
        )
    if key:
        return f'<section aria-labelledby="{key}"><h2 id="{key}">{title}</h2>\n{inner}\n</section>'
    if section.beside is not None:
        beside = arm_html(section.beside)
        if beside:
            return f'<div class="first"><div>\n{inner}\n</div>{beside}</div>'
    return inner


def content_html(content: Content) -> str:
    """One part of a section."""
    match content:
        case Table():
            return table_html(content)
        case Figure() | Missing():
            return figure_html(content)
        case ArmDrawing():
            return arm_html(content)
        case ReadingAid(text):
            return f'<p class="reading">{escaped(text)}</p>'
        case Bullets(sentences, otherwise):
            if sentences:
                return f"<ul>{_listed(sentences)}</ul>"
            return f'<p class="note">{escaped(otherwise)}</p>'
        case References():
            return references_html(content)


def references_html(references: References) -> str:
    """The links of each group, as many as are shown."""
    groups = []
    for name, links in references.groups.items():
        shown = []
        for words, place in links[: references.most]:
            shown.append(f'<a href="{escaped(place)}">{escaped(words)}</a>')
        listed = ", ".join(shown)
        if len(links) > references.most:
            listed += f" and {len(links) - references.most:,} more"
        groups.append(f"<dt>{escaped(name)}</dt><dd>{listed or 'none'}</dd>")
    return f"<dl>{''.join(groups)}</dl>"


def _note(text: str) -> str:
    """A note below a table or a figure; nothing where there is none."""
    if not text:
        return ""
    return f'<p class="note">{unbroken(text)}</p>'


Slot = tuple[int, Column] | Drawn
"""A column of the table with its place in a row, or one of drawings."""


def table_html(table: Table) -> str:
    """A table with its drawings that scrolls sideways by itself where the page is narrow."""
    slots: list[Slot] = []
    for place, column in enumerate(table.columns):
        slots.append((place, column))
        slots += [one for one in table.drawn if one.after == column.heading]
    slots += [one for one in table.drawn if one not in slots]
    head = "".join(map(_heading, slots))
    body = ""
    for row in table.rows:
        cells = "".join(_cell(table, slot, row) for slot in slots)
        body += f"<tr{_doubtful(table, row)}>{cells}</tr>\n"
    cards = " cards" if len(slots) > CARDED else ""
    return (
        f'<div class="scroll{cards}" role="region" tabindex="0" '
        f'aria-label="{escaped(table.title)}"><table>'
        f"<caption>{escaped(table.title)}</caption>\n<thead><tr>{head}</tr></thead>\n"
        f"<tbody>\n{body}</tbody>"
        f"</table></div>{_note(table.note)}\n"
    )


def _heading(slot: Slot) -> str:
    if isinstance(slot, Drawn):
        return f'<th scope="col" class="drawn">{escaped(slot.heading)}</th>'
    right = ' class="number"' if slot[1].kind == "number" else ""
    return f'<th scope="col"{right}>{escaped(slot[1].heading)}</th>'


def _doubtful(table: Table, row: tuple[str, ...]) -> str:
    """The class of a row whose number must not be used as it is."""
    for column, text in zip(table.columns, row, strict=True):
        if column.kind == "doubtful status":
            return ' class="doubtful"'
        if column.kind == "status" and text != Status.OK.value:
            return ' class="doubtful"'
    return ""


def _cell(table: Table, slot: Slot, row: tuple[str, ...]) -> str:
    if isinstance(slot, Drawn):
        small = " small" if slot.small else ""
        drawing = slot.rows.get(row[0], "")
        return f'<td class="drawn{small}" data-label="{escaped(slot.heading)}">{drawing}</td>'
    column, text = slot[1], row[slot[0]]
    match column.kind:
        case "name":
            named = escaped(text)
            if table.links and text in table.links:
                named = f'<a href="{escaped(table.links[text])}">{named}</a>'
            return f'<th scope="row">{named}</th>'
        case "status" if text == Status.OK.value:
            return f'<td class="status ok">{escaped(text)}</td>'
        case "status" | "doubtful status":
            return f'<td class="status">{escaped(text)}</td>'
        case "number":
            return _number_cell(column, text)
        case "text":
            return _text_cell(column, text)


def _number_cell(column: Column, text: str) -> str:
    """A number; a status behind it has a line of its own."""
    shown = escaped(text)
    number, mark, status = shown.rpartition(" (")
    if mark and shown.endswith(")"):
        shown = f'{number} <span class="aside">({status}</span>'
    if column.heading == "Estimate":
        return f'<td class="number estimate">{shown}</td>'
    return f'<td class="number"{_label(column)}>{shown}</td>'


def _text_cell(column: Column, text: str) -> str:
    """A text; on a card it has its heading, unless it says itself what it is."""
    kinds = "text long" if len(text) > LONG_CELL else "text"
    labelled = text in ANSWERS or (text and column.heading not in PLAIN)
    label = _label(column) if labelled else ""
    return f'<td class="{kinds}"{label}>{unbroken(text)}</td>'


def _label(column: Column) -> str:
    """The heading of a cell on a card."""
    heading = column.heading.removesuffix(" std")  # beside an estimate ± is enough
    return f' data-label="{escaped(heading)}"'


def figure_html(figure: Figure | Missing) -> str:
    """A figure's place on the page, which the script fills; or why there is none."""
    head = f'<h2 id="{figure.key}">{escaped(figure.title)}</h2>\n'
    if isinstance(figure, Missing):
        return f'{head}<p class="missing">Not shown: {escaped(figure.why)}.</p>\n'
    panels = ""
    for place, panel in enumerate(figure.panels):
        panels += _panel(panel, panel_id(figure, place))
    columns = " two" if figure.columns == 2 else ""
    return (
        f'<figure aria-labelledby="{figure.key}">{head}{_views(figure)}{_legend(figure)}'
        f'<div class="panels{columns}">{panels}</div>\n'
        "<figcaption><p "
        f'class="reading">{escaped(figure.reading)}</p>{_note(figure.note)}</figcaption></figure>\n'
    )


def panel_id(figure: Figure, place: int) -> str:
    """Where the panel of that place is drawn."""
    return f"{figure.key}-{place}"


def _panel(panel: Panel, key: str) -> str:
    title = f"<h3>{escaped(panel.title)}</h3>" if panel.title else ""
    return (
        f'<div class="panel">{title}<div class="plot" id="{key}" role="img" tabindex="0" '
        f'style="min-height:{panel.height}px" aria-label="{escaped(panel.says)}. '
        f'{KEYS}"></div></div>'
    )


def _views(figure: Figure) -> str:
    """A choice among the logs, which the script makes the panels show."""
    if not figure.views:
        return ""
    options = ""
    for name, low, high in figure.views:
        options += f'<option value="{low:.9g},{high:.9g}">{escaped(name)}</option>'
    return (
        f'<label class="views">Show <select data-figure="{figure.key}"><option value="">all '
        f"logs</option>{options}"
        "</select></label>"
    )


def _legend(figure: Figure) -> str:
    """The figure's legend; an entry with a group is a button that shows and hides it."""
    entries = []
    for entry in figure.legend:
        name, _, opacity = entry.colour.removeprefix("@").partition("/")
        swatch = (
            f'<span class="swatch {entry.mark}" '
            f'style="--tint:var(--{name});opacity:{opacity or 1}"></span>'
        )
        words = f'{swatch}<span class="words">{escaped(entry.words)}</span>'
        if entry.group:
            data = f'data-figure="{figure.key}" data-group="{escaped(entry.group)}"'
            pressed = str(entry.shown).lower()
            entries.append(
                f'<button type="button" aria-pressed="{pressed}" {data}>{words}</button>'
            )
        else:
            entries.append(f'<span class="entry">{words}</span>')
    if not entries:
        return ""
    return f'<ul class="legend" aria-label="Legend">{_items(entries)}</ul>'
