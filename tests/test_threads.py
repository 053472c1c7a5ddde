"""BLAS keeps to one thread while algid identifies."""

from __future__ import annotations

from algid.base.runtime import one_blas_thread


def test_blas_is_bounded_within_the_block() -> None:
    import numpy as np
    from threadpoolctl import threadpool_info

    np.ones((4, 4)) @ np.ones((4, 4))
    with one_blas_thread():
        assert {
            pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"
        } <= {1}
