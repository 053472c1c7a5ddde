"""One document, three renderers: what each shows of it, in what order, and that nothing foreign
gets through.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import html
import io
import json
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from algid.notices import Notice
from algid.report.arm import ArmDrawing
from algid.report.document import (
    Bullets,
    Column,
    Content,
    Depth,
    Document,
    Drawn,
    ReadingAid,
    References,
    Section,
    Table,
    filled,
)
from algid.report.figures.base import Figure, Legend, Missing, Panel, packed
from algid.report.frame import drawing, page
from algid.report.markdown import markdown, markdown_table
from algid.report.terminal import print_document
from algid.verdict import Verdict, graded

COLUMNS = (Column("Name", "name"), Column("Value", "number"))
GOOD = Verdict("good", "all is well")
NASTY = "<b>&\"'</b>"


def table(title: str, depth: Depth = Depth.TERMINAL, rows: int = 1) -> Table:
    return Table(
        title, COLUMNS, tuple((f"row {place}", str(place)) for place in range(rows)), depth=depth
    )


def figure(key: str, panels: int = 1) -> Figure:
    made = tuple(
        Panel([{"type": "scatter"}], {}, f"says {place}", height=100 + place)
        for place in range(panels)
    )
    return Figure(key, f"Figure {key}", made, "Read: it.")


def arm() -> ArmDrawing:
    t = np.linspace(0.0, 1.0, 20)
    return ArmDrawing(0.3, 0.2, t, np.stack([t, -t]), "Play it.")


def document(*sections: Section, verdict: Verdict = GOOD) -> Document:
    return Document("A title", verdict, sections, "kicker", "name", "facts", "Made by hand.")


def terminal(shown: Document, **options: object) -> str:
    console = Console(file=io.StringIO(), width=100, **options)  # type: ignore[arg-type]
    print_document(shown, console)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def main_of(text: str) -> str:
    """What stands between the page's contents and its footer."""
    return text.partition('<main id="numbers">')[2].partition("</main>")[0]


def part(text: str, tag: str) -> str:
    """What stands within the page's first element of a tag."""
    return text.partition(f"<{tag}")[2].partition(f"</{tag}>")[0]


def section_html(section: Section) -> str:
    return main_of(page(document(section), shared_library=True)).strip("\n")


def table_html(shown: Table) -> str:
    return section_html(Section((shown,)))


def banner(verdict: Verdict) -> str:
    return part(page(document(verdict=verdict), shared_library=True), "header")


def unbroken(text: str) -> str:
    shown = section_html(Section((table("T"),), "key", text))
    return shown.partition('<h2 id="key">')[2].partition("</h2>")[0]


def positions(text: str, words: list[str]) -> list[int]:
    return [text.index(word) for word in words]


DEPTHS = document(
    Section(
        (table("Deep", Depth.PAGE), table("First"), figure("one"), table("Folded", Depth.FOLDED))
    ),
    Section((table("Second"), table("Third", Depth.MARKDOWN)), "more", "More"),
    Section((table("Last"),), "paper", "The paper's", fold="closed"),
)


def test_each_format_goes_as_deep_as_it_has_room_and_keeps_the_order() -> None:
    printed, text, shown = (
        terminal(DEPTHS),
        markdown(DEPTHS),
        main_of(page(DEPTHS, shared_library=True)),
    )
    assert re.findall(r"^(Deep|First|Second|Third|Folded|Last)\b", printed, re.M) == [
        "First",
        "Second",
        "Last",
    ]
    assert re.findall(r"^\*\*(\w+)\*\*$", text, re.M) == [
        "First",
        "Second",
        "Third",
        "Last",
        "Folded",
    ]
    assert re.findall(r"<caption>(\w+)</caption>", shown) == [
        "Deep",
        "First",
        "Folded",
        "Second",
        "Third",
        "Last",
    ]
    assert text.index("<details>") < text.index("**Folded**") < text.index("</details>")
    assert "<details>" not in markdown(document(Section((table("First"),))))


def test_the_contents_lead_to_sections_and_to_the_figures_of_those_without_a_heading() -> None:
    lost = Missing("lost", "A lost one", "the file is gone")
    shown = document(
        Section((table("T"), figure("one"), lost, arm())),
        Section((figure("two"),), "part", "A part <&>"),
        Section((), "empty", "Empty"),
        Section((table("Last"),), "paper", "The paper's", fold="open"),
    )
    contents = part(page(shown, shared_library=True), "nav")
    links = re.findall(r'<a href="#(\w+)">(.*?)</a>', contents)
    assert [(key, html.unescape(title)) for key, title in links] == [
        ("numbers", "Numbers"),
        ("one", "Figure one"),
        ("lost", "A lost one"),
        ("arm", "The arm"),
        ("part", "A part <&>"),
        ("paper", "The paper's"),
    ]
    text = page(shown, shared_library=True)
    for key, _ in links:
        assert text.count(f' id="{key}"') == 1
    assert "Empty" not in text
    assert '<p class="missing">Not shown: the file is gone.</p>' in text


def test_an_arm_stands_beside_its_section_and_brings_its_script_once() -> None:
    beside = section_html(Section((table("T"),), beside=arm()))
    assert beside.startswith('<div class="first"><div>')
    assert beside.index("</table>") < beside.index('<figure class="arm"')
    assert section_html(Section((table("T"),))).startswith('<div class="scroll"')
    with_arm = page(document(Section((table("T"),), beside=arm())), shared_library=True)
    without = page(document(Section((table("T"),))), shared_library=True)
    assert with_arm.count("<script>") == without.count("<script>") + 1 == 2
    assert '<a href="#arm">' not in with_arm  # what stands on the first screen needs no link


def test_a_fold_is_open_or_closed() -> None:
    for fold, attribute in (("open", " open"), ("closed", "")):
        section = Section((table("T"),), "key", "A <fold>", fold=fold)  # type: ignore[arg-type]
        text = section_html(section)
        assert text.startswith(
            f'<details class="paper" id="key"{attribute}><summary>A &lt;fold&gt;</summary>'
        )
        assert text.endswith("</details>")
    assert section_html(Section((), "key", "A fold", fold="open")) == ""


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (ReadingAid(NASTY), '<p class="reading">&lt;b&gt;&amp;&quot;&#x27;&lt;/b&gt;</p>'),
        (
            Bullets(("one", NASTY)),
            "<ul><li>one</li><li>&lt;b&gt;&amp;&quot;&#x27;&lt;/b&gt;</li></ul>",
        ),
        (Bullets((), "None & done."), '<p class="note">None &amp; done.</p>'),
        (
            References(
                {"r<1>": [("a&b", "./a%26b"), ("c", "./c"), ("d", "./d"), ("e", "./e")], "r2": []},
                2,
            ),
            (
                '<dl><dt>r&lt;1&gt;</dt><dd><a href="./a%26b">a&amp;b</a>, <a href="./c">c</a> '
                "and 2 more</dd>"
                "<dt>r2</dt><dd>none</dd></dl>"
            ),
        ),
    ],
)
def test_words_lists_and_links_are_set_as_text(content: Content, expected: str) -> None:
    assert section_html(Section((content,))) == expected
    assert section_html(Section((content,), "key", "T")).startswith(
        '<section aria-labelledby="key"><h2 id="key">T</h2>'
    )
    assert terminal(document(Section((content,)))) == "Good: all is well.\n"  # tables alone


def test_a_page_says_what_kind_it_is_of_what_and_who_made_it() -> None:
    shown = replace(
        document(Section((table("T"),))),
        kicker="k<1>",
        name="n<2>",
        facts="f<3>",
        made="m<4>",
        tab="",
    )
    text = page(shown, shared_library=True)
    assert '<p class="kicker">algid · k&lt;1&gt;</p><h1>n&lt;2&gt;</h1>' in text
    assert '<p class="facts">f&lt;3&gt;</p>' in text
    assert "<footer>m&lt;4&gt;</footer>" in text
    assert "<title>n&lt;2&gt; · algid</title>" in text
    assert "<title>t&lt;5&gt; · algid</title>" in page(
        replace(shown, tab="t<5>"), shared_library=True
    )
    assert markdown(replace(shown, title="a_b")).startswith("### a\\_b\n")


@pytest.mark.parametrize("shared", [False, True])
def test_the_policy_names_every_script_that_runs_and_no_other(shared: bool) -> None:
    text = page(document(Section((arm(), figure("one")))), shared)
    policy = re.search(r'Content-Security-Policy" content="(.*?)"', text)
    assert policy is not None
    scripts = re.findall(r"<script>(.*?)</script>", text, re.S)
    assert len(scripts) == 2
    hashes = [
        base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts
    ]
    source = policy[1].partition("script-src ")[2].partition(";")[0].split()
    assert source[1:] == [f"'sha256-{digest}'" for digest in hashes]
    nonce = re.search(r'<script nonce="(\w+)" src="\.\./plotly\.min\.js">', text)
    if shared:
        assert nonce is not None
        assert source[0] == f"'nonce-{nonce[1]}'"
        other = page(document(Section((arm(), figure("two")))), shared_library=True)
        assert nonce[1] not in other  # nobody can foretell it from another page
        worded = page(
            replace(document(Section((arm(), figure("one")))), facts="others"), shared_library=True
        )
        assert nonce[1] not in worded  # nor from the same figures
    else:
        assert nonce is None
        assert source[0].startswith("'sha256-")
    assert "'unsafe-inline'" not in " ".join(source)


def test_the_script_is_handed_every_panel_in_its_place() -> None:
    two = replace(figure("two", panels=2), columns=2)
    shown = document(
        Section((figure("one"), Missing("x", "X", "gone"))), Section((two,), "part", "P")
    )
    text = page(shown, shared_library=True)
    packed = text.partition('id="figures">')[2].partition("</script>")[0]
    data = json.loads(gzip.decompress(base64.b64decode(packed)))
    assert data == json.loads(json.dumps(drawing(shown)))
    told = [
        (panel["id"], panel["figure"], panel["columns"], panel["height"])
        for panel in data["panels"]
    ]
    assert told == [
        ("one-0", "one", "one", 100),
        ("two-0", "two", "two", 100),
        ("two-1", "two", "two", 101),
    ]
    assert all(text.count(f'id="{key}"') == 1 for key, *_ in told)
    assert text.index('class="panels two"') > text.index('id="two"') > text.index('class="panels"')
    assert text.count('<div class="panels two">') == text.count('<div class="panels">') == 1
    assert set(data["template"]["layout"]) >= {"xaxis", "yaxis", "paper_bgcolor"}


def test_an_array_that_lines_share_is_written_once() -> None:
    x, y = packed(np.arange(3.0)), packed(np.arange(3.0, 6.0))
    traces: list[dict[str, Any]] = [
        {"x": x, "y": y, "error_y": {"array": x}},
        {"x": x, "y": [1, 2]},
    ]
    made = replace(figure("one"), panels=(Panel(traces, {}, ""),))
    data: Any = drawing(document(Section((made,))))
    assert data["arrays"] == [x["bdata"], y["bdata"]]
    (panel,) = data["panels"]
    assert panel["traces"] == [
        {"x": x | {"bdata": 0}, "y": y | {"bdata": 1}, "error_y": {"array": x | {"bdata": 0}}},
        {"x": x | {"bdata": 0}, "y": [1, 2]},
    ]
    assert traces[0]["x"] == packed(np.arange(3.0))  # the figure's own are left as they are


def test_a_legend_with_a_group_is_a_button_and_views_are_a_choice() -> None:
    legend = (Legend("g&", "words <1>", "@blue/0.25", "area"), Legend("", "fixed", "@ink"))
    made = replace(figure("one"), legend=legend, views=(("log <a>", 0.0, 1.5), ("b", 2.0, 3.25)))
    text = section_html(Section((made,)))
    buttons = re.findall(r"<button.*?</button>", text)
    assert len(buttons) == 1
    assert 'data-figure="one" data-group="g&amp;"' in buttons[0]
    assert 'class="swatch area" style="--tint:var(--blue);opacity:0.25"' in buttons[0]
    assert (
        '<span class="entry"><span class="swatch line" style="--tint:var(--ink);opacity:1">' in text
    )
    assert re.findall(r'<option value="(.*?)">(.*?)</option>', text) == [
        ("", "all logs"),
        ("0,1.5", "log &lt;a&gt;"),
        ("2,3.25", "b"),
    ]
    assert "<select" not in section_html(Section((figure("one"),)))
    assert "legend" not in section_html(Section((figure("one"),)))


WIDE = Table(
    "Wide",
    (
        Column("Parameter", "name"),
        Column("Estimate", "number"),
        Column("± std", "number"),
        Column("Status", "status"),
        Column("Why", "text"),
    ),
    (
        ("k1", "1.0", "0.1", "OK", "yes"),
        ("k<2>", "2.0", "0.2", "WEAK_EXCITATION", "x" * 41),
        ("k3", "3", "", "OK", "no"),
    ),
    "A note & more.",
)


def test_texts_on_a_card_have_their_heading_but_those_that_need_none() -> None:
    columns = (Column("Robot", "name"), *(Column(one, "text") for one in ("Changed", "To", "Unit")))
    text = table_html(Table("Robots", columns, (("r1", "in May", "", "N m"),)))
    assert '<td class="text" data-label="Changed">in May</td>' in text
    assert '<td class="text"></td>' in text
    assert '<td class="text">N m</td>' in text


def test_no_line_ends_within_a_flag_or_a_date() -> None:
    assert unbroken("run --zero hanging, a--b <--l1>") == (
        'run <span class="whole">--zero</span> hanging, a--b '
        '&lt;<span class="whole">--l1</span>&gt;'
    )
    assert unbroken("2026-01-05 20260105-1 1-2026-01-05") == (
        '<span class="whole">2026-01-05</span> 20260105-1 1-2026-01-05'
    )


def test_cells_say_what_they_hold() -> None:
    text = table_html(WIDE)
    assert '<div class="scroll cards" ' in text
    assert text.count('<tr class="doubtful">') == 1
    assert text.count('class="status ok"') == 2
    assert '<td class="status">WEAK_EXCITATION</td>' in text
    assert '<td class="number estimate">1.0</td>' in text  # the card's heading needs no label
    assert '<td class="number" data-label="±">0.1</td>' in text
    assert '<td class="text" data-label="Why">yes</td>' in text  # means nothing without its heading
    assert f'<td class="text long">{"x" * 41}</td>' in text
    assert 'class="text long"' not in table_html(
        replace(WIDE, rows=(("k", "1", "", "OK", "x" * 40),))
    )
    assert '<th scope="row">k&lt;2&gt;</th>' in text
    assert text.count('<th scope="col" class="number">') == 2
    assert '<p class="note">A note &amp; more.</p>' in text
    failed = table_html(WIDE.doubted())
    assert failed.count('<tr class="doubtful">') == 3
    assert "status ok" not in failed
    assert '<div class="scroll" ' in table_html(WIDE.only([0, 1, 3]))


def test_drawings_stand_after_their_column_or_last_and_names_lead_to_their_place() -> None:
    drawn = (
        Drawn("plot", {"k1": "<svg>1</svg>", "k3": "<svg>3</svg>"}, after="± std"),
        Drawn("course", {"k<2>": "<svg>2</svg>"}, small=True),
    )
    text = table_html(replace(WIDE, drawn=drawn, links={"k<2>": './x"y'}))
    heads = re.findall(r'<th scope="col"[^>]*>(.*?)</th>', text)
    assert heads == ["Parameter", "Estimate", "± std", "plot", "Status", "Why", "course"]
    first, second, third = re.findall(r"<tr.*?</tr>", text)[1:]
    assert '<td class="drawn" data-label="plot"><svg>1</svg></td>' in first
    assert '<td class="drawn small" data-label="course"></td>' in first
    assert '<td class="drawn" data-label="plot"></td>' in second
    assert '<a href="./x&quot;y">k&lt;2&gt;</a>' in second
    assert "<a " not in first + third
    assert "svg" not in markdown_table(replace(WIDE, drawn=drawn))


def test_a_markdown_table_lines_up_and_escapes() -> None:
    lines = markdown_table(replace(WIDE, rows=(("a|b", "*1*", "", "OK", "<i>"),))).splitlines()
    assert lines == [
        "**Wide**",
        "",
        "| Parameter | Estimate | ± std | Status | Why |",
        "| :-- | --: | --: | :-- | :-- |",
        r"| a\|b | \*1\* |  | OK | \<i\> |",
        "",
        r"A note \& more.",
    ]


def test_tables_lose_columns_but_never_their_place_in_the_report() -> None:
    made = replace(WIDE, depth=Depth.FOLDED, links={"k1": "x"})
    fewer = made.without(["Status", "Why", "absent"])
    assert [column.heading for column in fewer.columns] == ["Parameter", "Estimate", "± std"]
    assert fewer.rows[0] == ("k1", "1.0", "0.1")
    assert (fewer.depth, fewer.links, fewer.note) == (Depth.FOLDED, {"k1": "x"}, made.note)
    empty = replace(WIDE, rows=(("k1", "–", "", "OK", "–"),)).without_empty()
    assert [column.heading for column in empty.columns] == ["Parameter", "Status"]
    assert filled(table("a"), table("b", rows=0), table("c", rows=2)) == (
        table("a"),
        table("c", rows=2),
    )


def test_a_narrow_table_loses_the_highest_rank_first_and_never_one_without() -> None:
    ranked = Table(
        "T",
        tuple(Column(str(rank), "text", rank) for rank in (0, 2, 1, 3)),
        (("a", "b", "c", "d"),),
    )
    left = []
    one: Table | None = ranked
    while one is not None:
        left.append([column.heading for column in one.columns])
        one = one.narrower()
    assert left == [["0", "2", "1", "3"], ["0", "2", "1"], ["0", "1"], ["0"]]
    assert Table("T", (), ()).narrower() is None


def test_one_sentence_judges_every_report() -> None:
    reasons = (Notice("A", "k2 is singular"), Notice("B", "it jitters"))
    assert graded("k is known").sentence == "Good: k is known."
    assert (
        graded("k is known", reasons).sentence
        == "With reservations: k is known, but k2 is singular."
    )
    failed = graded("k is known", reasons, failure="it broke", things="masses", command="run")
    assert failed.sentence == "Failed: it broke; do not use these masses."
    assert (failed.grade, failed.reasons, failed.command) == ("failed", reasons, "run")
    assert graded("k", reasons, failure="it broke").sentence.endswith("these numbers.")


def test_the_word_of_a_verdict_is_marked_in_every_format() -> None:
    reasons = (Notice("A", "a|b"), Notice("C", "c"))
    poor = Verdict("failed", "it is <broken>", reasons, command="algid x '`y`'")
    shown = document(verdict=poor)
    coloured = terminal(shown, force_terminal=True, color_system="standard")
    assert "\x1b[1;31mFailed\x1b[0m: it is <broken>." in coloured
    plain = terminal(shown)
    assert [line.rstrip() for line in plain.splitlines()] == [
        "Failed: it is <broken>.",
        " • a|b [A]",
        " • c [C]",
        "Run first: algid x '`y`'",
    ]
    text = markdown(shown)
    assert "❌ **Failed**: it is \\<broken\\>." in text
    assert "```sh\nalgid x '`y`'\n```" in text
    assert "- a\\|b\n- c\n" in text
    marked = banner(poor)
    assert '<div class="verdict failed"><span class="sign" aria-hidden="true">✕</span>' in marked
    assert "<p><strong>Failed</strong>: it is &lt;broken&gt;.</p>" in marked
    assert "Run first: <code>algid x &#x27;`y`&#x27;</code>" in marked
    assert "<ul><li>a|b</li><li>c</li></ul>" in marked
    assert "<ul>" not in banner(GOOD)
    assert "cause" not in banner(GOOD)


def test_no_row_of_backticks_ends_a_block_of_code() -> None:
    text = markdown(document(verdict=Verdict("failed", "no", command="echo ````x```` ``")))
    assert "\n`````sh\necho ````x```` ``\n`````\n" in text
