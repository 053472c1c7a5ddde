"""Calls of algid with hostile flags, TOML files and results: a source of `pipelines.fuzz`.

Each call ends with a result, or with one line and an exit code; it prints nothing that drives a
terminal, and writes nothing outside of the folder it was given, nor anything half-written within.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import NoReturn

from algid.base.errors import Exit
from algid.base.text import printable
from pipelines.hostile import FINE
from pipelines.hostile.calls import Call, draw_call
from pipelines.hostile.places import called, furnish

CODES = (0, 1, 2, 3, 4)


def calls(folder: Path, seeds: range) -> Iterator[Callable[[], tuple[str, str]]]:
    """Calls in a folder that has sound logs and results, made once."""
    sound = folder / "sound"
    if not sound.exists():
        sound.mkdir()
        furnish(sound)
    os.environ["ALGID_TRACEBACK"] = "1"  # a finding is told with its place
    with tempfile.TemporaryDirectory(dir=folder) as outer:
        place = Path(outer, "a", "b", "place")
        shutil.copytree(sound, place)
        os.chdir(place)
        for seed in seeds:
            shutil.rmtree("out", ignore_errors=True)
            yield partial(outcome, draw_call(seed, place), Path(outer))


def outcome(call: Call, outer: Path) -> tuple[str, str]:
    """What comes of a call, and more of it."""
    before, own = _listing(outer), {path.name for path in Path().iterdir()}
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        code, out, err = called(*call)
    kind, why = judged(call, code, out, err)
    new = {path.name for path in Path().iterdir()} - own - {"out"}
    outside = _listing(outer) ^ before
    if ".." in call:  # where the call itself asks to write
        outside = {path for path in outside if Path(path).name.startswith(".")}
    if kind in FINE and (outside or any(name.startswith(".") for name in new)):
        kind, why = "left", f"{sorted(new)} {sorted(outside)}"
    for name in new:
        shutil.rmtree(name, ignore_errors=True) if Path(name).is_dir() else Path(name).unlink()
    return kind, f"{' '.join(call)[:500]!r} | {why}"


def _listing(outer: Path) -> set[str]:
    """What stands in the folders above the call's own."""
    return {
        str(path) for folder in (outer, outer / "a", outer / "a" / "b") for path in folder.iterdir()
    }


def judged(call: Call, code: int, out: str, err: str) -> tuple[str, str]:
    """The kind of an end, and why it is no good."""
    last = err.strip().splitlines()[-3:]
    if code == 142:
        return "hang", ""
    if code == Exit.INTERNAL:
        return "internal", _trace(err)
    if "not enough memory" in err:
        return "memory", _trace(err)
    if "Warning: " in err:
        return "warning", err[-600:]
    if (
        "Traceback" in err
        and "AlgidError" not in err
        and not any(line.startswith("algid: ") for line in last)
    ):
        return "traceback", _trace(err)
    if code not in CODES:
        return "code", f"{code}: {err[-300:]}"
    if printable(out) != out or printable(err) != err:
        return "escape", repr((out + err)[-600:])
    told = bool(last) and last[-1].startswith("algid: ")
    # which prints why, among the rest
    if code == 2 and not told and "inspect" not in call:
        return "lines", err[-600:]
    if code == 2 and "a library cannot take it" in err:
        return "library", ""
    if "json" in call and code != 2:
        try:
            json.loads(out, parse_constant=_no_number)
        except ValueError as error:
            return "json", f"{error}: {out[-300:]}"
    return ("refused" if code == 2 else "done"), ""


def _trace(err: str) -> str:
    """The places in algid of a traceback, the last ones first, and its last line."""
    lines = [line.strip() for line in err.splitlines()]
    places = [
        line.rpartition("/algid/")[2]
        for line in lines
        if line.startswith("File ") and "/algid/" in line
    ]
    return f"{' < '.join(places[:-6:-1])}: {lines[-2:]}"


def _no_number(word: str) -> NoReturn:
    raise ValueError(f"{word} is no JSON")
