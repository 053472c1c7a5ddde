"""Bounds on the threads of the linear algebra.

algid multiplies small blocks: a second thread of BLAS gains nothing there and spins while it waits, which on a
busy machine makes the same products several times slower. Whole logs are what runs side by side.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

_VARIABLES = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


def bound_by_environment() -> None:
    """One thread for any BLAS that is loaded from now on, unless the user's environment says otherwise."""
    for variable in _VARIABLES:
        os.environ.setdefault(variable, "1")


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """One thread for the BLAS libraries that are loaded, within the block."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1, user_api="blas"):
        yield
