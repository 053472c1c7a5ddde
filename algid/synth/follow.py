"""A simulated arm that follows a planned motion by feed-forward and a position controller.

    τ = τ_ff(t) + M(θ) (ω_c² (θ_d − θ) + 2 ω_c (θ̇_d − θ̇))

The plan's torque is that of the arm as it was believed to be; what the true arm needs beside it,
the controller adds. M is the inertia of the arm without payload. The controller sees the true
state: its sensors' noise is not fed back.

======  ==========================================  ==========
symbol  name                                        unit
======  ==========================================  ==========
θ_d     planned angles                              rad
τ_ff    planned torques                             N m
ω_c     `STIFFNESS`, the controller's bandwidth     rad/s
======  ==========================================  ==========
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from algid.arm import FloatArray, mass_matrix
from algid.base.errors import SettingError
from algid.base.files import read_text
from algid.synth.simulator import Driven, SimulatedMotion, steered

STIFFNESS = 2 * np.pi * 10.0
_KNOTS = 200.0  # a second, at most: a plan is smooth


@dataclass(frozen=True, eq=False)
class Reference:
    """A motion to follow: times t (N,) in s; angles, velocities, both kinds' torques, (2, N)."""

    t: FloatArray
    theta: FloatArray
    omega: FloatArray
    tau: FloatArray
    loaded_tau: FloatArray

    @property
    def duration(self) -> float:
        """From the first to the last instant, s."""
        return float(self.t[-1] - self.t[0])


def read_plan(path: Path) -> Reference:
    """The plan in the folder of a design, or in its ``trajectory.csv``.

    Raises
    ------
    SettingError
        If there is none, it lacks a column, or it is no motion.
    """
    file = path / "trajectory.csv" if path.is_dir() else path
    try:
        names, *rows = csv.reader(read_text(file).splitlines())
        values = np.array([list(map(float, row)) for row in rows]).reshape(-1, len(names)).T
        column = dict(zip(names, values, strict=True))
        loaded = "loaded_tau" if "loaded_tau1" in column else "tau"
        signals = []
        for name in ("theta", "omega", "tau", loaded):
            signals.append(np.stack([column[f"{name}1"], column[f"{name}2"]]))
        t = column["t"] - column["t"][:1]
    except KeyError as error:
        raise SettingError(f"{file}: no column {error}; give what algid design wrote") from error
    except (OSError, ValueError) as error:
        raise SettingError(
            f"{file}: not the trajectory of a design ({error}); expected what algid design wrote"
        ) from error
    if t.size < 2 or not np.all(np.isfinite(values)) or np.any(np.diff(t) <= 0):
        raise SettingError(
            f"{file}: expected finite numbers at increasing times; write the design anew"
        )
    return Reference(t, *signals)


def follow(
    k: FloatArray,
    plan: Reference,
    t: FloatArray,
    inertia: FloatArray,
    loaded: bool,
    reached: Callable[[float], None] | None,
) -> SimulatedMotion:
    """Motion of the arm `k` (7,) under a controller that follows the plan, at times `t` (N,) in s.

    Parameters
    ----------
    inertia : (7,), constants of the arm that the controller is tuned for
    loaded : bool
        Whether the plan's torque is the loaded one.
    reached : callable
        Called with each time in s that the integration has come to.
    """
    from scipy.interpolate import make_interp_spline

    every = max(1, round(plan.t.size / max(plan.duration * _KNOTS, 1)))
    kept = np.unique(np.append(np.arange(0, plan.t.size, every), plan.t.size - 1))
    tau = plan.loaded_tau if loaded else plan.tau
    wanted = np.concatenate([plan.theta, plan.omega, tau])[:, kept]
    spline = make_interp_spline(plan.t[kept], wanted.T, k=min(5, kept.size - 1))
    end = plan.duration

    def controller(times: FloatArray) -> Driven:
        at = spline(np.minimum(times, end)).T

        def torque(theta: FloatArray, omega: FloatArray) -> FloatArray:
            m11, m12, m22 = mass_matrix(inertia, theta)
            push = STIFFNESS**2 * (at[:2] - theta) + 2 * STIFFNESS * (at[2:4] - omega)
            return at[4:] + np.stack([m11 * push[0] + m12 * push[1], m12 * push[0] + m22 * push[1]])

        return torque

    return steered(k, controller, t, plan.theta[:, 0], spline.t, reached)
