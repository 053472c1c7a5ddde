"""Files and folders under construction: what a killed run leaves goes, what another run makes
stays.
"""

from __future__ import annotations

import ctypes
import errno
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from algid import construction
from algid.construction import remove_left
from algid.errors import OutputError
from algid.files import temporary_folder, whole_file, whole_folder

KILLED = """
import os, signal, sys
from pathlib import Path
from algid.files import temporary_folder, whole_file, whole_folder
makes = {"file": whole_file, "folder": lambda path: whole_folder(path, force=True)}
with makes[sys.argv[1]](Path(sys.argv[2])) as temporary, temporary_folder():
    if temporary.is_dir() and len(sys.argv) > 3:
        (temporary / "half").write_text("written")
    os.kill(os.getpid(), signal.SIGKILL)
"""
ROOT = str(Path(construction.__file__).parents[1])


def _without_exchange(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(construction, "_renameat2", lambda: None)


def _kill_while_making(*arguments: str | Path) -> None:
    environment = {**os.environ, "PYTHONPATH": ROOT, "TMPDIR": str(Path(arguments[1]).parent)}
    command = [sys.executable, "-c", KILLED, *map(str, arguments)]
    assert subprocess.run(command, env=environment, check=False).returncode == -signal.SIGKILL


@pytest.mark.parametrize("kind", [("file",), ("folder",), ("folder", "half")])
def test_the_next_run_removes_at_once_what_a_killed_one_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: tuple[str, ...]
) -> None:
    path = tmp_path / "a[1].algid"
    _kill_while_making(kind[0], path, *kind[1:])
    assert len(list(tmp_path.iterdir())) == 2
    with whole_file(tmp_path / "a.algid"):  # of another name
        pass
    assert len(list(tmp_path.iterdir())) == 3
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with temporary_folder(), whole_folder(path, force=False):
        assert len(list(tmp_path.iterdir())) == 3
    assert sorted(found.name for found in tmp_path.iterdir()) == ["a.algid", "a[1].algid"]


def test_what_another_run_makes_stays(tmp_path: Path) -> None:
    with whole_folder(tmp_path / "a", force=False) as first, whole_file(tmp_path / "b") as second:
        remove_left(tmp_path)
        assert first.is_dir()
        assert second.is_file()
    assert {path.name for path in tmp_path.iterdir()} == {"a", "b"}


def test_a_sweep_that_is_quicker_than_the_hold_takes_nothing_from_the_maker(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hold, swept = construction.held, list[Path]()

    def late(place: Path) -> int:
        if not swept:
            swept.append(place)
            remove_left(tmp_path)
        return hold(place)

    monkeypatch.setattr(construction, "held", late)
    with whole_folder(tmp_path / "a", force=False) as made:
        assert swept
        assert made != swept[0]
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_folders_of_a_users_own_names_are_not_swept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    names = [
        "algid-results",
        "algid-1234abcd",
        ".a.algid.notes",
        ".a.algid-backup",
        ".a.algid-0123abcde",
    ]
    for name in names:
        (tmp_path / name).mkdir()
        os.utime(tmp_path / name, (0, 0))
    with temporary_folder(), whole_folder(tmp_path / "a", force=False):
        remove_left(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*names, "a"])


@pytest.mark.parametrize("prepare", [lambda _patch: None, _without_exchange])
def test_of_two_writers_the_second_is_refused_and_with_force_the_last_one_stands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, prepare: Callable[[pytest.MonkeyPatch], None]
) -> None:
    prepare(monkeypatch)
    path = tmp_path / "a"
    with ExitStack() as stack:
        late = stack.enter_context(whole_folder(path, force=False))
        (late / "mine").touch()
        with whole_folder(path, force=False) as early:
            (early / "theirs").touch()
        with pytest.raises(OutputError, match=r"/a: exists already; choose another folder"):
            stack.close()
    assert [found.name for found in path.iterdir()] == ["theirs"]
    with whole_folder(path, force=True) as late:
        (late / "mine").touch()
        with whole_folder(path, force=True) as early:
            (early / "again").touch()
        assert [found.name for found in path.iterdir()] == ["again"]
    assert [found.name for found in path.iterdir()] == ["mine"]
    assert [found.name for found in tmp_path.iterdir()] == ["a"]


@pytest.mark.parametrize("kind", ["file", "link", "dangling link", "empty folder"])
@pytest.mark.parametrize("prepare", [lambda _patch: None, _without_exchange])
def test_whatever_stands_there_is_replaced_by_force_alone_and_links_are_not_followed(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    prepare: Callable[[pytest.MonkeyPatch], None],
    kind: str,
) -> None:
    prepare(monkeypatch)
    path, other = tmp_path / "a", tmp_path / "other"
    other.mkdir()
    (other / "kept").touch()
    if kind == "file":
        path.touch()
    elif kind == "empty folder":
        path.mkdir()
    else:
        path.symlink_to(other if kind == "link" else tmp_path / "absent")
    with pytest.raises(OutputError, match="exists already"), whole_folder(path, force=False):
        pass
    with whole_folder(path, force=True) as made:
        (made / "new").touch()
    assert not path.is_symlink()
    assert [found.name for found in path.iterdir()] == ["new"]
    assert (other / "kept").exists()
    assert {found.name for found in tmp_path.iterdir()} == {"a", "other"}


def test_a_result_that_is_replaced_is_never_absent(tmp_path: Path) -> None:
    path, absent, ended = tmp_path / "a", list[bool](), threading.Event()
    with whole_folder(path, force=False) as made:
        (made / "result.json").touch()
    if not construction._exchanged(path, path):
        pytest.skip("this file system cannot exchange names")

    def look() -> None:
        while not ended.is_set():
            absent.append(not (path / "result.json").exists())

    looking = threading.Thread(target=look)
    looking.start()
    for _ in range(300):
        with whole_folder(path, force=True) as made:
            (made / "result.json").touch()
    ended.set()
    looking.join()
    assert not any(absent)
    assert [found.name for found in tmp_path.iterdir()] == ["a"]


def test_an_old_result_goes_back_to_its_place_where_its_successor_never_came(
    tmp_path: Path,
) -> None:
    aside = tmp_path / f".a.algid{construction.OLD}0123abcd"
    aside.mkdir()
    remove_left(tmp_path, "a.algid")
    assert [path.name for path in tmp_path.iterdir()] == ["a.algid"]
    aside.mkdir()
    remove_left(tmp_path, "a.algid")
    assert [path.name for path in tmp_path.iterdir()] == ["a.algid"]


def test_a_file_system_that_refuses_the_exchange_is_served_in_two_steps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unable(*_arguments: object) -> int:
        ctypes.set_errno(errno.EINVAL)
        return -1

    monkeypatch.setattr(construction, "_renameat2", lambda: unable)
    for name in ("old", "new"):
        with whole_folder(tmp_path / "a", force=True) as made:
            (made / name).touch()
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["new"]
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_a_file_system_without_holds_is_written_to_and_not_swept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unable(*_arguments: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr("fcntl.flock", unable)
    with whole_folder(tmp_path / "a", force=False) as made:
        remove_left(tmp_path)
        assert made.is_dir()
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_a_signal_during_the_clearing_up_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rmtree, signals = shutil.rmtree, [KeyboardInterrupt]

    def interrupted(path: Path, **more: Any) -> None:
        if signals:
            raise signals.pop()
        rmtree(path, **more)

    monkeypatch.setattr(shutil, "rmtree", interrupted)
    with ExitStack() as stack:
        made = stack.enter_context(whole_folder(tmp_path / "a", force=False))
        (made / "half").touch()
        (tmp_path / "a").mkdir()
        (tmp_path / "a/theirs").touch()
        with pytest.raises(KeyboardInterrupt):
            stack.close()
    (tmp_path / "a/theirs").unlink()
    (tmp_path / "a").rmdir()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), "No space left on device"),
        (
            OSError("Error writing bytes to file. Detail: [errno 28] No space left on device"),
            "No space left on device",
        ),
        (OSError("the library's own\nwords"), "the library's own"),
        (OSError(), "OSError"),
    ],
)
def test_what_the_system_says_is_told_whoever_raises_it(
    tmp_path: Path, error: OSError, said: str
) -> None:
    with (
        pytest.raises(OutputError, match=rf"cannot write \({re.escape(said)}\); choose"),
        whole_file(tmp_path / "a"),
    ):
        raise error
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("links", [True, False])
def test_of_two_writers_of_a_file_the_second_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool
) -> None:
    def unable(*_: object, **__: object) -> None:
        raise OSError(errno.EPERM, os.strerror(errno.EPERM))

    if not links:  # as on FAT
        monkeypatch.setattr(os, "link", unable)
    path = tmp_path / "a.csv"
    with ExitStack() as stack:
        early = stack.enter_context(whole_file(path, force=False))
        early.write_text("early")
        with whole_file(path, force=False) as late:
            late.write_text("late")
        with pytest.raises(OutputError, match=r"/a\.csv: exists already; choose another"):
            stack.close()
    assert path.read_text() == "late"
    with pytest.raises(OutputError, match="exists already"), whole_file(path, force=False):
        pass
    with whole_file(path) as again:
        again.write_text("again")
    assert path.read_text() == "again"
    assert [found.name for found in tmp_path.iterdir()] == ["a.csv"]
    assert path.stat().st_nlink == 1
