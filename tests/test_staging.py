"""Staging: what a killed run leaves goes, what another run makes stays, nothing is seen in part."""

from __future__ import annotations

import ctypes
import errno
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import pytest

from algid.base import staging
from algid.base.errors import OutputError
from algid.base.files import temporary_folder, whole_file, whole_folder
from algid.base.staging import delete_leftovers

KILLED = """
import os, signal, sys
from pathlib import Path
from algid.base.files import temporary_folder, whole_file, whole_folder
makes = {"file": whole_file, "folder": lambda path: whole_folder(path, force=True)}
with makes[sys.argv[1]](Path(sys.argv[2])) as temporary, temporary_folder():
    if temporary.is_dir() and len(sys.argv) > 3:
        (temporary / "half").write_text("written")
    os.kill(os.getpid(), signal.SIGKILL)
"""
ROOT = str(Path(staging.__file__).parents[1])


def _without_exchange(monkeypatch: pytest.MonkeyPatch) -> None:
    """As with a file system that cannot exchange two names."""

    class Library:
        @staticmethod
        def renameat2(*_arguments: object) -> int:
            ctypes.set_errno(errno.EINVAL)
            return -1

    monkeypatch.setattr(ctypes, "CDLL", lambda *_, **__: Library)


def _without_renameat2(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ctypes, "CDLL", lambda *_, **__: object())


Prepare = Callable[[pytest.MonkeyPatch], None]
SYSTEMS: list[Prepare] = [lambda _patch: None, _without_exchange, _without_renameat2]


def _kill_while_making(*arguments: str | Path) -> None:
    environment = {**os.environ, "PYTHONPATH": ROOT, "TMPDIR": str(Path(arguments[1]).parent)}
    command = [sys.executable, "-c", KILLED, *map(str, arguments)]
    assert subprocess.run(command, env=environment, check=False).returncode == -signal.SIGKILL


@pytest.mark.parametrize("kind", [("file",), ("folder",), ("folder", "half")])
def test_the_next_run_deletes_what_a_killed_one_left(tmp_path: Path, kind: tuple[str, ...]) -> None:
    path = tmp_path / "a[1].algid"
    _kill_while_making(kind[0], path, *kind[1:])
    assert len(list(tmp_path.iterdir())) == 2
    with whole_folder(path, force=False):
        assert len(list(tmp_path.iterdir())) == 1
    assert list(tmp_path.iterdir()) == [path]


def test_what_another_run_makes_stays(tmp_path: Path) -> None:
    with whole_folder(tmp_path / "a", force=False) as first, whole_file(tmp_path / "b") as second:
        delete_leftovers(tmp_path)
        assert first.is_dir()
        assert second.is_file()
    assert {path.name for path in tmp_path.iterdir()} == {"a", "b"}


def test_what_is_deleted_before_it_is_locked_is_made_again(tmp_path: Path) -> None:
    made = list[Path]()

    def make(place: Path) -> None:
        place.mkdir()
        made.append(place)
        if len(made) == 1:
            delete_leftovers(tmp_path)

    with staging.staged(tmp_path / "a", make) as temporary:
        assert made == [temporary, temporary]
        delete_leftovers(tmp_path)
        assert temporary.is_dir()


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
        delete_leftovers(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*names, "a"])


@pytest.mark.parametrize("prepare", SYSTEMS)
def test_of_two_writers_the_second_is_refused_and_with_force_the_last_one_stands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, prepare: Prepare
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
@pytest.mark.parametrize("prepare", SYSTEMS)
def test_whatever_stands_there_is_replaced_by_force_alone_and_links_are_not_followed(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    prepare: Prepare,
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
    if sys.platform != "linux":
        pytest.skip("this system cannot exchange names")

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


def test_a_file_system_without_locks_is_written_to_and_not_swept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unable(*_arguments: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr("fcntl.flock", unable)
    with whole_folder(tmp_path / "a", force=False) as made:
        delete_leftovers(tmp_path)
        assert made.is_dir()
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), "No space left on device"),
        (OSError("the library's own\nwords"), "the library's own"),
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


@pytest.mark.parametrize("prepare", SYSTEMS)
def test_of_two_writers_of_a_file_the_second_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, prepare: Prepare
) -> None:
    prepare(monkeypatch)
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
