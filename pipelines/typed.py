"""Run the commands of the guide's pages and write their output into the pages.

A fence ``text`` or ``text found`` has the output of the fence ``sh`` before it. One with ``…``
shows lines that were chosen by hand, and stays as it is.

Usage: python -m pipelines.typed [PAGE …]
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = ("lab", "motion")
FENCE = re.compile(r"^```(sh|text|text found)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def run(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a block as a person would type it: bash, the environment activated, stop at the first
    failure.
    """
    environment = {
        **os.environ,
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
        "COLUMNS": "80",
    }
    return subprocess.run(
        ["bash", "-e", "-u", "-c", command],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


def output(command: str, folder: Path) -> str:
    """What bash prints for a block, standard error last.

    Raises
    ------
    RuntimeError
        If a command of it fails.
    """
    done = run(command, folder)
    if done.returncode:
        raise RuntimeError(f"{command}{done.stdout}{done.stderr}")
    return done.stdout + done.stderr


def typed(text: str, folder: Path) -> str:
    """The page with what its commands print in `folder`."""
    printed = ""

    def block(fence: re.Match[str]) -> str:
        nonlocal printed
        kind, inside = fence[1], fence[2]
        if kind == "sh":
            printed = output(inside, folder)
            return fence[0]
        if "…" in inside:  # lines that were chosen by hand
            return fence[0]
        lines = [line.rstrip() for line in printed.strip("\n").splitlines()]
        return f"```{kind}\n" + "".join(f"{line}\n" for line in lines) + "```"

    return FENCE.sub(block, text)


def main(pages: list[str]) -> None:
    for page in pages:
        path = ROOT / "algid" / "guide" / f"{page}.md"
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            shutil.copytree(ROOT / "data", folder / "data")
            path.write_text(typed(path.read_text(encoding="utf-8"), folder), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:] or list(PAGES))
