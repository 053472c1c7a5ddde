"""Example logs: four simulated runs of an arm with a real log's faults, one with a payload.

Its angles are zero where it hangs straight down, and its log does not say so; its joints have dry
friction, and its sensors noise and steps. What it truly is stands in `ARM`, `FRICTION` and
`PAYLOAD`, and in none of the files.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from algid.arm import Arm, FloatArray, with_payload
from algid.log import Log, Truth
from algid.options import flag
from algid.synth.excitation import Torque, wide_multi_sine
from algid.synth.sensors import Sensors, record, sample_times
from algid.synth.simulator import HANGING, simulate

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
    """The runs ``run1`` to ``run4``, and ``loaded``: each its own motion, angles from hanging."""
    logs = []
    for seed, (name, payload) in enumerate(LOGS.items()):
        sensors = replace(SENSORS, seed=seed)
        k = with_payload(ARM.constants(), ARM.payload_constants(payload))
        strong = wide_multi_sine(ARM, seed=seed)

        def drive(at: FloatArray, strong: Torque = strong) -> FloatArray:
            return STRENGTH * strong(at)

        motion = simulate(k, drive, sample_times(RATE, DURATION, sensors), HANGING, np.zeros(2))
        tau = motion.tau + np.array(FRICTION)[:, None] * np.sign(motion.omega)
        log = record(replace(motion, tau=tau), sensors, Truth(ARM, payload, "example"), name)
        origin = replace(log.origin, truth=None)
        logs.append(replace(log, theta=log.theta - HANGING[:, None], origin=origin))
    return logs
