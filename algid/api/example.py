"""Example logs: four simulated runs of an arm with a real log's faults, one with a payload.

Its angles are zero where it hangs straight down, and its log does not say so; its joints have dry
friction, and its sensors noise and steps. What it truly is stands in `ARM`, `FRICTION` and
`PAYLOAD`, and in none of the files.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from algid.arm import Arm, with_payload
from algid.base.files import refuse_existing, whole_file
from algid.log import Log, Truth
from algid.options import flag
from algid.synth.excitation import wide_multi_sine
from algid.synth.sensors import Sensors, record, sample_times
from algid.synth.simulator import HANGING, simulate
from algid.writers import write_log

ARM = Arm(
    m1=1.2, m2=0.8, lc1=0.15, lc2=0.12, l1=0.30, l2=0.25, I1=0.010, I2=0.006, b1=0.50, b2=0.40,
    g=9.81,
)  # fmt: skip
PAYLOAD = 0.5
"""kg, at the tip in ``loaded.csv``."""
FRICTION = (0.4, 0.2)
"""N m of dry friction, which the motors overcome beside what moves the arm."""
SENSORS = Sensors(torque_noise=0.02, encoder_bits=14)
STRENGTH = 0.3
"""Of the torque that swings an arm round and round."""
RATE, DURATION = 500.0, 10.0
LOGS = {"run1": 0.0, "run2": 0.0, "run3": 0.0, "run4": 0.0, "loaded": PAYLOAD}
PROFILE = "arm.toml"
PROFILE_TEXT = f"""\
# What the logs of this arm do not say; `inspect LOG {flag("write_profile")} FILE` writes all.
zero = "hanging"  # θ1 is zero hanging straight down, not along the horizontal
"""


def example_logs() -> list[Log]:
    """The runs ``run1`` to ``run4``, and ``loaded``."""
    logs = []
    for number, (name, payload) in enumerate(LOGS.items()):
        log = run(number, payload)
        logs.append(replace(log, origin=replace(log.origin, path=name)))
    return logs


def write_example(folder: str | Path, logs: Sequence[Log], force: bool = False) -> None:
    """Write the logs as CSV, and a profile ``arm.toml``, all or none.

    Raises
    ------
    OutputError
        If a file is there already and `force` is not set, or cannot be written.
    """
    folder = Path(folder)
    paths = [folder / f"{log.origin.path}.csv" for log in logs] + [folder / PROFILE]
    for path in paths:
        refuse_existing(path, force)
    for path, log in zip(paths, logs, strict=False):
        write_log(path, log, force=force)
    with whole_file(paths[-1], force=force) as temporary:
        temporary.write_text(PROFILE_TEXT, encoding="utf-8")


def run(number: int, payload: float) -> Log:
    """One run of the arm: its own motion, `payload` in kg at the tip, angles from hanging."""
    sensors = replace(SENSORS, seed=number)
    k = with_payload(ARM.constants(), ARM.payload_constants(payload))
    t = sample_times(RATE, DURATION, sensors)
    strong = wide_multi_sine(ARM, seed=number)
    motion = simulate(k, lambda at: STRENGTH * strong(at), t, HANGING, np.zeros(2))
    tau = motion.tau + np.array(FRICTION)[:, None] * np.sign(motion.omega)
    log = record(
        replace(motion, tau=tau), sensors, Truth(ARM, payload, "example"), f"run{number + 1}"
    )
    return replace(log, theta=log.theta - HANGING[:, None], origin=replace(log.origin, truth=None))
