"""A track as Parquet: m_p(t) in ``LOG.track.parquet``, its stretches in ``LOG.stretches.parquet``."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from algid.outfiles import whole_file
from algid.track.payload import QUANTILE, Track


def write_track(track: Track, stem: str, out: Path) -> list[Path]:
    """Write both tables into `out`. Raises `OutputError`."""
    import polars as pl

    curve = pl.DataFrame(
        {
            "t": track.t,
            "m_p": track.m_p,
            "low": track.m_p - QUANTILE * track.std,
            "high": track.m_p + QUANTILE * track.std,
            "stretch": track.stretch.astype(np.int64),
        }
    )
    rows = [(s.start, s.end, s.m_p, s.std, *s.ci95) for s in track.stretches]
    stretches = pl.DataFrame(rows, schema=["start", "end", "m_p", "m_p_std", "low", "high"], orient="row")
    written = []
    for name, frame in (("track", curve), ("stretches", stretches)):
        path = out / f"{stem}.{name}.parquet"
        with whole_file(path) as temporary:
            frame.write_parquet(temporary)
        written.append(path)
    return written
