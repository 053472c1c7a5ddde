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
from types import SimpleNamespace
from typing import Any

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


LIBRARIES = [ctypes.CDLL(None), SimpleNamespace(renameat2=lambda *_: -1), object()]


@pytest.fixture(params=LIBRARIES, ids=["this system", "no exchange of names", "not Linux"])
def system(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """The library of a system that may be unable to exchange two names."""
    monkeypatch.setattr(ctypes, "CDLL", lambda _: request.param)


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
    names = ["algid-1234abcd", ".a.algid-backup", ".a.algid-0123abcde"]
    for name in names:
        (tmp_path / name).mkdir()
    with temporary_folder(), whole_folder(tmp_path / "a", force=False):
        delete_leftovers(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*names, "a"])


@pytest.mark.usefixtures("system")
@pytest.mark.parametrize(("whole", "below"), [(whole_folder, "result.json"), (whole_file, "")])
def test_of_two_writers_the_second_is_refused_and_with_force_the_last_one_stands(
    tmp_path: Path, whole: Callable[..., Any], below: str
) -> None:
    path = tmp_path / "a"
    for force, last in ((False, "early"), (True, "late")):
        with ExitStack() as stack:
            late = stack.enter_context(whole(path, force=force))
            (late / below).write_text("late")
            with whole(path, force=force) as early:
                (early / below).write_text("early")
            assert (path / below).read_text() == "early"
            if not force:
                with pytest.raises(OutputError, match="/a: exists already; choose another folder"):
                    stack.close()
        assert (path / below).read_text() == last
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.usefixtures("system")
@pytest.mark.parametrize("kind", ["file", "link", "dangling link", "empty folder"])
def test_whatever_stands_there_is_replaced_by_force_alone_and_links_are_not_followed(
    tmp_path: Path, kind: str
) -> None:
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


def test_a_file_takes_no_folders_place(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    with pytest.raises(OutputError, match=r"/a: cannot write \("), whole_file(tmp_path / "a"):
        pass
    assert list(tmp_path.iterdir()) == [tmp_path / "a"]
