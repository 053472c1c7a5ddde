"""The arm that a page draws: to scale, in the posture of the log."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from algid.report.arm import ArmDrawing, arm_html, arm_of
from algid.report.gallery import gallery
from algid.results import Estimate, Result


def drawn(result: Result, folder: Path) -> str:
    """The drawing of the arm of that result, as it stands in the folder's torques."""
    arm = arm_of(result, gallery(folder, result).torque)
    assert arm is not None
    return arm_html(arm)


def links(drawing: str) -> tuple[float, float]:
    found = [
        float(x) for x in re.findall(r'class="link[^"]*" x1="0" y1="0" x2="([\d.]+)"', drawing)
    ]
    assert len(found) == 2
    return found[0], found[1]


def test_links_are_as_long_as_the_payload_tells_or_as_the_constants_do(
    result: Result, case_folder: Path
) -> None:
    torque = gallery(case_folder, result).torque
    known = {name: Estimate(estimate=value, unit="m") for name, value in (("l1", 0.3), ("l2", 0.2))}
    assert links(drawn(result.model_copy(update={"payload": known}), case_folder)) == (0.3, 0.2)
    k1, k2 = (Estimate(estimate=value, unit="") for value in (0.2, 9.81 * 0.2 / 0.25))
    bare = {
        "payload": {},
        "settings": {"gravity": 9.81},
        "parameters": {**result.parameters, "k1": k1, "k2": k2},
    }
    drawing = drawn(result.model_copy(update=bare), case_folder)
    assert links(drawing)[0] == pytest.approx(0.25)  # l1 = g k1 / k2
    assert "not known" in drawing
    upside_down = k2.model_copy(update={"estimate": -7.0})
    bare["parameters"] = {**result.parameters, "k1": k1, "k2": upside_down}
    assert arm_of(result.model_copy(update=bare), torque) is None
    assert arm_of(result, None) is None


def test_the_arm_stands_as_the_log_begins(result: Result, case_folder: Path) -> None:
    torque = gallery(case_folder, result).torque
    known = {name: Estimate(estimate=0.5, unit="m") for name in ("l1", "l2")}
    drawing = drawn(result.model_copy(update={"payload": known}), case_folder)
    turned = re.search(r'class="link1" transform="rotate\(([-\d.]+)\)"', drawing)
    assert turned is not None
    assert torque is not None
    first = torque.series[0]["theta1"][1]
    # SVG turns clockwise
    assert float(turned[1]) == pytest.approx(-np.degrees(first[np.isfinite(first)][0]), abs=1e-3)


def test_the_drawing_holds_the_arm_all_along_its_motion_and_its_limit_and_little_more() -> None:
    t = np.linspace(0.0, 4.0, 200)
    hanging = np.stack([-np.pi / 2 + 0.3 * np.sin(3 * t), 0.4 * np.cos(2 * t)])
    drawing = arm_html(ArmDrawing(0.3, 0.2, t, hanging, "Read it.", height=-0.6))
    box = re.search(r'viewBox="([-\d.e]+) ([-\d.e]+) ([-\d.e]+) ([-\d.e]+)"', drawing)
    assert box is not None
    left, top, width, height = map(float, box.groups())
    both = hanging[0] + hanging[1]
    x = 0.3 * np.cos(hanging[0]) + 0.2 * np.cos(both)
    y = -(0.3 * np.sin(hanging[0]) + 0.2 * np.sin(both))  # SVG's y points down
    assert left < x.min() < x.max() < left + width
    assert top < 0 < y.max() < 0.6 < top + height
    assert top > -0.1  # nothing but the margin above the base of an arm that hangs


def test_a_bent_arm_shows_where_its_loads_lie_and_stands_by_gravity(
    result: Result, case_folder: Path
) -> None:
    """K1 at 20°, K2 at 25°, K4 at 15°: θ1's zero is off by 5°, joint 1's load by 10°."""
    torque = gallery(case_folder, result).torque
    moments = {"k1": (0.2, 20.0), "k2": (7.0, 25.0), "k4": (20.0, 15.0)}
    parameters = dict(result.parameters)
    for name, (size, angle) in moments.items():
        K = size * np.exp(1j * np.radians(angle))
        parameters |= {
            name: Estimate(estimate=float(K.real), unit=""),
            f"{name}s": Estimate(estimate=float(K.imag), unit=""),
        }
    payload = {
        name: Estimate(estimate=value, unit="m")
        for name, value in (("l1", 0.5), ("l2", 0.4), ("y_p", 0.05))
    }
    payload["m_p"] = Estimate(estimate=1.0, unit="kg")
    bent = result.model_copy(update={"parameters": parameters, "payload": payload})
    drawing = drawn(bent, case_folder)
    assert [float(angle) for angle in re.findall(r"joint \d lies ([-\d.]+)° off", drawing)] == [
        10.0,
        20.0,
    ]
    assert 'class="payload" cx="0.4" cy="-0.05"' in drawing  # SVG's y points down
    turned = re.search(r'class="link1" transform="rotate\(([-\d.]+)\)"', drawing)
    assert turned is not None
    assert torque is not None
    first = torque.series[0]["theta1"][1]
    start = np.degrees(first[np.isfinite(first)][0])
    assert float(turned[1]) == pytest.approx(-start - 5, abs=1e-3)
    assert 'class="load"' not in drawn(result.model_copy(update={"payload": payload}), case_folder)
