"""Reports as a browser shows them: drawn whole, offline, safe, legible."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from algid.report.page import write_pages
from algid.results import Estimate, Result, Status, write_result
from tests.report.browser import DRIVER, Browser, Seen
from tests.report.folders import hostile

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        DRIVER is None or shutil.which("chromium") is None,
        reason="chromium and chromium-driver are not installed",
    ),
]


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    opened = Browser()
    yield opened
    opened.close()


def assert_sound(seen: Seen, page: Path, title: str) -> None:
    assert seen.console == []
    assert seen.failed == 0
    assert seen.drawn == seen.panels > 0
    assert seen.requests == [page.resolve().as_uri()]
    assert seen.title == title
    assert seen.poor_contrast == []  # WCAG AA: 4.5 to 1
    assert seen.overflow <= 0


@pytest.mark.parametrize(("width", "dark"), [(1400, False), (400, True)])
def test_a_complete_report(browser: Browser, folder: Path, width: int, dark: bool) -> None:
    page = write_pages(folder)[0]
    seen = browser.look(page, width, dark)
    assert_sound(seen, page, "case1-unloaded.mcap and 1 more · algid")
    # a phone shows the intervals and the torque; what is folded is drawn as it is opened
    assert seen.drawn == (8 if width > 640 else 2)
    run = browser.driver.execute_script
    run("for (const part of document.querySelectorAll('details.part')) part.open = true")
    browser.until("return document.documentElement.dataset.drawn === '10'")
    assert run("return document.documentElement.dataset.failed") == "0"
    assert run("return document.documentElement.scrollWidth") <= width
    assert seen.background == ("rgb(16, 21, 28)" if dark else "rgb(255, 255, 255)")


def test_names_that_attack_a_parameter_that_is_lost_and_the_library_beside(
    browser: Browser, folder: Path, result: Result
) -> None:
    lost = Estimate(estimate=None, ci95=(None, None), unit="kg m^2", status=Status.NOT_IDENTIFIABLE)
    parameters = {**result.parameters, "k5": lost}
    write_result(
        hostile(result.model_copy(update={"parameters": parameters})), folder / "result.json"
    )
    page = write_pages(folder, shared_library=True)[0]
    seen = browser.look(page, 400)
    library = (folder.parent / "plotly.min.js").resolve().as_uri()
    assert seen.requests == [page.resolve().as_uri(), library]
    # the path's last part, shown; what it would run sets another title
    assert seen.title.startswith("script>")
    assert_sound(replace(seen, requests=seen.requests[:1]), page, seen.title)


def test_figures_follow_keys_theme_and_paper(browser: Browser, folder: Path) -> None:
    browser.look(write_pages(folder)[0])
    run = browser.driver.execute_script
    ink = "return document.getElementById('plot-torque')._fullLayout.font.color"
    press = (
        "document.getElementById('plot-torque').dispatchEvent(new KeyboardEvent('keydown', {key: "
        "arguments[0]}))"
    )
    ranges = (
        "return ['xaxis', 'xaxis3'].map((axis) => "
        "[...document.getElementById('plot-torque')._fullLayout[axis].range])"
    )
    whole = run(ranges)[0]
    run(press, "+")
    browser.until(
        "return document.getElementById('plot-torque')._fullLayout.xaxis3.range[0] > arguments[0]",
        whole[0],
    )
    one, two = run(ranges)
    assert one == two  # panels of one figure move together
    assert whole[0] < one[0] < one[1] < whole[1]
    run(press, "ArrowRight")
    assert run(ranges)[0][0] > one[0]
    run(press, "0")
    assert run(ranges)[0] == pytest.approx(whole)

    assert run(ink) == "#1a2230"
    dark = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", dark)
    browser.until(f"{ink} === '#e7ecf3'")

    run("dispatchEvent(new Event('beforeprint'))")
    assert run("return document.getElementById('plot-torque')._fullLayout.width") == 690
    assert run(ink) == "#1a2230"
    opened = "return [...document.querySelectorAll('details.part')].every((part) => part.open)"
    assert run(opened)
    run("dispatchEvent(new Event('afterprint'))")
    assert run(ink) == "#e7ecf3"


def test_the_arm_plays(browser: Browser, folder: Path) -> None:
    browser.look(write_pages(folder)[0])
    run = browser.driver.execute_script
    turned = "return document.querySelector('.link1').getAttribute('transform')"
    before = run(turned)
    run("document.querySelector('.player button').click()")
    browser.until("return Number(document.querySelector('.player input').value) > 0.02")
    assert run(turned) != before
    run("document.querySelector('.player button').click()")
    assert run("return document.querySelector('.player button').textContent") == "Play"
