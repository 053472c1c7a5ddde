"""`algid track`: the payload in time."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from algid.cli import profiles


def track(
    log: Annotated[Path, typer.Argument(help="A log of the arm while objects are picked and placed.")],
    parameters: Annotated[Path, typer.Option(help="Result of the arm, with error bars.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder to write into.")] = Path(),
    l1: Annotated[float | None, typer.Option("--l1", help="Length of link 1, m; the result's by default.")] = None,
    l2: Annotated[float | None, typer.Option("--l2", help="Length of link 2, m; the result's by default.")] = None,
    profile: profiles.ProfileFile = None,
) -> None:
    """Find when the payload changed and what each stretch weighs; write LOG.track.parquet and LOG.stretches.parquet.

    Example: algid track picking.mcap --parameters case1-unloaded.algid -o tracks
    """
    from algid.errors import LogError
    from algid.pipeline.sources import LogSource
    from algid.results import read_result
    from algid.track.files import write_track
    from algid.track.known import arm_of
    from algid.track.payload import track as run

    source = LogSource(log, "loaded", profiles.profile_from(profile))
    result = read_result(parameters)
    first = next(source.segments(), None)
    if first is None:
        raise LogError(f"{log}: it holds no samples; record longer")
    arm, covariance = arm_of(result, first, l1, l2)
    try:
        found = run(source.segments, arm, covariance)
    except ValueError as error:
        raise LogError(f"{log}: {error}; record longer") from error
    typer.echo("   from, s      to, s     m_p, kg    ± 95 %, kg")
    for stretch in found.stretches:
        half = stretch.ci95[1] - stretch.m_p
        typer.echo(f"{stretch.start:10.3f} {stretch.end:10.3f} {stretch.m_p:11.6f} {half:13.6f}")
    for path in write_track(found, log.stem, out):
        typer.echo(f"wrote {path}", err=True)
