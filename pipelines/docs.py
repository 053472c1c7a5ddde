"""The pages of the site: the README in front, the guide as the command prints it, and the API's
reference out of its docstrings.

Usage: python -m pipelines.docs FOLDER
"""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

import algid
from algid.api.guide import TOPICS, text_of

ROOT = Path(__file__).parents[1]
PICTURES = Path("data/pictures")  # as the README names them


def pages(folder: Path) -> None:
    """Write a Markdown file a topic, the README with its pictures, and the reference."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for topic in TOPICS:
        (folder / f"{topic}.md").write_text(_linked(text_of(topic)), encoding="utf-8")
    first = (ROOT / "README.md").read_text(encoding="utf-8").replace("(algid/guide/", "(")
    (folder / "index.md").write_text(
        f"{first}\n[Reference](reference.md): every public name.\n", encoding="utf-8"
    )
    shutil.copytree(ROOT / PICTURES, folder / PICTURES)
    names = [f"::: {home}.{name}\n" for name, home in algid._HOMES.items()]
    (folder / "reference.md").write_text("# Reference\n\n" + "\n".join(names), encoding="utf-8")


def _linked(text: str) -> str:
    """A page whose mentions of other pages, commands in the terminal, lead there."""
    return re.sub(r"`(algid guide ([\w-]+))`", r"[`\1`](\2.md)", text)


if __name__ == "__main__":
    pages(Path(sys.argv[1]))
