"""The report of a track: what it contains, and its folder's files.

``track.json``, ``track.parquet``, ``stretches.parquet``, the pages `report.html` and `report.md`,
and ``track.mcap``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from algid.base.files import whole_file
from algid.base.significance import NORMAL
from algid.base.text import file_name, significant
from algid.base.words import counted
from algid.report.document import Document, Section
from algid.report.export import START_KEY, write_series
from algid.report.render import markdown, page, write_texts
from algid.report.tables import settings_table
from algid.tracks.figures import payload_figure
from algid.tracks.result import TrackResult, track_json
from algid.tracks.tables import (
    change_table,
    quality_tables,
    stretch_table,
    track_provenance,
    verdict,
)


def track_document(result: TrackResult) -> Document:
    """The report of a track."""
    name = file_name(result.log.path)
    seconds, rate = significant(result.log.duration, 4), significant(result.log.rate, 4)
    sentences = tuple(one.sentence for one in result.notices)
    origin = (settings_table(result.settings), track_provenance(result))
    sections = (
        Section("numbers", "Numbers", (stretch_table(result), change_table(result))),
        Section("payload", "Payload in time", (payload_figure(result),)),
        Section("data", "Data quality", (sentences, *quality_tables(result)), folded=True),
        Section("settings", "Settings and provenance", origin, folded=True),
    )
    return Document(
        title=f"Payload in time of {name}",
        verdict=verdict(result),
        sections=sections,
        kicker="a payload in time",
        name=name,
        facts=f"arm of {file_name(result.arm)} · {seconds} s of log at {rate} Hz · "
        f"{counted(result.log.rows, 'sample')}",
        made=f"Made by algid {result.version}.",
    )


TOPIC = "/algid/payload"


def track_folder(log: str, parent: Path) -> Path:
    """Where the track of a log goes: `parent/STEM.track`."""
    return parent / f"{Path(log).stem or 'log'}.track"


def write_track(result: TrackResult, folder: Path, mcap: bool = False) -> None:
    """Write everything into `folder`, `track.mcap` where asked. Raises `OutputError`."""
    _write_curve(result, folder / "track.parquet")
    _write_stretches(result, folder / "stretches.parquet")
    write_texts(folder, {"track.json": track_json(result)})
    write_pages(result, folder, mcap)


def write_pages(result: TrackResult, folder: Path, mcap: bool = False) -> list[Path]:
    """Write the pages of a track into its `folder`, `track.mcap` where asked.

    Raises `OutputError`.
    """
    document = track_document(result)
    pages = {"report.html": page(document), "report.md": markdown(document)}
    written = write_texts(folder, pages)
    if mcap:
        _write_mcap(result, folder)
        written.append(folder / "track.mcap")
    return written


def _write_curve(result: TrackResult, path: Path) -> None:
    """A row each 20 ms: m_p(t) and its band, and the stretch's number, mass and interval."""
    import polars as pl
    import pyarrow.parquet as pq

    track = result.track
    number = track.stretch.astype(np.int64)
    mass = np.array([one.m_p for one in track.stretches])
    interval = np.array([one.ci95 for one in track.stretches])
    curve = pl.DataFrame(
        {
            "t": track.t,
            "m_p": track.m_p,
            "low": track.m_p - NORMAL * track.std,
            "high": track.m_p + NORMAL * track.std,
            "left": track.left,
            "stretch": number,
            "stretch_m_p": mass[number],
            "stretch_low": interval[number, 0],
            "stretch_high": interval[number, 1],
        }
    )
    with whole_file(path) as temporary:
        table = curve.to_arrow()
        pq.write_table(
            table.replace_schema_metadata({START_KEY: f"[{result.log.start_ns}]"}), temporary
        )


def _write_stretches(result: TrackResult, path: Path) -> None:
    import polars as pl

    rows = []
    for one, status in zip(result.track.stretches, result.statuses, strict=True):
        low, high = one.ci95
        rows.append((one.start, one.end, one.m_p, one.std, low, high, status.value))
    frame = pl.DataFrame(
        rows, schema=["start", "end", "m_p", "m_p_std", "low", "high", "status"], orient="row"
    )
    with whole_file(path) as temporary:
        frame.write_parquet(temporary)


def _write_mcap(result: TrackResult, folder: Path) -> None:
    """The curve as a ROS 2 log with the log's own stamps, for Foxglove and PlotJuggler."""
    from mcap.writer import CompressionType, Writer

    with whole_file(folder / "track.mcap") as temporary, temporary.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library=f"algid {result.version}")
        write_series(writer, folder / "track.parquet", TOPIC)
        writer.finish()  # type: ignore[no-untyped-call]
