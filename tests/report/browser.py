"""A headless Chromium that looks at a report and tells what it saw."""

from __future__ import annotations

import json
import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from selenium import webdriver
from selenium.webdriver.chrome.service import Service

DRIVER = shutil.which("chromedriver")
PATIENCE = 60.0  # s, for a busy machine

CONTRAST = """
const channel = (v) => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
const parse = (text) => (text.match(/[\\d.]+/g) || [0, 0, 0, 0]).map(Number);
const luminance = ([r, g, b]) => 0.2126 * channel(r) + 0.7152 * channel(g) + 0.0722 * channel(b);
const behind = (element) => {
  for (let at = element; at; at = at.parentElement) {
    const colour = parse(getComputedStyle(at).backgroundColor);
    if (colour.length === 3 || colour[3] > 0.5) return colour;
  }
  return parse(getComputedStyle(document.body).backgroundColor);
};
const poor = [];
for (const element of document.querySelectorAll("body *")) {
  const own = [...element.childNodes].some(
    (node) => node.nodeType === 3 && node.textContent.trim());
  const hidden = "script, style, noscript, .hoverlayer, .skip, .heatmaplayer";
  if (!own || element.closest(hidden)) continue;
  const style = getComputedStyle(element);
  if (style.visibility === "hidden" || style.display === "none") continue;
  if (!element.getClientRects().length) continue;
  const ink = parse(element instanceof SVGElement ? style.fill : style.color);
  const [a, b] = [luminance(ink), luminance(behind(element))].sort((x, y) => y - x);
  const ratio = (a + 0.05) / (b + 0.05);
  if (ratio < 4.5) poor.push([element.textContent.trim().slice(0, 40), ratio.toFixed(2)]);
}
return poor;
"""


@dataclass(frozen=True)
class Seen:
    """What the browser saw of a page."""

    drawn: int
    failed: int
    panels: int
    requests: list[str]
    console: list[str]
    title: str
    poor_contrast: list[Any]
    overflow: int
    background: str


class Browser:
    """One Chromium for many pages."""

    def __init__(self) -> None:
        options = webdriver.ChromeOptions()
        for flag in ("--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"):
            options.add_argument(flag)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
        self.driver = webdriver.Chrome(options=options, service=Service(DRIVER))

    def look(self, page: Path, width: int = 1400, dark: bool = False) -> Seen:
        """Open `page`, wait until its figures are drawn, and look."""
        self._set_screen(width, 1000, dark)
        self.driver.get("about:blank")
        self._log("performance")
        self._log("browser")
        self.driver.get(page.resolve().as_uri())
        self.until("return document.documentElement.dataset.drawn !== undefined")
        run = self.driver.execute_script
        return Seen(
            drawn=int(run("return document.documentElement.dataset.drawn || 0")),
            failed=int(run("return document.documentElement.dataset.failed || 0")),
            panels=run(
                "return [...document.querySelectorAll('.plot')].filter((p) => "
                "p.querySelector('.main-svg')).length"
            ),
            requests=self._requests(),
            console=[entry["message"] for entry in self._log("browser")],
            title=self.driver.title,
            poor_contrast=run(CONTRAST),
            overflow=run("return document.documentElement.scrollWidth") - width,
            background=run("return getComputedStyle(document.body).backgroundColor"),
        )

    def close(self) -> None:
        self.driver.quit()

    def _set_screen(self, width: int, height: int, dark: bool) -> None:
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})
        screen = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)

    def until(self, script: str, *arguments: object) -> None:
        """Wait until `script` returns true."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            if self.driver.execute_script(script, *arguments):
                return
            time.sleep(0.05)
        raise TimeoutError(f"not true within {PATIENCE} s: {script}")

    def _requests(self) -> list[str]:
        events = [json.loads(entry["message"])["message"] for entry in self._log("performance")]
        sent = [
            event["params"]["request"]["url"]
            for event in events
            if event["method"] == "Network.requestWillBeSent"
        ]
        return [url for url in sent if not url.startswith(("data:", "about:"))]

    def _log(self, kind: str) -> list[dict[str, Any]]:
        entries: list[dict[str, Any]] = self.driver.get_log(kind)  # type: ignore[no-untyped-call]
        return entries
