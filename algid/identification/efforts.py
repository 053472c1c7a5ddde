"""The kind of effort that the logs show: a torque without gravity, or without any of the arm's.

Physics binds the constants together: with the link lengths l1 and lc2

    k2 = g k1 / l1,   k4 >= g k1 / lc2,   and of a payload   z4 = g z1 / l1

so that an arm whose inertia is known and that weighs nothing, unless both lengths are those of no
arm, is logged without its weight. If the payload's own weight is there, the arm does not move in a
horizontal plane.
"""

from __future__ import annotations

import numpy as np

from algid.base.names import within
from algid.base.significance import SURE
from algid.estimators.combine import of_kind
from algid.estimators.fit import Fit, alone
from algid.model import EVERY_TERM, K3, K4, K5, K6, K7, MOMENTS, SINE_OF, names_of, terms_named
from algid.notices import Notice, Remedy
from algid.physics.effort import FRICTION
from algid.settings import Settings

LONGEST, BOTH_LONG = 5.0, 2.0
"""m: no link is longer, and no two links are."""
NO_DAMPING = 0.02  # of critical damping: less than any joint's friction
NO_ARM = 0.1  # of the loaded arm's inertia: less than any unloaded arm's

Known = dict[str, tuple[float, float]]
"""Values and standard deviations by name."""


def of_effort(fit: Fit, settings: Settings) -> tuple[Settings, list[Notice]]:
    """The settings with the effort, or without gravity, that the logs of `fit` show.

    With it notices of what was not asked for.
    """
    shown, notices = settings, list[Notice]()
    if fit.shared.model.gravity > 0:
        if shown.effort is None and _arm_weightless(fit):
            shown = shown.but(effort="gravity-compensated")
        if shown.effort == "gravity-compensated" and _payload_weightless(fit):
            shown = shown.but(gravity=0.0)
            notices.append(Notice("GRAVITY_COMPENSATED", numbers={"case": "payload"}))
    if settings.effort is not None:
        return shown, notices
    if shown.effort is not None:
        case, remedies = (
            "arm alone",
            [Remedy({"effort": "gravity-compensated"}, "for such a driver")],
        )
        if not fit.shared.payload or shown.gravity == 0:
            case = "arm"
            remedies.append(Remedy({"gravity": 0}, "for a horizontal plane"))
        numbers = {"case": case}
        notices.append(Notice("GRAVITY_COMPENSATED", numbers=numbers, remedies=tuple(remedies)))
    elif _external(fit):
        notices.append(Notice("EXTERNAL_EFFORT", remedies=(Remedy({"effort": "external"}),)))
    elif _without_friction(fit):
        compensated = Remedy({"effort": "friction-compensated"}, "for such a driver")
        notices.append(Notice("FRICTION_COMPENSATED", remedies=(compensated,)))
    return shown, notices


def _arm_weightless(fit: Fit) -> bool:
    """Whether unloaded logs alone, or else the fit, show an arm with coupling but no weight."""
    known = _own(fit, False) or _of_fit(fit)
    (k1, of_k1), (k2, of_k2), (k4, of_k4) = (_size(known, name) for name in MOMENTS)
    least = fit.shared.model.gravity * k1 / fit.shared.lengths.get("l1", BOTH_LONG)
    return k1 > SURE * of_k1 and max(k2 + SURE * of_k2, k4 + SURE * of_k4) < least


def _payload_weightless(fit: Fit) -> bool:
    """Whether a payload's inertia about joint 1 is there, and not its weight."""
    unloaded, loaded = _own(fit, False), _own(fit, True)
    if not (unloaded and loaded):
        return False
    z1, of_z1 = _difference(loaded[K5], unloaded[K5])
    z4, of_z4 = _difference(loaded[K4], unloaded[K4])
    least = fit.shared.model.gravity * z1 / fit.shared.lengths.get("l1", LONGEST)
    return bool(z1 > SURE * of_z1 and abs(z4) + SURE * of_z4 < least)


def _difference(one: tuple[float, float], other: tuple[float, float]) -> tuple[float, float]:
    """The difference of two independent values, each with its standard deviation."""
    return one[0] - other[0], float(np.hypot(one[1], other[1]))


def _external(fit: Fit) -> bool:
    """Whether unloaded logs have nothing of an arm in their torque, and loaded ones do."""
    unloaded, loaded = _own(fit, False), _own(fit, True)
    if not (unloaded and loaded):
        return False
    for name in (K3, K5):
        value, std = unloaded[name]
        if abs(value) + SURE * std >= NO_ARM * loaded[name][0]:
            return False
    inertia, spread = loaded[K5]
    return inertia > SURE * spread


def _without_friction(fit: Fit) -> bool:
    dry = names_of(terms_named(within(FRICTION[1:], EVERY_TERM)))
    if fit.absent or (fit.shrinkage is None and set(dry) & set(fit.names)):
        return False
    known = _of_fit(fit)
    k3, k4, k5 = (_size(known, name)[0] for name in (K3, K4, K5))
    most = NO_DAMPING * float(np.sqrt((k3 + k5) * k4))
    for name in (K6, K7):
        value, std = _size(known, name)
        if value >= SURE * std or value + SURE * std >= most:
            return False
    return True


def _size(known: Known, name: str) -> tuple[float, float]:
    """Size of a constant, with its sine part where it has one, and its standard deviation.

    Both are 0 without a column.
    """
    value, std = known.get(name, (0.0, 0.0))
    across, _ = known.get(SINE_OF.get(name, ""), (0.0, 0.0))
    return float(np.hypot(value, across)), std


def _of_fit(fit: Fit) -> Known:
    """The fit's value of each parameter, with its standard deviation even where it is open."""
    spreads = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    pairs = zip(fit.values.tolist(), spreads.tolist(), strict=True)
    return dict(zip(fit.names, pairs, strict=True))


def _own(fit: Fit, loaded: bool) -> Known:
    """Each coefficient by the logs of one kind alone, with its standard deviation.

    Empty without such a log.
    """
    logs = of_kind(fit.logs, loaded)
    if not logs:
        return {}
    return _of_fit(alone(fit.shared, logs))
