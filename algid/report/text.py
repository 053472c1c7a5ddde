"""Foreign text on a page: as the content of an element, and as data of a script."""

from __future__ import annotations

import html
import json
import math

from algid.text import visible

LONGEST_ON_PAGE = 4_000


def escaped(text: str) -> str:
    """`text` for an element or a quoted attribute of a page, with visible control characters."""
    return html.escape(visible(text, LONGEST_ON_PAGE), quote=True)


def script_json(value: object) -> str:
    """`value` as JSON that cannot end the script element it stands in.

    A number that is none is null, as a gap in a line is.
    """
    try:
        text = json.dumps(value, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    except ValueError:
        text = json.dumps(_of_numbers(value), ensure_ascii=True, separators=(",", ":"))
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def _of_numbers(value: object) -> object:
    """`value` with None in place of what is no number."""
    if isinstance(value, dict):
        return {key: _of_numbers(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_of_numbers(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
