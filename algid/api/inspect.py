"""Look at a log before anyone identifies anything."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from algid.api import Answer
from algid.api.options import AnyLog, LogOptions, ProfileLike, meant, options_of, verb
from algid.base.errors import Exit, SettingError, exit_of
from algid.base.files import refuse_existing, whole_file
from algid.base.text import as_toml, lines_of, visible
from algid.options import flag

if TYPE_CHECKING:
    from algid.inspection.checks import Inspection
    from algid.report.document import Table

PROFILE = "algid.toml"


@verb
def inspect(
    log: AnyLog,
    *,
    profile: ProfileLike | None = None,
    write_profile: str | Path | None = None,
    force: bool = False,
    **options: Unpack[LogOptions],
) -> Inspection:
    """Show what a log holds, which channels would be used, and what is wrong with it.

    Parameters
    ----------
    log : path, `Log`, pandas or polars frame, or dict of arrays
        A file of any format, or a rosbag2 folder.
    profile : Profile, path of one, or dict of what would stand in its file
        algid.toml: what names and units mean.
    write_profile : path
        Write a profile to edit, of all that can be set. A folder's is called algid.toml. It is
        filled in with what the log's file tells.
    force : bool
        Replace what is there.
    **options : settings of `Profile` by their names
        As ``zero="hanging"``.

    Returns
    -------
    Inspection
        Its `mapping`, figures of its clock and signals, `findings` and `notices`; of a log that
        would be refused what it holds, and why (`refused`).

    Raises
    ------
    LogError
        If there is no such log, or its format is unknown.
    SettingError
        If a setting is not known or wrong.
    OutputError
        If the profile is there already and `force` is not set, or cannot be written.

    Examples
    --------
    $ algid inspect arm.mcap --joints shoulder,elbow --zero hanging

    >>> import algid
    >>> log, _ = algid.synthesise("case1", duration=2.0, torque="wide")
    >>> found = algid.inspect(log)
    >>> found.refused is None, found.clock.rows
    (True, 2001)
    """
    from algid.inspection.checks import inspect_log

    own, log = meant(profile, options, log)
    if write_profile is not None and not isinstance(log, str | Path):
        raise SettingError(f"{flag('write_profile')}: expected the path of a log, found arrays")
    file = None if write_profile is None else profile_file(write_profile)
    if file is not None:
        refuse_existing(file, force)
    found = inspect_log(log, own)
    if file is not None:
        with whole_file(file, force=force) as temporary:
            temporary.write_text(draft_profile(found), encoding="utf-8")
    return found


def draft_profile(found: Inspection) -> str:
    """The text of a profile to edit: every key there is, filled in as far as a log states it.

    For a log that cannot be read yet, its names stand in comments.
    """
    from algid.exports import template
    from algid.profile import Profile
    from algid.readers.table import CHANNELS

    reading, mapping, options = found.reading, found.mapping or {}, options_of(Profile)
    main, *_ = *reading.topics, ""
    time = mapping.get("t", "")
    if time not in [one.name for one in found.entries]:  # of messages it is none of them
        time = ""
    channels = {}
    for name in CHANNELS:
        source = mapping.get(name, "")
        topic = next((one for one in reading.topics if source.startswith(f"{one}: ")), "")
        channels[name] = "" if topic == main else topic, source.removeprefix(f"{topic}: ")
    known = {"topic": main, "joints": reading.joints, "time": time, "time_unit": reading.time_unit}
    text = template(Path(__file__).parents[1] / "inspection/algid.toml.j2").render(
        found=found,
        known=known,
        channels=channels,
        units={name: options[f"{name}.unit"].words for name in CHANNELS},
        toml=as_toml,
        visible=visible,
    )
    return str(text).lstrip()


def profile_file(place: str | Path) -> Path:
    """The profile that is written: `place`, or algid.toml in that folder."""
    path = Path(place)
    return path / PROFILE if path.is_dir() else path


def answer(found: Inspection, given: Mapping[str, Any]) -> Answer:
    """The tables; of a log that would be refused 2, of a wrong convention 3, of lost data 4."""
    from algid.report.terminal import inspection_content

    def shown() -> Iterator[Table | str]:
        width = shutil.get_terminal_size().columns
        for part in inspection_content(found):
            yield from lines_of(part, width, rest="    ") if isinstance(part, str) else [part]

    ended = exit_of(failed=found.contradicted, lost=found.lossy)
    if found.refused:
        ended = Exit.USAGE
    remarks = []
    if "write_profile" in given:  # a log that needs a profile is what one is written for
        file = profile_file(given["write_profile"])
        ended, remarks = Exit.OK, [f"wrote {file}; edit it, then give it by {flag('profile')}"]
    return Answer(shown(), lambda: json.dumps(found.as_dict(), indent=2), remarks, exit=ended)
