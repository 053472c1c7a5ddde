"""The kind of effort that the logs show: a torque without gravity, or without any of the arm's.

Physics binds the constants together: with the link lengths l1 and lc2

    k2 = g k1 / l1,   k4 >= g k1 / lc2,   and of a payload   z4 = g z1 / l1

so that an arm whose inertia is known and that weighs nothing, unless both lengths are those of no
arm, is logged without its weight. That the payload's own weight is there tells that the arm does
not move in a horizontal plane.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from algid.estimators.diagnostics import by_themselves
from algid.estimators.fit import Fit
from algid.model import EVERY_TERM, K3, K4, K5, K6, K7, MOMENTS, SINES
from algid.notices import Notice, Remedy
from algid.physics.effort import FRICTION
from algid.settings import Settings
from algid.significance import SURE

LONGEST, BOTH_LONG = 5.0, 2.0
"""m: no link is longer, and no two links are."""
NO_DAMPING = 0.02  # of critical damping: less than any joint's friction
NO_ARM = 0.1  # of the loaded arm's inertia: less than any unloaded arm's

Known = dict[str, tuple[float, float]]
"""Values and standard deviations by name."""


def with_effort(fit: Fit, settings: Settings) -> Settings:
    """The settings with the effort, or without gravity, that the logs tell.

    The same where they do not.
    """
    if fit.shared.model.gravity == 0:
        return settings
    if settings.effort is None and _arm_weightless(fit):
        settings = replace(settings, effort="gravity-compensated")
    if settings.effort == "gravity-compensated" and _payload_weightless(fit):
        settings = replace(settings, gravity=0.0)
    return settings


def of_effort(fit: Fit, found: Settings, asked: Settings) -> list[Notice]:
    """Notices of the effort that the logs of `fit` show, `found`, where none was `asked` for."""
    said = []
    if found.gravity != asked.gravity:
        said.append(Notice("PAYLOAD_WEIGHTLESS", note=True))
    if asked.effort is not None:
        return said
    flag = Remedy({"effort": "gravity-compensated"}, "for such a driver")
    if found.effort is not None and fit.shared.payload and found.gravity > 0:
        said.append(Notice("WEIGHT_OF_PAYLOAD", remedies=(flag,), note=True))
    elif found.effort is not None:
        level = Remedy({"gravity": 0}, "for a horizontal plane")
        said.append(Notice("GRAVITY_COMPENSATED", remedies=(flag, level)))
    elif _external(fit):
        said.append(Notice("EXTERNAL_EFFORT", remedies=(Remedy({"effort": "external"}),)))
    elif _without_friction(fit):
        compensated = Remedy({"effort": "friction-compensated"}, "for such a driver")
        said.append(Notice("NO_FRICTION", remedies=(compensated,), note=True))
    return said


def _arm_weightless(fit: Fit) -> bool:
    """Whether unloaded logs alone, or else the fit, show an arm with coupling but no weight."""
    known = _own(fit, False) or _of_fit(fit)
    (k1, of_k1), *weights = (_size(known, name) for name in MOMENTS)
    least = fit.shared.model.gravity * k1 / fit.shared.lengths.get("l1", BOTH_LONG)
    return k1 > SURE * of_k1 and all(value + SURE * std < least for value, std in weights)


def _payload_weightless(fit: Fit) -> bool:
    """Whether a payload's inertia about joint 1 is there, and not its weight."""
    unloaded, loaded = _own(fit, False), _own(fit, True)
    if not (unloaded and loaded):
        return False
    (z1, of_z1), (z4, of_z4) = (
        (loaded[name][0] - unloaded[name][0], np.hypot(loaded[name][1], unloaded[name][1]))
        for name in (K5, K4)
    )
    least = fit.shared.model.gravity * z1 / fit.shared.lengths.get("l1", LONGEST)
    return bool(z1 > SURE * of_z1 and abs(z4) + SURE * of_z4 < least)


def _external(fit: Fit) -> bool:
    """Whether unloaded logs have nothing of an arm in their torque, and loaded ones do."""
    unloaded, loaded = _own(fit, False), _own(fit, True)
    if not (unloaded and loaded):
        return False
    inertia, spread = loaded[K5]
    nothing = (
        abs(unloaded[name][0]) + SURE * unloaded[name][1] < NO_ARM * loaded[name][0]
        for name in (K3, K5)
    )
    return inertia > SURE * spread and all(nothing)


def _without_friction(fit: Fit) -> bool:
    dry = [term for name, term in EVERY_TERM.items() if name in FRICTION[1:]]
    terms = {name for term in dry for name in term.names}
    if fit.absent or (fit.shrinkage is None and terms & set(fit.names)):
        return False
    known = _of_fit(fit)
    k3, k4, k5 = (_size(known, name)[0] for name in (K3, K4, K5))
    most = NO_DAMPING * float(np.sqrt((k3 + k5) * k4))
    damping = [_size(known, name) for name in (K6, K7)]
    return all(value < SURE * std and value + SURE * std < most for value, std in damping)


def _size(known: Known, name: str) -> tuple[float, float]:
    """Size of a constant, with its sine part where it has one, and its standard deviation.

    Both are 0 without a column.
    """
    value, std = known.get(name, (0.0, 0.0))
    sine = next((own for own, of in SINES.items() if of == name and own in known), None)
    return float(np.hypot(value, known[sine][0])) if sine else abs(value), std


def _of_fit(fit: Fit) -> Known:
    """What the fit says of each parameter, with its standard deviation even where it is open."""
    spreads = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    pairs = zip(fit.values.tolist(), spreads.tolist(), strict=True)
    return dict(zip(fit.names, pairs, strict=True))


def _own(fit: Fit, loaded: bool) -> Known:
    """What the logs of one kind say of each coefficient, with its standard deviation.

    Nothing without any.
    """
    logs = [log for log in fit.logs if log.loaded is loaded]
    if not logs:
        return {}
    values, covariance, _ = by_themselves(fit.shared, logs)
    spreads = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    pairs = zip(values.tolist(), spreads.tolist(), strict=True)
    return dict(zip(fit.shared.log_names, pairs, strict=True))
