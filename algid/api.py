"""Short ways for notebooks to what the command line does."""

from __future__ import annotations

from algid.log import Log
from algid.synth import run
from algid.synth.cases import load_case
from algid.synth.sensors import Sensors


def synthesise(
    case: str,
    *,
    duration: float = 1.0,
    rate: float = 1000.0,
    excitation: str = "case",
    sensors: Sensors | None = None,
) -> tuple[Log, Log]:
    """The unloaded and the loaded log of a case, simulated.

    Parameters
    ----------
    case : str
        Name of a case that ships with algid, or path of a TOML file that describes an arm.
    duration, rate : float, s and Hz
    excitation : 'case', 'wide' or 'none'
    sensors : Sensors
        Noise, encoder, jitter and losses; none by default.

    Returns
    -------
    unloaded, loaded : Log
        Without and with the case's payload, each of them with its truth.

    Raises
    ------
    SettingError
        If there is no such case.
    ValueError
        If there is no such excitation.
    """
    described = load_case(case)
    recording = run.Recording(rate=rate, duration=duration, sensors=sensors or Sensors())
    return run.synthesise(described, run.excitation(described, excitation), recording)
