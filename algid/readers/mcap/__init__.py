"""MCAP logs, read by columns: only the chunks that hold the joints, no Python object for a message."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from algid.errors import LogError
from algid.log import Origin
from algid.readers.assemble import TableReader, reader_of
from algid.readers.joints import moving_joints
from algid.readers.mcap.catalogue import Catalogue, catalogue
from algid.readers.mcap.framing import DamagedError, File
from algid.readers.mcap.topic import Fields, Topic
from algid.readers.table import BLOCK_ROWS, SampleTable
from algid.readers.timebase import aligned, whole_topic

if TYPE_CHECKING:
    from algid.profile import Profile


_LOOKED = 1 << 14
"""Messages whose other joints are looked at."""


def open_mcap(paths: Sequence[Path], profile: Profile | None = None) -> TableReader:
    """Open an MCAP log, or the splits of one in their order.

    Raises
    ------
    LogError
        If a message is encoded in an unknown way, or the file cannot be read or is damaged and holds no joints.
    NothingFoundError
        If no topic of a sound file holds the joints.
    """
    from algid.readers.mcap.plan import NothingFoundError, plan

    known: Known = {}
    with opened(paths[0], known) as (file, found):
        try:
            wanted = plan(file, found, profile)
        except NothingFoundError as error:
            if not found.damage:
                raise
            places = list(dict.fromkeys(found.damage))
            where = "; ".join(places[:3]) + (f"; {len(places) - 3} more" if len(places) > 3 else "")
            left = str(error).removeprefix(f"{paths[0]}: ")
            text = f"the MCAP file is damaged ({where}); copy it again; in what is left: {left}"
            raise LogError(f"{paths[0]}: {text}") from error
        truth = found.truth(paths[0])
        main = wanted.topics[0]
        rows = main.count(found)
        beside = moving_joints(
            wanted.others,
            lambda paths: Topic(main.name, main.type, Fields(paths, None), "log").tables(
                str(file.path), file, found, _LOOKED
            ),
        )
    name = str(paths[0] if len(paths) == 1 else paths[0].parent)
    origin = Origin(name, "mcap", wanted.mapping, truth, wanted.reading)

    def tables(rows: int) -> Iterator[SampleTable]:
        samples, others = _read(paths, main, rows, known), wanted.topics[1:]
        if not others:
            return samples
        series = [whole_topic(name, one.name, one.fields.paths, _read(paths, one, BLOCK_ROWS, known)) for one in others]
        return aligned(samples, series)

    return reader_of(origin, tables, profile, wanted.units, (*wanted.notices, *beside), rows)


def _read(paths: Sequence[Path], topic: Topic, rows: int, known: Known) -> Iterator[SampleTable]:
    for path in paths:
        with opened(path, known) as (file, found):
            yield from topic.tables(str(path), file, found, rows)


Known = dict[tuple[Path, int, int], Catalogue]
"""Catalogues by path, size and time of change: several passes go over a log, and one without a summary is walked."""


@contextmanager
def opened(path: Path, known: Known | None = None) -> Iterator[tuple[File, Catalogue]]:
    """The opened file and its catalogue, taken from the `known` ones, and put there, where these are given.

    Raises
    ------
    LogError
        If not even the start of the file is MCAP.
    """
    with File(path) as file:
        found = None if known is None else known.get((path, file.size, file.changed_ns))
        if found is None:
            try:
                found = catalogue(file)
            except DamagedError as error:
                raise LogError(f"{path}: the MCAP file cannot be read: {error}") from error
        if known is not None:
            known[path, file.size, file.changed_ns] = found
            found = found.copy()
        yield file, found
