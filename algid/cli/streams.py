"""Standard output and error that no pipe's reader and no terminal's alphabet can break."""

from __future__ import annotations

import codecs
import io
import os
import sys
import unicodedata
from typing import Any

SPELLINGS = {
    "–": "-", "—": "-", "−": "-", "…": "...", "±": "+-", "•": "*", "·": "*", "×": "x", "∞": "inf", "°": " deg",
    "→": "->", "≤": "<=", "≥": ">=", "≈": "~", "Δ": "d", "α": "alpha", "θ": "theta", "σ": "sigma", "τ": "tau",
    "ω": "omega", "µ": "u", "μ": "u", "√": "sqrt", "²": "^2", "³": "^3", "─": "-", "‘": "'", "’": "'",
}  # fmt: skip


class _Pipe(io.FileIO):
    """A descriptor whose reader may leave, like ``head``: what is written after that goes nowhere."""

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data)
        except BrokenPipeError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.fileno())
            os.close(nowhere)
            return memoryview(data).nbytes


def harden_streams() -> None:
    """Let this process print whatever it has to: to a reader that leaves, and in letters that the terminal lacks."""
    codecs.register_error("spelled", _spelled)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        try:
            handle = stream.fileno()
        except (AttributeError, OSError, ValueError):  # none, or not of this process
            continue
        stream.flush()
        raw = io.BufferedWriter(_Pipe(handle, "wb", closefd=False))
        lines = name == "stderr" or stream.isatty()
        setattr(sys, name, io.TextIOWrapper(raw, stream.encoding, "spelled", line_buffering=lines))


def _spelled(error: UnicodeError) -> tuple[str, int]:
    """Letters that the terminal lacks in such that every terminal has."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    spelled = ""
    for letter in error.object[error.start : error.end]:
        near = SPELLINGS.get(letter) or unicodedata.normalize("NFKD", letter).encode("ascii", "ignore").decode()
        spelled += near or letter.encode("ascii", "backslashreplace").decode()
    return spelled, error.end
