from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from algid.report.series import read_series


def write(path: Path, **columns: object) -> Path:
    pl.DataFrame({"t": np.arange(4000) / 1000, **columns}).write_parquet(path)
    return path


def test_only_ill_conditioned_stretches_after_epsilon_are_singular(tmp_path: Path) -> None:
    condition = np.full(4000, 1e4)
    k1 = np.ones(4000)
    k1[:200] = k1[2000:2200] = np.nan  # before ε of each window
    condition[1000:1100] = np.inf
    k1[1000:1100] = np.nan
    k1[3000:3100] = np.nan  # absent for another reason
    read = read_series(
        write(tmp_path / "e.parquet", k1=k1, condition=condition), {"estimator": "refined"}
    )
    where, share = read.singular["k1"]
    assert where[share > 0] == pytest.approx(np.arange(100, 110) / 100)
    assert read.windows == [0.0, 2.0]


def test_k7_is_singular_where_its_own_equation_is(tmp_path: Path) -> None:
    own = np.full(4000, 2.0)
    own[500:600] = np.inf
    series = {name: np.where(np.isinf(own), np.nan, 1.0) for name in ("k1", "k7")}
    path = write(tmp_path / "e.parquet", **series, condition=np.full(4000, 10.0), k7_condition=own)
    read = read_series(path, {})
    assert not read.singular["k1"][1].any()
    assert read.singular["k7"][1].sum() == pytest.approx(10.0)


def test_the_window_is_the_paper_methods_own_setting(tmp_path: Path) -> None:
    path = write(tmp_path / "e.parquet", k1=np.ones(4000))
    assert read_series(path, {"estimator": "paper", "window": 1.0}).window == 1.0
    # 0.4 s is the weak form's
    assert read_series(path, {"estimator": "weak", "window": 0.4}).window == 2.0
    assert read_series(path, {"estimator": "paper", "window": None}).window == 2.0


def test_medians_ignore_what_is_not_there(tmp_path: Path) -> None:
    k1 = np.where(np.arange(4000) % 2 == 0, 3.0, np.nan)
    read = read_series(write(tmp_path / "e.parquet", k1=k1), {})
    values = read.middles["k1"][1]
    assert set(values[np.isfinite(values)]) == {3.0}
