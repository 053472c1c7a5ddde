"""A document as a page and as Markdown, by the templates.

A page is one offline file that carries the plotting library, packed. Only scripts with its nonce
run, which follows from the whole content: a name out of a log could not run even if it slipped
past the escaping, and the same document gives the same bytes. Jinja2 is imported where a page is
made.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import re
import secrets
from collections.abc import Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic_core import to_json

from algid import __version__
from algid.base.files import whole_file
from algid.base.text import visible
from algid.notices import MOST_REASONS
from algid.report.document import Document

if TYPE_CHECKING:
    from jinja2 import Environment

LIBRARY = "plotly.min.js"
BUNDLE = "plotly.min.js.gz"
HERE = resources.files("algid.report")
SPECIAL = re.compile(r"([\\`*_{}\[\]<>#|~@&])")


def page(document: Document, shared_library: bool = False) -> str:
    """The text of `document`'s page.

    It carries the plotting library; with `shared_library` it asks for the one beside the folder.
    """
    drawn: dict[str, Any] = {}
    for plot in document.plots:
        drawn[plot.key] = {"data": plot.data, "layout": plot.layout}
    if document.arm is not None:
        drawn["arm"] = document.arm.frames
    place = secrets.token_hex(32)  # nobody who writes the content can predict it
    text = (
        _environment(_shown)
        .get_template("page.html")
        .render(
            document=document,
            most=MOST_REASONS,
            drawn=packed_text(gzip.compress(to_json(drawn, inf_nan_mode="null"), mtime=0)),
            library="" if shared_library else packed_text(library()),
            beside=LIBRARY,
            version=__version__,
            nonce=place,
        )
    )
    text = text.lstrip()  # the macros leave their line feeds
    return text.replace(place, hashlib.sha256(text.replace(place, "").encode()).hexdigest())


def markdown(document: Document) -> str:
    """`document` as GitHub's Markdown: title, verdict, tables, and what is folded."""
    from markupsafe import Markup

    # indented, it is code whatever it holds
    command = document.verdict.command or ""
    code = Markup("    " + visible(command, len(command)))
    return _environment(_escaped).get_template("report.md").render(document=document, code=code)


@cache
def _environment(finalize: Any) -> Environment:
    """Templates in which every text passes through `finalize`, and then the escaping of HTML."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(
        loader=FileSystemLoader(str(HERE / "templates")),
        autoescape=True,
        finalize=finalize,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        optimized=False,  # a template is rendered once: to optimise it takes longer
    )


def _shown(value: object) -> object:
    """Text with its control characters visible."""
    if type(value) is not str or (value.isascii() and value.isprintable()):
        return value
    return visible(value, len(value))


def _escaped(value: object) -> object:
    """Text so that Markdown shows it as it is: no markup, no HTML, no mention of anybody."""
    from markupsafe import Markup

    if type(value) is not str:
        return value
    return Markup(SPECIAL.sub(r"\\\1", visible(value, len(value))))


def packed_text(content: bytes) -> str:
    """What gzip made, as the page's script unpacks it."""
    return base64.b64encode(content).decode()


@cache
def library() -> bytes:
    """The plotting library that this installation has, in gzip.

    A build with npm at hand leaves plotly's bundle for figures with two axes among the assets;
    without it the whole library comes out of the package `plotly`.
    """
    asset = HERE / "assets" / BUNDLE
    if asset.is_file():
        return asset.read_bytes()
    from plotly.offline import get_plotlyjs

    return gzip.compress(get_plotlyjs().encode(), mtime=0)


def write_library(folder: Path) -> None:
    """Write the library as a script beside the folders of many results, if it is not there."""
    script, path = gzip.decompress(library()), folder / LIBRARY
    if not path.is_file() or path.stat().st_size != len(script):
        write_texts(folder, {LIBRARY: script.decode()})


def write_texts(folder: Path, texts: Mapping[str, str]) -> list[Path]:
    """Write each text into the file of its name, whole or not at all. Raises `OutputError`."""
    for name, text in texts.items():
        with whole_file(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return [folder / name for name in texts]
