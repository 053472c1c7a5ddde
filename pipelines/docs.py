"""The pages of the site: the guide as the command prints it, and the API's reference out of its
docstrings.

Usage: python -m pipelines.docs FOLDER
"""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

import algid
from algid.api.guide import SUMMARIES, text_of


def pages(folder: Path) -> None:
    """Write a Markdown file a topic, a list of them, and the reference."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for topic in SUMMARIES:
        (folder / f"{topic}.md").write_text(_linked(text_of(topic)), encoding="utf-8")
    rows = "\n".join(f"- [{topic}]({topic}.md): {words}" for topic, words in SUMMARIES.items())
    first = f"# algid\n\n{(algid.__doc__ or '').splitlines()[0].partition(': ')[2]}\n\n{rows}\n"
    (folder / "index.md").write_text(
        f"{first}- [reference](reference.md): every public name\n", encoding="utf-8"
    )
    names = [f"::: {home}.{name}\n" for name, home in algid._HOMES.items()]
    (folder / "reference.md").write_text("# Reference\n\n" + "\n".join(names), encoding="utf-8")


def _linked(text: str) -> str:
    """A page whose mentions of other pages, commands in the terminal, lead there."""
    return re.sub(r"`(algid guide ([\w-]+))`", r"[`\1`](\2.md)", text)


if __name__ == "__main__":
    pages(Path(sys.argv[1]))
