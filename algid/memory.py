"""Memory that was used once is kept for the next block of a log, or the next log.

glibc hands freed arrays back to the system and takes them anew for the next ones, filled with zeros page by page:
a fifth of the processor time of short logs, an eighth of the time that `weak` takes for a day.
"""

from __future__ import annotations

import ctypes
from functools import cache

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # of glibc's malloc.h
KEPT = 64 << 20
"""Bytes at the end of the heap that stay with the process."""
OWN_PAGES = 32 << 20
"""Arrays from this size on have pages of their own, which go back; the largest that glibc takes."""


@cache
def keep_freed() -> None:
    """Have this process keep freed memory, where its C library is glibc."""
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError, TypeError):
        return
    mallopt(_MMAP_THRESHOLD, OWN_PAGES)
    mallopt(_TRIM_THRESHOLD, KEPT)
