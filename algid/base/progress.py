"""How far long work has come, as it tells whoever shows it."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, int, int], None]
"""Called with the name of the work, the amount done, and the whole amount, 0 if unknown."""
