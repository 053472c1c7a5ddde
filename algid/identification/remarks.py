"""Remarks on a fit: warnings that a reader has to know, and notes on what intervals leave out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from algid import results
from algid.base.significance import CERTAIN, sigmas
from algid.base.units import TORQUE
from algid.estimators.diagnostics import broken_bounds, length_by_constants, payload_distance
from algid.estimators.fit import Fit
from algid.estimators.robust import unshrunk
from algid.identification.phases import phase_note
from algid.identification.recordings import Recording
from algid.model import K4
from algid.notices import Notice, Remedy, has_code

STEEL, AIR = 8000.0, 1.2  # kg/m³
LEAST_SURE = 10.0  # standard deviations that a length has to have
FAR_APART = sigmas(CERTAIN)  # past which two logs are not of one arm


def exchanged(fit: Fit) -> bool:
    """Whether the unloaded arm carries more than the loaded one, and by far."""
    for broken in broken_bounds(fit):
        if broken.bound == "m_p >= 0" and broken.distance is not None:
            return broken.distance > FAR_APART
    return False


def torque_unit(logs: Sequence[Recording]) -> float | None:
    """N m of the one unit that all torques were read in.

    None where they differ, or an offset in N m or a PD law's gains do not follow the unit.
    """
    units = set()
    for log in logs:
        reading = log.origin.reading
        for joint in (1, 2):
            channel = reading.channels.get(f"tau{joint}")
            if joint == reading.passive:
                continue
            if channel is None:
                units.add("N m")
            elif channel.offset:
                return None
            else:
                units.add(channel.unit)
    if len(units) != 1:
        return None
    return TORQUE.get(units.pop())


def fit_warnings(fit: Fit, unit: float | None = None) -> Iterator[Notice]:
    """What a user should know about a fit, whose torques were read in a `unit` of so many N m."""
    yield from fit.notes
    yield from fit.unidentifiable
    if fit.shared.model.gravity == 0:
        needed = fit.shared.payload and not fit.shared.lengths
        yield Notice(
            "GRAVITY_COMPENSATED",
            numbers={"case": "stated"},
            remedies=(Remedy({"l1": None}, "a length tells its mass"),) if needed else (),
        )
    phases = phase_note(fit)
    if phases is not None:
        yield phases
    yield from _of_gains(fit)
    yield from _of_mass(fit, unit)
    if "m_p" in fit.names:
        yield from _of_payload(fit)
    given, by_constants = fit.shared.lengths.get("l1"), length_by_constants(fit)
    if (
        given is not None
        and by_constants is not None
        and abs(by_constants[0] - given) > FAR_APART * by_constants[1]
    ):
        length, std = by_constants
        yield Notice(
            "LENGTH_MISMATCH",
            numbers={"length": length, "half": fit.quantile * std, "given": given},
        )
    if exchanged(fit):
        yield Notice("LOGS_APART", numbers={"case": "exchanged"})
    apart = payload_distance(fit)
    if apart is not None and apart > FAR_APART:
        yield Notice("LOGS_APART", numbers={"case": "apart", "distance": apart})


def _of_mass(fit: Fit, unit: float | None) -> Iterator[Notice]:
    """Notice of an arm heavier than steel cubes of its links: m1 lc1 / l1 + m2 = k4 / (g l1).

    A smaller unit of torque scales every constant alike, so that the fit shows what it would give.
    """
    by_constants = length_by_constants(fit)
    if K4 not in fit.names or K4 in fit.absent or by_constants is None:
        return
    length, std = by_constants
    if not LEAST_SURE * std < length:
        return
    mass = abs(float(fit.values[fit.names.index(K4)])) / (fit.shared.model.gravity * length)
    if mass > STEEL * length**3:
        remedies: tuple[Remedy, ...] = ()
        if (
            unit is not None
            and fit.prior is None
            and fit.converged
            and not list(broken_bounds(fit))
        ):
            lighter = mass * TORQUE["mN m"] / unit
            if AIR * length**3 <= lighter <= STEEL * length**3:
                remedies = (Remedy({"torque_unit": "mN m"}, "where torques are in mN m"),)
        numbers = {"mass": mass, "length": length}
        yield Notice("OTHER_UNIT", numbers={"case": "heavy"} | numbers, remedies=remedies)


def _of_gains(fit: Fit) -> Iterator[Notice]:
    """That the gains of the two torques differ, where the logs show a difference.

    A prior hides the more of one the larger it is.
    """
    if "gain2" not in fit.names or has_code(fit.notes, "JOINTS_CONTRADICT"):
        return
    free = unshrunk(fit, "gain2")
    place = free.names.index("gain2")
    gain, half = float(free.values[place]), free.quantile * float(free.std[place])
    if abs(gain) > half:
        yield Notice("TORQUE_GAIN", numbers={"case": "joints", "ratio": 1 + gain, "half": half})


def _of_payload(fit: Fit) -> Iterator[Notice]:
    place = fit.names.index("m_p")
    low, high = fit.ci95[place].tolist()
    if np.isfinite(high) and low < 0 < high:
        yield Notice("NO_PAYLOAD", numbers={"most": high})
    elif np.isinf(high) and not fit.shared.lengths:
        yield Notice("LENGTHS_NEEDED")


def fit_notes(fit: results.FitSummary) -> Iterator[Notice]:
    """Notes on the torque's hold, intervals from blocks, the payload's repeatability, and gains."""
    if fit.torque_hold is not None:
        yield from _of_hold(fit.torque_hold)
    if fit.intervals == "sandwich":
        yield Notice("REPEATABILITY", numbers={"case": "unknown"})
    if fit.repeatability is not None:
        masses = ", ".join(f"{mass:.4g}" for mass in fit.repeatability.masses)
        low, high = fit.repeatability.ci95
        numbers = {"masses": masses, "std": fit.repeatability.std, "low": low, "high": high}
        yield Notice("REPEATABILITY", numbers={"case": "payload"} | numbers)
    gain = fit.torque_gain
    if gain is not None and (gain.estimate is None or gain.ci95 is None):
        yield Notice("TORQUE_GAIN", numbers={"case": "unknown"})
    elif gain is not None and gain.ci95 is not None:
        numbers = {"gain": gain.estimate, "low": gain.ci95[0], "high": gain.ci95[1]}
        gears = Remedy(
            {"tau1.torque_constant": None, "tau2.torque_constant": None}, "set them, or gear_ratio"
        )
        yield Notice("TORQUE_GAIN", numbers={"case": "known"} | numbers, remedies=(gears,))


def _of_hold(hold: results.TorqueHold) -> Iterator[Notice]:
    """That logs show a held torque, or leave it open."""
    if hold.told is None or hold.half is None:
        return
    if hold.faster:
        known = Remedy({"delay": None}, "half of the controller's period, in s")
        even = Remedy({"torque_hold": "foh"}, "for a torque that is not held")
        yield Notice("TORQUE_HOLD", numbers={"case": "fast controller"}, remedies=(known, even))
    elif not hold.told:
        held = Remedy({"torque_hold": "zoh"}, "for a digital controller that logs what it sets")
        yield Notice(
            "TORQUE_HOLD", numbers={"case": "unknown", "half": 1e3 * hold.half}, remedies=(held,)
        )
    elif hold.used == "zoh":
        yield Notice("TORQUE_HOLD", numbers={"case": "held", "late": 1e3 * hold.half})
