"""Reports as a browser shows them: drawn whole, offline, safe, legible."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from algid.report.page import write_report
from algid.results import Estimate, Result, Status, write_result
from tests.report.browser import DRIVER, Browser, Seen
from tests.report.folders import build_recorded, hostile

RUN = Path(__file__).parents[3] / "shared/data/dfki/C1_sysid/20230629-143601.csv"

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


@pytest.fixture
def folder(case_folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(case_folder, tmp_path / "case1.algid"))


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
    page = write_report(folder)
    seen = browser.look(page, width, dark)
    assert_sound(seen, page, "case1-unloaded.mcap · algid")
    assert seen.drawn == 39
    written = browser.driver.execute_script(
        "return document.getElementById('correlation-0').data[0].texttemplate"
    )
    assert (written is None) == (width == 400)  # where the cells have no room for numbers
    assert seen.background == ("rgb(16, 21, 28)" if dark else "rgb(255, 255, 255)")


def test_a_parameter_that_cannot_be_identified_and_the_library_beside(
    browser: Browser, folder: Path, result: Result
) -> None:
    lost = Estimate(estimate=None, ci95=(None, None), unit="kg m^2", status=Status.NOT_IDENTIFIABLE)
    assert result.fit is not None
    covariance = [
        [None if 4 in (i, j) else value for j, value in enumerate(row)]
        for i, row in enumerate(result.fit.covariance)
    ]
    fit = result.fit.model_copy(
        update={"covariance": covariance, "unidentifiable": ["k3 and k5 only as a sum"]}
    )
    changed = result.model_copy(
        update={"parameters": {**result.parameters, "k5": lost}, "fit": fit}
    )
    write_result(changed, folder / "result.json")
    page = write_report(folder, shared_library=True)
    seen = browser.look(page)
    library = (folder.parent / "plotly.min.js").resolve().as_uri()
    assert seen.requests == [page.resolve().as_uri(), library]
    assert_sound(replace(seen, requests=seen.requests[:1]), page, "case1-unloaded.mcap · algid")


def test_a_log_whose_names_attack(browser: Browser, folder: Path, result: Result) -> None:
    write_result(hostile(result), folder / "result.json")
    page = write_report(folder)
    seen = browser.look(page, 400)
    assert_sound(seen, page, seen.title)
    # the path's last part, shown; what it would run sets another title
    assert seen.title.startswith("script>")


@pytest.mark.skipif(not RUN.exists(), reason="../shared/data is not here")
def test_a_real_log(browser: Browser, tmp_path: Path) -> None:
    folder = tmp_path / "run.algid"
    build_recorded(folder, RUN)
    page = write_report(folder)
    assert_sound(browser.look(page), page, f"{RUN.name} · algid")


def test_figures_follow_legend_theme_keys_and_paper(browser: Browser, folder: Path) -> None:
    browser.look(write_report(folder))
    run = browser.driver.execute_script
    shown = (
        "return document.getElementById('torque-0').data.map((trace) => trace.visible !== false)"
    )
    ink = "return document.getElementById('torque-0')._fullLayout.font.color"
    assert run(shown) == [True, True, True]
    run("document.querySelector('button[data-figure=torque][data-group=measured]').click()")
    assert run(shown) == [False, True, True]

    press = (
        "document.getElementById('torque-0').dispatchEvent(new KeyboardEvent('keydown', {key: "
        "arguments[0]}))"
    )
    ranges = (
        "return ['torque-0', 'torque-1'].map((id) => "
        "[...document.getElementById(id)._fullLayout.xaxis.range])"
    )
    whole = run(ranges)[0]
    run(press, "+")
    browser.until(
        "return document.getElementById('torque-1')._fullLayout.xaxis.range[0] > arguments[0]",
        whole[0],
    )
    one, two = run(ranges)
    assert one == two
    assert whole[0] < one[0] < one[1] < whole[1]
    run(press, "0")
    assert run(ranges)[0] == pytest.approx(whole)

    assert run(ink) == "#1a2230"
    dark = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", dark)
    browser.until(f"{ink} === '#e7ecf3'")
    assert run(shown) == [False, True, True]

    run("dispatchEvent(new Event('beforeprint'))")
    assert run("return document.getElementById('torque-0')._fullLayout.width") == 690
    assert run(ink) == "#1a2230"
    run("dispatchEvent(new Event('afterprint'))")
    assert run(ink) == "#e7ecf3"
