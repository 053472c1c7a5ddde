"""Result folders: what a killed run leaves is removed by the next one, what a living one writes is not."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from algid.files import FRESH, remove_stale, whole_folder

CODE = """
import os, signal, sys
from pathlib import Path
from algid.files import whole_folder
with whole_folder(Path(sys.argv[1]), force=True) as temporary:
    (temporary / "half").write_text("written")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def _aged(path: Path) -> Path:
    past = time.time() - 2 * FRESH
    os.utime(path, (past, past))
    return path


def test_what_a_killed_run_left_is_removed(tmp_path: Path) -> None:
    folder = tmp_path / "a[1].algid"
    ended = subprocess.run([sys.executable, "-c", CODE, str(folder)], check=False)
    assert ended.returncode == -signal.SIGKILL
    (left,) = tmp_path.iterdir()
    remove_stale(folder)
    assert left.exists()  # too young to tell from one that is just being made
    _aged(left)
    remove_stale(tmp_path / "b.algid")
    assert left.exists()
    remove_stale(folder)
    assert not left.exists()


def test_what_is_being_written_stays(tmp_path: Path) -> None:
    folder = tmp_path / "a.algid"
    with whole_folder(folder, force=False) as temporary:
        _aged(temporary)
        remove_stale(folder)
        (temporary / "result.json").write_text("{}")
    assert (folder / "result.json").exists()


def test_an_old_result_stays_until_a_new_one_is_in_its_place(tmp_path: Path) -> None:
    folder = tmp_path / "a.algid"
    aside = tmp_path / ".a.algid.old.x"
    aside.mkdir()
    remove_stale(folder)
    assert _aged(aside).exists()
    folder.mkdir()
    remove_stale(folder)
    assert not aside.exists()
