"""Every command of the README and the guide, run as it stands, and its output compared with the
one shown.

A fence ``sh`` is run by bash in an empty folder of its page, one block after another; ``sh
install`` needs the network and a clean clone (the slow lane runs it); ``sh elsewhere`` needs a
cluster that is not here. A fence ``text`` shows what the block before it prints: numbers may
differ by what another processor rounds, ``…`` stands for the rest of a line or for lines left out.
A fence ``text found`` shows what comes of an optimiser, which another processor leads to another
place of the same worth: its lines begin with the words shown, its numbers are others. A fence
``python`` is run too; one without a word draws.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import pytest

import algid
from pipelines.docs import pages
from pipelines.typed import run

ROOT = Path(__file__).parents[1]
PAGES = {"README": ROOT / "README.md"} | {
    path.stem: path for path in sorted((Path(algid.__file__).parent / "guide").glob("*.md"))
}
NUMBER = re.compile(r"[-+]?\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?")
COMMAND = re.compile(r"^(?:algid|make|pip|python|git) ", re.MULTILINE)
ROUNDING = 1e-3  # relative: what is printed has three digits or four


@dataclass(frozen=True)
class Block:
    """A fence of a page: its words, its text and the line where it begins."""

    info: str
    text: str
    line: int


def blocks(text: str) -> list[Block]:
    """Every fence of a page, in order."""
    found = re.finditer(r"^```([^\n]*)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    return [Block(one[1].strip(), one[2], text.count("\n", 0, one.start()) + 1) for one in found]


def mismatch(shown: str, printed: str) -> str | None:
    """The first shown line that the printed ones do not hold, in their order.

    None where all are there.
    """
    lines = iter(printed.splitlines())
    for wanted in shown.splitlines():
        if wanted.strip() in ("", "…"):
            continue
        if not any(alike(wanted, line) for line in lines):
            return wanted
    return None


def unlike(shown: str, printed: str) -> str | None:
    """The first shown line that begins with another word than every printed one; None if none.

    An optimiser on another processor ends at another place of nearly the same worth.
    """
    begun = {_first_word(line) for line in printed.splitlines() if line.strip()}
    lines = [line for line in shown.splitlines() if line.strip() not in ("", "…")]
    return next((line for line in lines if _first_word(line) not in begun), None)


def _first_word(line: str) -> str:
    return NUMBER.sub("#", line).split()[0]


def alike(shown: str, printed: str) -> bool:
    """Whether two lines have the same words, and numbers that rounding alone tells apart."""
    if "…" in shown:
        start = shown[: shown.index("…")].rstrip()
        shown, printed = start, printed[: len(start)]
    if _words(shown) != _words(printed):
        return False
    pairs = zip(NUMBER.findall(shown), NUMBER.findall(printed), strict=True)
    return all(abs(number(a) - number(b)) <= ROUNDING * abs(number(a)) for a, b in pairs)


def _words(line: str) -> list[str]:
    """Without numbers and the length of rules, which follows that of the numbers."""
    return re.sub("─+", "─", NUMBER.sub("#", line)).split()


def number(text: str) -> float:
    return float(text.replace(",", ""))


@pytest.mark.parametrize("page", PAGES)
def test_every_block_says_what_it_is(page: str) -> None:
    for block in blocks(PAGES[page].read_text(encoding="utf-8")):
        known = {
            "sh",
            "sh install",
            "sh elsewhere",
            "text",
            "text found",
            "python",
            "python elsewhere",
            "csv",
            "yaml",
            "",
        }
        assert block.info in known, f"{page}, line {block.line}"
        assert block.info.startswith("sh") or not COMMAND.search(block.text), (
            f"{page}, line {block.line}: not run"
        )


@pytest.mark.slow
@pytest.mark.parametrize(
    "page", [page for page, path in PAGES.items() if "```sh\n" in path.read_text("utf-8")]
)
def test_commands_run_as_they_stand(page: str, tmp_path: Path) -> None:
    text = PAGES[page].read_text(encoding="utf-8")
    shutil.copytree(ROOT / "data", tmp_path / "data")
    printed = ""
    for block in blocks(text):
        if block.info == "sh":
            done = run(block.text, tmp_path)
            assert done.returncode == 0, (
                f"{page}, line {block.line}:\n{block.text}{done.stdout}{done.stderr}"
            )
            printed = done.stdout + done.stderr
        elif block.info == "text":
            assert mismatch(block.text, printed) is None, f"{page}, line {block.line}:\n{printed}"
        elif block.info == "text found":
            assert unlike(block.text, printed) is None, f"{page}, line {block.line}:\n{printed}"
        elif block.info == "python":
            done = run(f"python - <<'END'\n{block.text}END\n", tmp_path)
            assert done.returncode == 0, f"{page}, line {block.line}:\n{done.stdout}{done.stderr}"


@pytest.mark.slow
@pytest.mark.skipif(
    "CI" in os.environ, reason="CI runs in a clean clone that it has just installed"
)
def test_the_readme_installs_from_a_clean_clone(tmp_path: Path) -> None:
    """With the network: what `make setup` installs has to be had."""
    block = next(
        one
        for one in blocks(PAGES["README"].read_text(encoding="utf-8"))
        if one.info == "sh install"
    )
    assert block.text.splitlines()[1:] == ["make demo", "make test"]
    # these are its tests
    steps = block.text.replace("…", str(ROOT)).replace("make test", ". .venv/bin/activate")
    done = run(steps + "which algid\nalgid --version\n", tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Table 4" in done.stdout
    assert done.stdout.splitlines()[-2:] == [
        str(tmp_path / "algid/.venv/bin/algid"),
        f"algid {algid.__version__}",
    ]


def test_the_guide_and_the_readme_are_short() -> None:
    """A reader's time: topics and words of the guide, lines of the README."""
    guide = {name: path.read_text("utf-8") for name, path in PAGES.items() if name != "README"}
    assert len(guide) <= 14
    assert sum(len(text.split()) for text in guide.values()) <= 16_000
    assert len(PAGES["README"].read_text("utf-8").splitlines()) <= 90


def test_the_site_has_a_page_for_each_topic_and_every_public_name(tmp_path: Path) -> None:
    pages(tmp_path / "pages")
    guide = {path.stem for path in (Path(algid.__file__).parent / "guide").glob("*.md")}
    found = {path.stem: path.read_text("utf-8") for path in (tmp_path / "pages").glob("*.md")}
    assert set(found) == guide | {"index", "reference"}
    named = re.findall(r"^::: algid\.[\w.]+\.(\w+)$", found["reference"], re.MULTILINE)
    assert sorted(named) == sorted(set(algid.__all__) - {"__version__"})
    assert "<!--" not in "".join(found.values())


@pytest.mark.slow
@pytest.mark.skipif(find_spec("mkdocs") is None, reason="needs the extra docs")
def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    """Its configuration, its docstrings, every link and every heading that a link names."""
    pages(tmp_path / "build/docs-pages")
    for folder in ("algid", "pipelines"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    build = ["mkdocs", "build", "--strict", "--quiet", "-f", "pipelines/mkdocs.yml"]
    done = subprocess.run(
        [sys.executable, "-m", *build], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    reference = (tmp_path / "build/docs/reference.html").read_text("utf-8")
    assert all(f'id="{home}.{name}"' in reference for name, home in algid._HOMES.items())


LINK = re.compile(r"\]\(([^)\s]+)\)|(?:href|src|srcset)=\"([^\"]+)\"")


def leading_nowhere(page: Path) -> list[str]:
    """The links of a page to files or headings that are not there, by GitHub's anchors."""
    text = re.sub(r"^```.*?^```$", "", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)
    wrong = []
    for link in (one or other for one, other in LINK.findall(text)):
        if re.match(r"\w+:", link):
            continue
        place, _, anchor = link.partition("#")
        target = page.parent / place if place else page
        if not target.is_file() or (anchor and anchor not in anchors(target.read_text("utf-8"))):
            wrong.append(link)
    return wrong


def anchors(text: str) -> set[str]:
    """The headings as links name them: small letters, a hyphen for each blank."""
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", one).strip().lower().replace(" ", "-") for one in headings}


def test_every_link_of_a_page_leads_somewhere(tmp_path: Path) -> None:
    pages(tmp_path)
    at_root = [ROOT / f"{name}.md" for name in ("README", "CONTRIBUTING", "SECURITY", "CHANGELOG")]
    every = [*at_root, *PAGES.values(), *tmp_path.glob("*.md")]
    assert {str(page): leading_nowhere(page) for page in every if leading_nowhere(page)} == {}


def test_the_readme_and_the_site_lead_to_every_topic(tmp_path: Path) -> None:
    pages(tmp_path)
    topics = set(PAGES) - {"README"}
    readme = PAGES["README"].read_text("utf-8")
    assert set(re.findall(r"\(algid/guide/([\w-]+)\.md\)", readme)) == topics
    assert set(re.findall(r"\(([\w-]+)\.md\)", (tmp_path / "index.md").read_text())) == {
        *topics,
        "reference",
    }
    assert "[`algid guide warnings`](warnings.md)" in (tmp_path / "report.md").read_text()


def test_a_link_that_leads_nowhere_is_seen(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text('# A `b` c!\n[x](#a-b-c) [y](#d) [z](other.md) <a href="page.md#e">\n')
    assert leading_nowhere(page) == ["#d", "other.md", "page.md#e"]


@pytest.mark.parametrize(
    ("shown", "printed", "same"),
    [
        ("k1  0.0302 kg", "k1     0.0302 kg", True),
        ("k1  0.0302 kg", "k1  0.03020001 kg", True),
        ("k1  0.0302 kg", "k1  0.0304 kg", False),
        ("k1  0.0302 kg", "k2  0.0302 kg", False),
        ("Good: all …", "Good: all 7 parameters are identified", True),
        ("Good: all …", "Failed: all", False),
    ],
)
def test_shown_and_printed_lines_are_compared(shown: str, printed: str, same: bool) -> None:
    assert alike(shown, printed) is same


def test_a_line_that_was_never_printed_is_seen() -> None:
    assert mismatch("a 1\n…\nc 3\n", "a 1\nb 2\nc 3\n") is None
    assert mismatch("a 1\nc 4\n", "a 1\nb 2\nc 3\n") == "c 4"
    assert mismatch("c 3\na 1\n", "a 1\nb 2\nc 3\n") == "a 1"
