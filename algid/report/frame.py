"""The frame of every page: head, contents, body, footer, and the scripts that its policy names by their hashes.

Nothing but this package's own scripts runs: the page's Content-Security-Policy names them by their hashes, or by a
nonce for the library beside the page, so that a name out of a log could not run even if it slipped past the escaping.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from importlib import resources

from algid.report.figures.base import Figure, Missing
from algid.report.html import TEMPLATE, escaped, figure_html, panel_id, script_json, table_html
from algid.report.library import library
from algid.report.table import Table
from algid.report.verdict import LEVEL_WORDS, Verdict

LIBRARY = "plotly.min.js"
SIGNS = {"good": "✓", "reservations": "!", "failed": "✕"}
NOSCRIPT = '<noscript><p class="missing">The figures need JavaScript; all numbers stand without it.</p></noscript>'

Shown = Figure | Missing
Links = Sequence[tuple[str, str]]
"""Keys of a page's parts, and what to call them."""


def framed(
    kicker: str,
    title: str,
    facts: str,
    judged: Verdict,
    links: Links,
    body: Sequence[str],
    figures: Sequence[Shown],
    footer: str,
    *,
    tab: str = "",
    shared_library: bool = False,
    scripts: Sequence[str] = (),
) -> str:
    """A whole page.

    Parameters
    ----------
    kicker, title, facts : what kind of page, of what, and the numbers that identify it
    judged : the verdict at its head
    links : its contents
    body : HTML of its parts, `figures` among them
    figures : what its script draws
    footer : what made it
    tab : the browser's title where `title` is not enough
    shared_library : whether the plotting library stands beside the folder
    scripts : what runs after the page's own
    """
    parts = [
        f'<header><p class="kicker">algid · {escaped(kicker)}</p><h1>{escaped(title)}</h1>',
        f'<p class="facts">{escaped(facts)}</p>\n{banner(judged)}</header>',
        contents(links),
        '<main id="numbers">',
        *body,
        "</main>",
        f"<footer>{escaped(footer)}</footer>",
        NOSCRIPT,
    ]
    return document(tab or title, "\n".join(parts), script_json(drawing(figures)), shared_library, scripts)


def document(title: str, body: str, data: str, shared_library: bool = False, scripts: Sequence[str] = ()) -> str:
    """A whole page out of its body and its figures' data.

    It carries the plotting library, packed; with `shared_library` it asks for the one beside the folder. `scripts` run
    after the page's own.
    """
    running, style = [_asset("report.js"), *scripts], _asset("report.css")
    if shared_library:
        nonce = hashlib.sha256((body + data).encode()).hexdigest()  # nobody who writes the body can foretell it
        source, tag = f"'nonce-{nonce}'", f'<script nonce="{nonce}" src="../{LIBRARY}"></script>'
    else:
        own = library()
        source, tag = _hash(own.script), f'<script type="text/plain" id="library">{own.packed}</script>'
    elements = "\n".join(f"<script>{script}</script>" for script in running)
    policy = (
        f"default-src 'none'; script-src {' '.join([source, *map(_hash, running)])}; style-src 'unsafe-inline'; "
        "img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n<link rel="icon" href="data:,">\n'
        f"<title>{escaped(title)} · algid</title>\n<style>{style}</style>\n</head>\n<body>\n"
        f'<a class="skip" href="#numbers">Skip to the numbers</a>\n{body}\n'
        f'<script type="application/json" id="figures">{data}</script>\n{tag}\n{elements}\n'
        "</body>\n</html>\n"
    )


def _asset(name: str) -> str:
    return (resources.files("algid.report") / "assets" / name).read_text(encoding="utf-8")


def _hash(script: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"


def drawing(figures: Sequence[Shown]) -> dict[str, object]:
    """What the page's script draws."""
    panels = [
        {
            "id": panel_id(figure, place),
            "figure": figure.key,
            "columns": "two" if figure.columns == 2 else "one",
            "sync": panel.sync,
            "height": panel.height,
            "traces": panel.traces,
            "layout": panel.layout,
        }
        for figure in figures
        if isinstance(figure, Figure)
        for place, panel in enumerate(figure.panels)
    ]
    return {"template": TEMPLATE, "panels": panels}


def banner(judged: Verdict) -> str:
    """The verdict's sentence and the reasons that it does not tell itself, in its colour."""
    word = LEVEL_WORDS[judged.level]
    named = judged.sentence.startswith(word)
    sentence = judged.sentence.removeprefix(word) if named else judged.sentence
    reasons = "".join(f"<li>{escaped(reason)}</li>" for reason in judged.untold)
    return (
        f'<div class="verdict {judged.level}"><span class="sign" aria-hidden="true">{SIGNS[judged.level]}</span>'
        f"<div><p>{f'<strong>{word}</strong>' if named else ''}{escaped(sentence)}</p>"
        f"{_first(judged)}{reasons and f'<ul>{reasons}</ul>'}</div></div>"
    )


def _first(judged: Verdict) -> str:
    """The likely cause and the command to run first."""
    cause = f'<p class="cause">Likely cause: {escaped(judged.cause)}</p>' if judged.cause else ""
    return cause + (f'<p class="cause">Run first: <code>{escaped(judged.command)}</code></p>' if judged.command else "")


def links_of(figures: Sequence[Shown]) -> Links:
    """Links to figures."""
    return [(figure.key, figure.title) for figure in figures]


def contents(links: Links) -> str:
    """The page's contents; the numbers come first."""
    listed = "".join(
        f'<li><a href="#{key}">{escaped(title)}</a></li>' for key, title in [("numbers", "Numbers"), *links]
    )
    return f'<nav aria-label="Contents"><details open><summary>Contents</summary><ul>{listed}</ul></details></nav>'


def section(key: str, title: str, tables: Sequence[Table], extra: str = "") -> list[str]:
    """A titled part of the page; nothing where it would be empty."""
    if not tables and not extra:
        return []
    return [
        f'<section aria-labelledby="{key}"><h2 id="{key}">{escaped(title)}</h2>',
        extra,
        *map(table_html, tables),
        "</section>",
    ]


def bullets(sentences: Sequence[str], otherwise: str) -> str:
    """Sentences as a list, or one that says that there is none."""
    if not sentences:
        return f'<p class="note">{escaped(otherwise)}</p>'
    return f"<ul>{''.join(f'<li>{escaped(sentence)}</li>' for sentence in sentences)}</ul>"


def figures_html(figures: Sequence[Shown]) -> list[str]:
    """Where each figure stands."""
    return list(map(figure_html, figures))
