"""A document as a page: one offline file with the plotting library and its own scripts.

Nothing but this package's own scripts runs: the page's Content-Security-Policy names them by their
hashes, or by a nonce for the library beside the page, so that a name out of a log could not run
even if it slipped past the escaping.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

from algid.report.arm import ArmDrawing
from algid.report.document import Document
from algid.report.figures.base import Figure
from algid.report.html import banner, contents, panel_id, section_html
from algid.report.text import escaped, script_json

LIBRARY = "plotly.min.js"
BUNDLE = "plotly.min.js.gz"
NOSCRIPT = (
    '<noscript><p class="missing">The figures need JavaScript; all numbers stand without '
    "it.</p></noscript>"
)

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
        "font": {
            "family": "system-ui, -apple-system, Segoe UI, Roboto, sans-serif",
            "size": 12,
            "color": "@ink",
        },
        "paper_bgcolor": "@page",
        "plot_bgcolor": "@page",
        "margin": {"l": 58, "r": 12, "t": 22, "b": 40},
        "showlegend": False,
        "hoverlabel": {
            "bgcolor": "@card",
            "bordercolor": "@line",
            "font": {"color": "@ink", "size": 12},
        },
        "modebar": {"bgcolor": "@page/0", "color": "@muted", "activecolor": "@ink"},
        "xaxis": _AXIS,
        "yaxis": _AXIS,
        "coloraxis": {},
    },
    "data": {"heatmap": [{"colorbar": {"tickfont": {"color": "@muted"}}}]},
}
"""How every panel looks: plotly's template, in the page's colours."""


def page(document: Document, shared_library: bool = False) -> str:
    """The text of `document`'s page.

    It carries the plotting library, packed; with `shared_library` it asks for the one beside the
    folder.
    """
    body = "\n".join(
        [
            (
                '<header><p class="kicker">algid · '
                f"{escaped(document.kicker)}</p><h1>{escaped(document.name)}</h1>"
            ),
            f'<p class="facts">{escaped(document.facts)}</p>\n{banner(document.verdict)}</header>',
            contents(document),
            '<main id="numbers">',
            *filter(None, map(section_html, document.sections)),
            "</main>",
            f"<footer>{escaped(document.made)}</footer>",
            NOSCRIPT,
        ]
    )
    figures = gzip.compress(script_json(drawing(document)).encode(), mtime=0)
    data, style = packed_text(figures), _asset("report.css")
    moves = any(isinstance(one, ArmDrawing) for one in document.content())
    running = [_asset(name) for name in ("report.js", *(["arm.js"] if moves else []))]
    if shared_library:
        nonce = hashlib.sha256(
            (body + data).encode()
        ).hexdigest()  # nobody who writes the body can predict it
        source, tag = f"'nonce-{nonce}'", f'<script nonce="{nonce}" src="../{LIBRARY}"></script>'
    else:
        own = library()
        source, tag = (
            _hash(own.script),
            f'<script type="text/plain" id="library">{own.packed}</script>',
        )
    elements = "\n".join(f"<script>{script}</script>" for script in running)
    policy = (
        f"default-src 'none'; script-src {' '.join([source, *map(_hash, running)])}; style-src "
        "'unsafe-inline'; "
        "img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n<link rel="icon" href="data:,">\n'
        f"<title>{escaped(document.tab or document.name)} · "
        f"algid</title>\n<style>{style}</style>\n</head>\n<body>\n"
        f'<a class="skip" href="#numbers">Skip to the numbers</a>\n{body}\n'
        f'<script type="text/plain" id="figures">{data}</script>\n{tag}\n{elements}\n'
        "</body>\n</html>\n"
    )


def drawing(document: Document) -> dict[str, object]:
    """What the page's script draws; an array that several lines share stands in `arrays` once."""
    arrays: dict[str, int] = {}
    panels = [
        {
            "id": panel_id(figure, place),
            "figure": figure.key,
            "columns": "two" if figure.columns == 2 else "one",
            "sync": panel.sync,
            "height": panel.height,
            "traces": _shared(panel.traces, arrays),
            "layout": panel.layout,
        }
        for figure in document.content()
        if isinstance(figure, Figure)
        for place, panel in enumerate(figure.panels)
    ]
    return {"template": TEMPLATE, "panels": panels, "arrays": list(arrays)}


def _shared(value: Any, arrays: dict[str, int]) -> Any:
    """`value` with the place in `arrays` of each typed array's content instead of it."""
    if isinstance(value, list):
        return [_shared(inner, arrays) for inner in value]
    if not isinstance(value, dict):
        return value
    if "bdata" in value:
        return {**value, "bdata": arrays.setdefault(value["bdata"], len(arrays))}
    return {name: _shared(inner, arrays) for name, inner in value.items()}


def _asset(name: str) -> str:
    return (resources.files("algid.report") / "assets" / name).read_text(encoding="utf-8")


def _hash(script: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"


@dataclass(frozen=True)
class Library:
    """The plotting library: a script, and the same in gzip and base64."""

    script: str
    packed: str


@cache
def library() -> Library:
    """The library that this installation has, which a page carries packed and unpacks itself.

    A build with npm at hand leaves plotly's bundle for figures with two axes among the assets;
    without it the whole library comes out of the package `plotly`.
    """
    asset = resources.files("algid.report") / "assets" / BUNDLE
    if asset.is_file():
        content = asset.read_bytes()
    else:
        from plotly.offline import get_plotlyjs

        content = gzip.compress(get_plotlyjs().encode(), mtime=0)
    return Library(gzip.decompress(content).decode(), packed_text(content))


def packed_text(content: bytes) -> str:
    """What gzip made, as the page's script unpacks it."""
    return base64.b64encode(content).decode()
