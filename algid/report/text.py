"""Names out of logs are foreign text: what may not reach a terminal or a page as it is."""

from __future__ import annotations

import unicodedata

LONGEST = 300
# Controls drive a terminal, format characters reorder what is read, separators break lines.
_HIDDEN = {"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"}


def visible(text: str, longest: int = LONGEST) -> str:
    """`text` with every character that cannot be seen written as an escape, and cut to a sane length."""
    shown = "".join(_escape(character) if _is_hidden(character) else character for character in text[:longest])
    return shown if len(text) <= longest else shown + "…"


def _is_hidden(character: str) -> bool:
    return unicodedata.category(character) in _HIDDEN


def _escape(character: str) -> str:
    code = ord(character)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def file_name(path: str) -> str:
    """Last part of a path of any system, made visible."""
    return visible(path.replace("\\", "/").rstrip("/").rpartition("/")[2] or path)


def joined(words: list[str]) -> str:
    """The words as a list in a sentence: a, b and c."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}" if words else ""


def unit_text(unit: str) -> str:
    """A unit with its power as it is printed: kg m²."""
    return visible(unit).replace("^2", "²")
