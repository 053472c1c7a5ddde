"""Foreign text on a page: as the content of an element, and as data of a script."""

from __future__ import annotations

import html
import json

from algid.text import visible

LONGEST_ON_PAGE = 4_000


def escaped(text: str) -> str:
    """`text` as the content of a page's element or of a quoted attribute, every control character shown."""
    return html.escape(visible(text, LONGEST_ON_PAGE), quote=True)


def script_json(value: object) -> str:
    """`value` as JSON that cannot end the script element it stands in."""
    text = json.dumps(value, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")
