"""The arm itself: a drawing to scale, and a player that moves it through a log or a plan.

The drawing is inline SVG and stands without JavaScript at the motion's start; ``assets/arm.js`` moves it. While it
plays, the document hears an event ``arm-time`` whose detail is the time in s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources

import numpy as np

from algid.arm import FloatArray
from algid.report.html import escaped, script_json
from algid.report.text import significant

FRAMES = 30.0  # a second
MOST_FRAMES = 6_000
MARGIN = 0.12  # of the reach, around the drawing
DIGITS = 4


@dataclass(frozen=True, eq=False)
class ArmDrawing:
    """An arm and its motion.

    Parameters
    ----------
    key : str
        The drawing's name on the page.
    l1, l2 : float, m
    t : (N,), s, increasing
    theta : (2, N), rad, θ1 from the horizontal, θ2 from link 1
    centres : two of float or None, m
        From each joint to its link's centre of mass, where known.
    payload : str
        What hangs at the tip, in words; empty where nothing does.
    height : float, m, or None
        Below which the tip may not come.
    """

    key: str
    l1: float
    l2: float
    t: FloatArray
    theta: FloatArray
    centres: Sequence[float | None] = (None, None)
    payload: str = ""
    height: float | None = None


def arm_html(arm: ArmDrawing, title: str, reading: str) -> str:
    """The drawing, its player and its frames, as a figure of the page."""
    t, theta = _frames(arm)
    tip = _tip(arm, theta)
    reach = arm.l1 + arm.l2
    left, top, width, height = _frame(arm, theta, tip)
    says = f"Arm of {significant(arm.l1, 3)} m and {significant(arm.l2, 3)} m links"
    frames = {
        "t": np.round(t, DIGITS).tolist(),
        "theta1": np.round(theta[0], DIGITS).tolist(),
        "theta2": np.round(theta[1], DIGITS).tolist(),
    }
    name = escaped(arm.key)
    return (
        f'<figure class="arm" id="{name}-figure" aria-labelledby="{name}"><h2 id="{name}">{escaped(title)}</h2>\n'
        f'<svg viewBox="{left:.5g} {top:.5g} {width:.5g} {height:.5g}" role="img" '
        f'aria-label="{escaped(says)}">\n'
        f"{_ground(arm, left, left + width)}{_path(tip)}{_links(arm, theta[:, 0], reach)}</svg>\n"
        f'<div class="player"><button type="button" aria-pressed="false" data-play>Play</button>'
        f'<input type="range" min="{t[0]:.6g}" max="{t[-1]:.6g}" value="{t[0]:.6g}" step="0.01" '
        f'aria-label="Time, s"><output>{t[0]:.2f} s</output>'
        '<label>speed <select><option value="0.25">¼</option><option value="1" selected>1</option>'
        '<option value="4">4</option></select></label></div>\n'
        f'<script type="application/json">{script_json(frames)}</script>\n'
        f'<figcaption><p class="reading">{escaped(reading)}</p></figcaption></figure>\n'
    )


def arm_script() -> str:
    """The player's script; a page takes it once, beside any number of drawings."""
    return (resources.files("algid.report") / "assets" / "arm.js").read_text(encoding="utf-8")


def _frames(arm: ArmDrawing) -> tuple[FloatArray, FloatArray]:
    """Times and angles at `FRAMES` a second, fewer of a long motion."""
    duration = float(arm.t[-1] - arm.t[0])
    count = int(min(max(round(duration * FRAMES), 1), MOST_FRAMES, max(arm.t.size - 1, 1))) + 1
    t = np.linspace(arm.t[0], arm.t[-1], count)
    return t, np.stack([np.interp(t, arm.t, row) for row in arm.theta])


def _tip(arm: ArmDrawing, theta: FloatArray) -> FloatArray:
    both = theta[0] + theta[1]
    return np.stack(
        [arm.l1 * np.cos(theta[0]) + arm.l2 * np.cos(both), arm.l1 * np.sin(theta[0]) + arm.l2 * np.sin(both)]
    )


def _frame(arm: ArmDrawing, theta: FloatArray, tip: FloatArray) -> tuple[float, float, float, float]:
    """Left, top, width and height that hold the arm all along its motion; at least as wide as the arm is long."""
    reach = arm.l1 + arm.l2
    points = np.concatenate([np.zeros((2, 1)), arm.l1 * np.stack([np.cos(theta[0]), np.sin(theta[0])]), tip], axis=1)
    if arm.height is not None and np.isfinite(arm.height):
        points = np.concatenate([points, [[0.0], [arm.height]]], axis=1)
    low, high = points.min(axis=1) - MARGIN * reach, points.max(axis=1) + MARGIN * reach
    left, right = min(float(low[0]), -reach / 2), max(float(high[0]), reach / 2)
    return left, float(-high[1]), right - left, float(high[1] - low[1])


def _ground(arm: ArmDrawing, left: float, right: float) -> str:
    lines = f'<line class="level" x1="{left:.5g}" y1="0" x2="{right:.5g}" y2="0"/>'
    if arm.height is not None and np.isfinite(arm.height):
        below = -arm.height
        lines += f'<line class="limit" x1="{left:.5g}" y1="{below:.5g}" x2="{right:.5g}" y2="{below:.5g}"/>'
    return lines


def _path(tip: FloatArray) -> str:
    points = " ".join(f"{x:.4g},{-y:.4g}" for x, y in tip.T)
    return f'<polyline class="path" points="{points}"/>\n'


def _links(arm: ArmDrawing, theta: FloatArray, reach: float) -> str:
    """Link 2 stands in link 1's frame, both turned by SVG, whose y points down."""
    first, second = (-np.degrees(angle) for angle in theta)
    radius = 0.028 * reach
    payload = (
        f'<circle class="payload" cx="{arm.l2:.5g}" cy="0" r="{1.6 * radius:.4g}"><title>{escaped(arm.payload)}</title>'
        "</circle>"
        if arm.payload
        else ""
    )
    marks = [
        "" if centre is None else f'<circle class="centre" cx="{centre:.5g}" cy="0" r="{0.6 * radius:.4g}"/>'
        for centre in arm.centres
    ]
    return (
        f'<g class="link1" transform="rotate({first:.4f})"><line class="link" x1="0" y1="0" x2="{arm.l1:.5g}" y2="0"/>'
        f'{marks[0]}<g class="link2" transform="translate({arm.l1:.5g} 0) rotate({second:.4f})" '
        f'data-at="{arm.l1:.5g}"><line class="link second" x1="0" y1="0" x2="{arm.l2:.5g}" y2="0"/>{marks[1]}{payload}'
        f'<circle class="joint" cx="0" cy="0" r="{radius:.4g}"/></g></g>'
        f'<circle class="joint" cx="0" cy="0" r="{1.2 * radius:.4g}"/>\n'
    )
