"""The arm of a result, drawn to scale as far as its lengths are known, and moved through the first log."""

from __future__ import annotations

import numpy as np

from algid.arm import FloatArray
from algid.report.arm import ArmDrawing, arm_html
from algid.report.series import TorqueLog
from algid.report.text import significant
from algid.results import Result

READING = (
    "Play it: does this arm move as yours did? Hanging must look like hanging, and the links must turn the right way; "
    "the line in the torques shows the moment."
)


def arm_of(result: Result, torque: TorqueLog | None) -> str:
    """The drawing of the arm; nothing where l1 follows from nothing, or no motion is at hand."""
    l1, l2 = _length(result, "l1"), _length(result, "l2")
    if l1 is None:
        l1 = _coupling_length(result)
    motion = None if torque is None else _motion(torque)
    if l1 is None or motion is None:
        return ""
    t, theta = motion
    drawing = ArmDrawing("arm", l1, l1 if l2 is None else l2, t, theta, payload=_payload(result))
    unknown = "" if l2 is not None else " Link 2's length is not known: it is drawn as long as link 1 (give --l2)."
    return arm_html(drawing, "The arm", f"{READING} l1 is {significant(l1, 3)} m.{unknown}")


def _length(result: Result, name: str) -> float | None:
    """A link's length in m: estimated with the payload, or given."""
    found = result.payload.get(name)
    value = found.estimate if found is not None else result.settings.get(name)
    return float(value) if isinstance(value, int | float) and value > 0 else None


def _coupling_length(result: Result) -> float | None:
    """l1 = g k1 / k2 (Table 1), in m; None where gravity does not act or the constants are no arm's."""
    k1, k2 = (result.parameters[name].estimate if name in result.parameters else None for name in ("k1", "k2"))
    gravity = result.settings.get("gravity")
    if not k1 or not k2 or not isinstance(gravity, int | float):
        return None
    length = gravity * k1 / k2
    return length if length > 0 else None


def _payload(result: Result) -> str:
    mass = result.payload["m_p"].estimate if "m_p" in result.payload else None
    return "" if mass is None else f"payload of {significant(mass, 3)} kg"


def _motion(torque: TorqueLog) -> tuple[FloatArray, FloatArray] | None:
    """Times (n,) and angles (2, n) of the first log, out of its reduced series."""
    series = torque.series[min(torque.series)] if torque.series else {}
    both = [series[name] for name in ("theta1", "theta2") if name in series]
    kept = [(x[np.isfinite(y)], y[np.isfinite(y)]) for x, y in both]
    if len(kept) < 2 or any(x.size < 2 for x, _ in kept):
        return None
    t = np.union1d(kept[0][0], kept[1][0])
    return t, np.stack([np.interp(t, x, y) for x, y in kept])
