"""A track's `report.html` and `report.md`, out of the same tables and sentence."""

from __future__ import annotations

from algid.report.html import escaped, figure_html, script_json, table_html
from algid.report.markdown import document as markdown_document
from algid.report.numbers import significant
from algid.report.page import banner, contents, document, drawing, section
from algid.report.text import file_name
from algid.track.figures import figures
from algid.track.result import TrackResult
from algid.track.tables import change_table, fit_table, provenance_tables, quality_tables, stretch_table
from algid.track.verdict import verdict


def page_html(result: TrackResult) -> str:
    """The page's text: one file that opens offline."""
    from plotly.offline import get_plotlyjs

    drawn = figures(result)
    name = file_name(result.log.path)
    seconds, rate = significant(result.log.duration, 4), significant(result.log.rate, 4)
    facts = f"arm of {file_name(result.arm)} · {seconds} s of log at {rate} Hz · {result.log.rows:,} samples"
    body = [
        f'<header><p class="kicker">algid · a payload in time</p><h1>{escaped(name)}</h1>',
        f'<p class="facts">{escaped(facts)}</p>\n{banner(verdict(result))}</header>',
        contents(drawn),
        '<main id="numbers">',
        table_html(stretch_table(result)),
        *map(figure_html, drawn),
        *(table_html(table) for table in [change_table(result)] if table.rows),
        *section("data", "Data quality", [fit_table(result), *quality_tables(result)], _warnings(result)),
        *section("settings", "Settings and provenance", provenance_tables(result)),
        "</main>",
        f"<footer>Made by algid {escaped(result.version)}.</footer>",
        '<noscript><p class="missing">The figures need JavaScript; all numbers stand without it.</p></noscript>',
    ]
    return document(name, "\n".join(body), script_json(drawing(drawn)), get_plotlyjs())


def _warnings(result: TrackResult) -> str:
    if not result.warnings:
        return '<p class="note">The readers gave no warning.</p>'
    return f"<ul>{''.join(f'<li>{escaped(warning)}</li>' for warning in result.warnings)}</ul>"


def markdown(result: TrackResult) -> str:
    """The track as GitHub's Markdown."""
    tables = [table for table in (stretch_table(result), change_table(result), fit_table(result)) if table.rows]
    details = [quality_tables(result)[0], provenance_tables(result)[1]]
    title = f"Payload in time of {file_name(result.log.path)}"
    return markdown_document(title, verdict(result), tables, "Log and provenance", details)
