"""Logs without noise of another simulator: `python -m pipelines.noiseless`.

MuJoCo's integrators move random arms, by a PD controller and in open loop, at three pairs of its
own step and of the log's. Every log is
identified with no flag. A row gives how many were identified (the verdict is not failed), how many
of their intervals hold the truth, the largest error of a constant, and the median of the standard
deviations, both relative. Writes `noiseless.md` into the output folder.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from importlib import import_module
from itertools import product
from typing import Any

import numpy as np

import algid
from algid.arm import CONSTANT_NAMES, Arm, FloatArray
from pipelines.experiment import experiment

INTEGRATORS = ("Euler", "implicitfast", "implicit", "RK4")
STEPS = ((1e-3, 1), (2e-3, 1), (2e-4, 5))  # s, and how many of them from sample to sample
DURATION = 5.0  # s
STIFFNESS, DAMPING = 20.0, 2.0  # of the PD controller, in loads of gravity per rad and rad/s
OPEN = 2.0  # of the loads of gravity per rad, of a torque in open loop
HANGING = np.array([-np.pi / 2, 0.0])

_MODEL = """
<mujoco>
  <option timestep="{step}" integrator="{integrator}"/>
  <compiler angle="radian"/>
  <worldbody>
    <body>
      <joint name="first" axis="0 -1 0" damping="{arm.b1}"/>
      <inertial pos="{arm.lc1} 0 0" mass="{arm.m1}" diaginertia="{arm.I1} {arm.I1} {arm.I1}"/>
      <body pos="{arm.l1} 0 0">
        <joint name="second" axis="0 -1 0" damping="{arm.b2}"/>
        <inertial pos="{arm.lc2} 0 0" mass="{arm.m2}" diaginertia="{arm.I2} {arm.I2} {arm.I2}"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="first"/><motor joint="second"/></actuator>
</mujoco>
"""


def arm_of(rng: np.random.Generator) -> Arm:
    """An arm of slender links, 0.2 to 0.5 m long and 0.5 to 5 kg heavy."""
    m, length = rng.uniform(0.5, 5.0, 2), rng.uniform(0.2, 0.5, 2)
    centre = length * rng.uniform(0.3, 0.6, 2)
    inertia = m * length**2 / 12
    friction = rng.uniform(0.1, 0.6, 2)
    return Arm(
        m1=m[0],
        m2=m[1],
        lc1=centre[0],
        lc2=centre[1],
        l1=length[0],
        l2=length[1],
        I1=inertia[0],
        I2=inertia[1],
        b1=friction[0],
        b2=friction[1],
        g=9.81,
    )


def logged(
    seed: int, integrator: str, step: float, every: int, *, open_loop: bool = False
) -> tuple[algid.Log, FloatArray]:
    """A log of a PD controller that follows five sines a joint, and the arm's constants.

    In `open_loop` the torque is five sines.
    """
    mujoco: Any = import_module("mujoco")
    rng = np.random.default_rng(seed)
    arm = arm_of(rng)
    constants = arm.constants()
    load = constants[[3, 1]]
    frequency, phase = rng.uniform(0.3, 2.5, (2, 5)), rng.uniform(0.0, 2 * np.pi, (2, 5))
    size = rng.uniform(0.1, 0.35, (2, 5))

    def wanted(t: float) -> tuple[FloatArray, FloatArray]:
        angle = 2 * np.pi * frequency * t + phase
        slope = 2 * np.pi * frequency * size * np.cos(angle)
        return HANGING + np.sum(size * np.sin(angle), axis=1), np.sum(slope, axis=1)

    text = _MODEL.format(step=step, integrator=integrator, arm=arm)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = wanted(0.0)
    angles, torques = [], []
    for count in range(round(DURATION / step)):
        if count % every == 0:
            theta, omega = wanted(count * step)
            error, rate = theta - data.qpos, omega - data.qvel
            data.ctrl[:] = load * (STIFFNESS * error + DAMPING * rate)
            if open_loop:
                data.ctrl[:] = OPEN * load * (theta - HANGING)
            angles.append(data.qpos.copy())
            torques.append(data.ctrl.copy())
        mujoco.mj_step(model, data)
    t = np.arange(len(angles)) * step * every
    return algid.Log.from_arrays(t, np.array(angles).T, np.array(torques).T), constants


def row(job: tuple[str, tuple[float, int], bool, int]) -> str:
    """What became of the draws of an integrator, a step, a loop."""
    integrator, (step, every), open_loop, draws = job
    used, held, told = 0, 0, 0
    errors, deviations = [0.0], [np.nan]
    for seed in range(draws):
        log, constants = logged(seed, integrator, step, every, open_loop=open_loop)
        result = algid.identify(log)
        if result.verdict.failed:
            continue
        used += 1
        for name, true in zip(CONSTANT_NAMES, constants, strict=True):
            one = result.parameters[name]
            if not one.usable or one.ci95 is None or None in one.ci95:
                continue
            low, high = one.ci95
            told += 1
            held += bool(low <= true <= high)
            errors.append(abs(one.estimate / true - 1))
            deviations.append(one.std / true)
    spread = float(np.nanmedian(deviations))
    steps = f"{1e3 * step:g} ms, every {every}"
    loop = "PD"
    if open_loop:
        loop = "open"
    return (
        f"| {integrator} | {loop} | {steps} | {used}/{draws} | {held}/{told} | {max(errors):.1e} | "
        f"{spread:.1e} |"
    )


def lines(draws: int, pool: ProcessPoolExecutor) -> Iterator[str]:
    """The table, row by row."""
    yield (
        "| integrator | loop | step, logged | identified | intervals hold | largest error "
        "| median σ |"
    )
    yield "|---|---|---|---|---|---|---|"
    yield from pool.map(row, product(INTEGRATORS, STEPS, (False, True), (draws,)))


if __name__ == "__main__":
    experiment("noiseless", __doc__, lines, 10, "row")
