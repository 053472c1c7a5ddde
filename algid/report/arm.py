"""The arm itself: a drawing to scale, and a player that moves it through a log or a plan.

The drawing is inline SVG and stands without JavaScript at the motion's start; ``assets/arm.js``
moves it. While it plays, the document hears an event ``arm-time`` whose detail is the time in s.
"""

from __future__ import annotations

import cmath
from dataclasses import dataclass

import numpy as np

from algid.arm import FloatArray
from algid.model import SINES, length_by_coupling, moments_of
from algid.options import flag
from algid.report.series import TorqueLog
from algid.report.text import escaped, script_json
from algid.results import Result
from algid.text import significant

FRAMES = 30.0  # a second
MOST_FRAMES = 6_000
MARGIN = 0.12  # of the reach, around the drawing
DIGITS = 4
LOAD = 0.7  # of a link: how long the line is drawn that points to its load
READING = (
    "Play it: does this arm move as yours did? Hanging must look like hanging, and the links must "
    "turn the right way; "
    "the line in the torques shows the moment."
)


@dataclass(frozen=True, eq=False)
class ArmDrawing:
    """An arm and its motion.

    Parameters
    ----------
    l1, l2 : float, m
    t : (N,), s, increasing
    theta : (2, N), rad, θ1 from the horizontal, θ2 from link 1
    reading : str
        One line that tells what to look at.
    payload : str
        What hangs at the tip, in words; empty where nothing does.
    height : float, m, or None
        Below which the tip may not come.
    loads : two angles, rad, or None
        How far off its line each link's load lies, seen from its joint; nothing of straight links.
    aside : float, m
        How far beside link 2's line the payload's centre of mass lies.
    """

    l1: float
    l2: float
    t: FloatArray
    theta: FloatArray
    reading: str
    payload: str = ""
    height: float | None = None
    loads: tuple[float, float] | None = None
    aside: float = 0.0
    key = "arm"
    title = "The arm"


def arm_of(result: Result, torque: TorqueLog | None) -> ArmDrawing | None:
    """The arm of a result, to scale as far as its lengths are known, moved through the first log.

    None where l1 follows from nothing, or no motion is at hand.
    """
    l1, l2 = _length(result, "l1"), _length(result, "l2")
    if l1 is None:
        l1 = _coupling_length(result)
    if l1 is None or torque is None:
        return None
    motion = _motion(torque)
    if motion is None:
        return None
    t, theta = motion
    reading = f"{READING} l1 is {significant(l1, 3)} m."
    if l2 is None:
        reading += (
            f" Link 2's length is not known: it is drawn as long as link 1 (give {flag('l2')})."
        )
    turn, loads = _phases(result)
    if loads is not None:
        reading += " Dashed: where each joint's load lies, by gravity and inertia."
    payload, aside = "", 0.0
    if "m_p" in result.payload:
        mass = result.payload["m_p"].estimate
        if mass is not None:
            payload = f"payload of {significant(mass, 3)} kg"
    if "y_p" in result.payload:
        aside = result.payload["y_p"].estimate or 0.0
    return ArmDrawing(
        l1,
        l2 or l1,
        t,
        theta + np.array([[turn], [0.0]]),
        reading,
        payload,
        loads=loads,
        aside=aside,
    )


def _phases(result: Result) -> tuple[float, tuple[float, float] | None]:
    """θ1's zero against gravity, and how far the joints' loads are off the links' lines, in rad.

    Without gravity only that of joint 2 is known.
    """
    value = _values(result)
    if not set(value) & set(SINES):
        return 0.0, None
    first, second, fourth = moments_of(value)
    turn = load = 0.0
    if first and second:
        turn = cmath.phase(second / first)
    if fourth:
        load = cmath.phase(fourth * cmath.exp(-1j * turn))
    return turn, (load, cmath.phase(first))


def _values(result: Result) -> dict[str, float]:
    """By constant its estimate; zero where there is none."""
    return {name: one.estimate or 0.0 for name, one in result.parameters.items()}


def _length(result: Result, name: str) -> float | None:
    """A link's length in m: estimated with the payload, or given."""
    value = result.settings.get(name)
    if name in result.payload:
        value = result.payload[name].estimate
    if not isinstance(value, int | float) or value <= 0:
        return None
    return float(value)


def _coupling_length(result: Result) -> float | None:
    """l1 = g |K1| / |K2| (Table 1), in m.

    None where gravity does not act or the constants are no arm's.
    """
    value = _values(result)
    gravity = result.settings.get("gravity")
    if not isinstance(gravity, int | float):
        return None
    l1 = length_by_coupling(value, gravity)
    if l1 is None or l1 <= 0:
        return None
    return l1


def _motion(torque: TorqueLog) -> tuple[FloatArray, FloatArray] | None:
    """Times (n,) and angles (2, n) of the first log, out of its reduced series."""
    if not torque.series:
        return None
    series = torque.series[min(torque.series)]
    kept = []
    for name in ("theta1", "theta2"):
        x, y = series.get(name, (np.empty(0), np.empty(0)))
        finite = np.isfinite(y)
        if np.count_nonzero(finite) < 2:
            return None
        kept.append((x[finite], y[finite]))
    t = np.union1d(kept[0][0], kept[1][0])
    return t, np.stack([np.interp(t, x, y) for x, y in kept])


def arm_html(arm: ArmDrawing) -> str:
    """The drawing, its player and its frames, as a figure of the page."""
    t, theta = _frames(arm)
    elbow = arm.l1 * np.stack([np.cos(theta[0]), np.sin(theta[0])])
    both = theta[0] + theta[1]
    tip = elbow + arm.l2 * np.stack([np.cos(both), np.sin(both)])
    left, top, width, height = _frame(arm, elbow, tip)
    says = f"Arm of {significant(arm.l1, 3)} m and {significant(arm.l2, 3)} m links"
    frames = {
        "t": np.round(t, DIGITS).tolist(),
        "theta1": np.round(theta[0], DIGITS).tolist(),
        "theta2": np.round(theta[1], DIGITS).tolist(),
    }
    levels = {"level": 0.0}
    if arm.height is not None and np.isfinite(arm.height):
        levels["limit"] = -arm.height
    ground, right = "", left + width
    for kind, y in levels.items():
        ground += (
            f'<line class="{kind}" x1="{left:.5g}" y1="{y:.5g}" x2="{right:.5g}" y2="{y:.5g}"/>'
        )
    path = " ".join(f"{x:.4g},{-y:.4g}" for x, y in tip.T)
    return (
        f'<figure class="arm" id="{arm.key}-figure" aria-labelledby="{arm.key}"><h2 '
        f'id="{arm.key}">{arm.title}</h2>\n'
        f'<svg viewBox="{left:.5g} {top:.5g} {width:.5g} {height:.5g}" role="img" '
        f'aria-label="{escaped(says)}">\n{ground}<polyline class="path" points="{path}"/>\n'
        f"{_links(arm, -np.degrees(theta[0, 0]), -np.degrees(theta[1, 0]))}</svg>\n"
        f'<div class="player"><button type="button" aria-pressed="false" data-play>Play</button>'
        f'<input type="range" min="{t[0]:.6g}" max="{t[-1]:.6g}" value="{t[0]:.6g}" step="0.01" '
        f'aria-label="Time, s"><output>{t[0]:.2f} s</output>'
        '<label>speed <select><option value="0.25">¼</option><option value="1" selected>1</option>'
        '<option value="4">4</option></select></label></div>\n'
        f'<script type="application/json">{script_json(frames)}</script>\n'
        f'<figcaption><p class="reading">{escaped(arm.reading)}</p></figcaption></figure>\n'
    )


def _frames(arm: ArmDrawing) -> tuple[FloatArray, FloatArray]:
    """Times and angles at `FRAMES` a second, fewer of a long motion."""
    duration = float(arm.t[-1] - arm.t[0])
    count = int(min(max(round(duration * FRAMES), 1), MOST_FRAMES, max(arm.t.size - 1, 1))) + 1
    t = np.linspace(arm.t[0], arm.t[-1], count)
    return t, np.stack([np.interp(t, arm.t, row) for row in arm.theta])


def _frame(
    arm: ArmDrawing, elbow: FloatArray, tip: FloatArray
) -> tuple[float, float, float, float]:
    """Left, top, width and height that hold the arm all along its motion.

    At least as wide as the arm is long.
    """
    reach = arm.l1 + arm.l2
    points = np.concatenate([np.zeros((2, 1)), elbow, tip], axis=1)
    if arm.height is not None and np.isfinite(arm.height):
        points = np.concatenate([points, [[0.0], [arm.height]]], axis=1)
    low, high = points.min(axis=1) - MARGIN * reach, points.max(axis=1) + MARGIN * reach
    left, right = min(float(low[0]), -reach / 2), max(float(high[0]), reach / 2)
    return left, float(-high[1]), right - left, float(high[1] - low[1])


def _links(arm: ArmDrawing, first: float, second: float) -> str:
    """Link 2 stands in link 1's frame, both turned by SVG, in degrees, whose y points down."""
    radius = 0.028 * (arm.l1 + arm.l2)
    payload = ""
    if arm.payload:
        payload = (
            f'<circle class="payload" cx="{arm.l2:.5g}" cy="{-arm.aside:.5g}" '
            f'r="{1.6 * radius:.4g}"><title>{escaped(arm.payload)}</title>'
            "</circle>"
        )
    return (
        f'<g class="link1" transform="rotate({first:.4f})"><line class="link" x1="0" y1="0" '
        f'x2="{arm.l1:.5g}" y2="0"/>{_load(arm, 0)}'
        f'<g class="link2" transform="translate({arm.l1:.5g} 0) rotate({second:.4f})" '
        f'data-at="{arm.l1:.5g}"><line class="link second" x1="0" y1="0" x2="{arm.l2:.5g}" '
        f'y2="0"/>{_load(arm, 1)}{payload}'
        f'<circle class="joint" cx="0" cy="0" r="{radius:.4g}"/></g></g>'
        f'<circle class="joint" cx="0" cy="0" r="{1.2 * radius:.4g}"/>\n'
    )


def _load(arm: ArmDrawing, joint: int) -> str:
    """The direction of a joint's load in its link's frame, dashed; nothing of straight links."""
    if arm.loads is None:
        return ""
    angle, length = arm.loads[joint], LOAD * (arm.l1, arm.l2)[joint]
    degrees = significant(float(np.degrees(angle)), 3)
    says = f"the load of joint {joint + 1} lies {degrees}° off its line"
    return (
        f'<line class="load" x1="0" y1="0" x2="{length * np.cos(angle):.5g}" '
        f'y2="{-length * np.sin(angle):.5g}"><title>{escaped(says)}</title></line>'
    )
