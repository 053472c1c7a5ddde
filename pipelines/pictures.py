"""Draw the README's pictures from a result folder: the terminal as SVG, the report as PNG, light
and dark.

    python -m pipelines.pictures build/pictures/case1-unloaded.algid -o data/pictures

Needs Debian's package chromium for the report; without it only the terminal is drawn.
"""

from __future__ import annotations

import argparse
import io
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from rich.console import Console
from rich.text import Text

from algid.report.page import result_document, write_pages
from algid.report.terminal import print_document
from algid.results import Result, read_result

SCREEN = "1280,1945"  # down to the end of the torques
DRAWN = 20_000  # ms of the page's own time, after which every figure stands
THEMES = {"light": "1", "dark": "0"}  # as Chromium numbers them


def main() -> int:
    """Draw the pictures; 1 where Chromium is missing."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("result", type=Path)
    parser.add_argument("-o", "--output", type=Path, default=Path("pipelines/pictures"))
    wanted = parser.parse_args()
    wanted.output.mkdir(parents=True, exist_ok=True)
    result = read_result(wanted.result)
    (wanted.output / "terminal.svg").write_text(
        terminal_svg(result, wanted.result), encoding="utf-8"
    )
    chromium = shutil.which("chromium")
    if chromium is None:
        print("chromium is not installed: no picture of the report", file=sys.stderr)
        return 1
    page, _ = write_pages(wanted.result)
    for theme in THEMES:
        photograph(chromium, page, theme, wanted.output / f"report-{theme}.png")
    return 0


def terminal_svg(result: Result, folder: Path) -> str:
    """What `algid report` prints, as SVG without the web font that rich asks for."""
    console = Console(
        record=True, width=112, file=io.StringIO(), force_terminal=True, color_system="truecolor"
    )
    console.print(Text(f"$ algid report {folder.name}\n"))
    print_document(result_document(result), console)
    svg = console.export_svg(title="algid", unique_id="algid")
    return re.sub(r"@font-face\s*{[^}]*}", "", svg)


def photograph(chromium: str, page: Path, theme: str, picture: Path) -> None:
    """The top of `page` in that theme."""
    with tempfile.TemporaryDirectory() as profile:
        command = [
            chromium,
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--hide-scrollbars",
            f"--user-data-dir={profile}",
            f"--blink-settings=preferredColorScheme={THEMES[theme]}",
            f"--window-size={SCREEN}",
            f"--virtual-time-budget={DRAWN}",
            f"--screenshot={picture.resolve()}",
            page.resolve().as_uri(),
        ]
        subprocess.run(command, check=True, capture_output=True, timeout=120)


if __name__ == "__main__":
    sys.exit(main())
