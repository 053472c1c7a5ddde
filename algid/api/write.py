"""Files to start from: a profile for a log, and logs to try algid on."""

from __future__ import annotations

from pathlib import Path

from algid.files import refuse_existing, whole_file


def profile_for(log: Path, out: Path, force: bool = False) -> None:
    """Write a profile with everything that can be set, filled in with what a log tells.

    Raises
    ------
    LogError
        If there is no such log.
    OutputError
        If the profile is there already and `force` is not set, or cannot be written.
    """
    from algid.inspection.draft import draft_profile

    refuse_existing(out, force)
    text = draft_profile(log)
    with whole_file(out, force=force) as temporary:
        temporary.write_text(text, encoding="utf-8")


def example(out: Path, force: bool = False) -> list[Path]:
    """The files of `algid.example.write_example`."""
    from algid.example import write_example

    return write_example(out, force)
