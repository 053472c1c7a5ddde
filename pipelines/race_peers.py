"""The contenders of the race: each takes the same logs and gives k1 … k7, their deviations where
it has any.

An answer's values are k1 … k7; what else a contender knows of the torque (Coulomb friction, a
rotor, an offset) is in `terms`, so that its prediction is judged with all that it identified.
`CHOICES` counts what a user of each has to choose before it runs: filters, windows, starts,
bounds, widths, terms.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from algid.arm import CONSTANT_NAMES, FloatArray, regressor
from algid.signals.segments import Segment
from pipelines import race_regressions as regressions

COULOMB_WIDTH = regressions.WIDTH  # rad/s, what the linear contenders take
L1_OF_EXAMPLE = 0.1626  # m: link 1 of the paper's first case
CUTOFF = 20.0  # Hz
_DROPPED = 0.3  # s at each end, where a filter rings


@dataclass(frozen=True, eq=False)
class Answer:
    """k1 … k7 (7,), their standard deviations or intervals (7, 2) where given, and other terms by
    name.
    """

    values: FloatArray
    interval: FloatArray | None = None
    terms: dict[str, float] = field(default_factory=dict)
    width: float = COULOMB_WIDTH


def algid_by(estimator: str) -> Callable[[Sequence[Segment]], Answer]:
    """algid without any other flag, or with one estimator."""

    def answer(logs: Sequence[Segment]) -> Answer:
        import algid
        from algid.log import Log, Origin

        read = []
        for place, log in enumerate(logs):
            stamps = np.round(np.arange(len(log)) * log.dt * 1e9).astype(np.int64)
            read.append(Log(stamps, log.theta, log.tau, Origin(str(place), "csv", {})))
        settings = (
            algid.Settings() if estimator == "default" else algid.Settings(estimator=estimator)
        )
        result = algid.identify(read, settings=settings, report=False)
        rows = [result.parameters.get(name) for name in CONSTANT_NAMES]
        values = [np.nan if row is None or row.estimate is None else row.estimate for row in rows]
        bounds = [(np.nan, np.nan) if row is None else (row.ci95 or (None, None)) for row in rows]
        interval = np.array(bounds, dtype=np.float64)
        terms = {
            name: row.estimate
            for name, row in result.parameters.items()
            if name not in CONSTANT_NAMES and row.estimate is not None
        }
        width = result.fit.model.coulomb_speed if result.fit and result.fit.model else None
        given = None if estimator == "paper" else interval
        return Answer(np.array(values), given, terms, float(width or COULOMB_WIDTH))

    return answer


def filtered(
    log: Segment, cutoff: float = CUTOFF
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Angles, velocities, accelerations and torques (2, N) behind one zero-phase filter."""
    from scipy.signal import butter, sosfiltfilt

    sections = butter(4, cutoff, fs=1 / log.dt, output="sos")
    theta, tau = sosfiltfilt(sections, np.stack([log.theta, log.tau]), axis=-1)
    omega = np.gradient(theta, log.dt, axis=1)
    return theta, omega, np.gradient(omega, log.dt, axis=1), tau


def _regression(p: FloatArray, covariance: FloatArray) -> Answer:
    """The answer of a regression's parameters (12,) with their covariance."""
    half = 1.96 * np.sqrt(np.maximum(np.diag(covariance), 0.0))[:7]
    terms = dict(zip(regressions.NAMES[7:], p[7:].tolist(), strict=True))
    return Answer(p[:7], np.stack([p[:7] - half, p[:7] + half], axis=1), terms)


def least_squares(logs: Sequence[Segment]) -> Answer:
    """Least squares behind filters that predict best, with Coulomb friction, offsets
    and a rotor.
    """
    p, covariance, _ = regressions.least_squares(logs)
    return _regression(p, covariance)


def idim_iv(logs: Sequence[Segment]) -> Answer:
    """The same equations with the columns of a simulated motion as instruments."""
    return _regression(*regressions.instruments(logs))


def pinocchio(logs: Sequence[Segment], l1: float) -> Answer:
    """FIGAROH's way: pinocchio's torque regressor sample by sample, viscous and Coulomb columns,
    least squares.
    """
    import pinocchio as pin

    model = pin.Model()
    model.gravity.linear = np.array([0.0, -9.81, 0.0])
    first = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "joint1")
    model.addJoint(
        first, pin.JointModelRZ(), pin.SE3(np.eye(3), np.array([l1, 0.0, 0.0])), "joint2"
    )
    data = model.createData()
    gram, moment = np.zeros((24, 24)), np.zeros(24)
    for log in logs:
        theta, omega, alpha, tau = filtered(log)
        edge = round(_DROPPED / log.dt)
        for i in range(edge, theta.shape[1] - edge, max(1, round(1 / (4 * CUTOFF * log.dt)))):
            block = pin.computeJointTorqueRegressor(
                model, data, theta[:, i], omega[:, i], alpha[:, i]
            )
            row = np.zeros((2, 24))
            row[:, :20] = block
            row[0, 20:22] = omega[0, i], np.tanh(omega[0, i] / COULOMB_WIDTH)
            row[1, 22:24] = omega[1, i], np.tanh(omega[1, i] / COULOMB_WIDTH)
            gram += row.T @ row
            moment += row.T @ tau[:, i]
    found = np.linalg.pinv(gram, rcond=1e-12, hermitian=True) @ moment
    x1, inertia1, m2, x2, inertia2 = found[[1, 9, 10, 11, 19]]
    g = 9.81
    values = [
        l1 * x2,
        g * x2,
        inertia2,
        g * (x1 + m2 * l1),
        inertia1 + m2 * l1**2,
        found[20],
        found[22],
    ]
    return Answer(np.array(values), None, {"f1": float(found[21]), "f2": float(found[23])})


def pysindy(logs: Sequence[Segment]) -> Answer:
    """PySINDy's weak form over windows of 0.4 s, then least squares."""
    from pysindy import WeakPDELibrary
    from pysindy.feature_library import PolynomialLibrary

    window = 0.4
    moments = []
    for log in logs:
        theta, omega, alpha, tau = filtered(log)
        Y = regressor(theta, omega, alpha)
        np.random.seed(0)  # noqa: NPY002 (the library draws its windows from there)
        t = log.dt * np.arange(theta.shape[1])
        library = WeakPDELibrary(
            PolynomialLibrary(degree=1, include_bias=False),
            spatiotemporal_grid=t,
            K=max(20, round(4 * t[-1] / window)),
            H_xt=window / 2,
        )
        for joint in range(2):
            signals = np.concatenate([Y[joint], tau[joint][None]]).T
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # it warns of its own labels of axes
                library.fit([signals])
                moments.append(np.asarray(library.transform([signals])[0]))
    rows = np.concatenate(moments)
    return Answer(np.asarray(np.linalg.lstsq(rows[:, :7], rows[:, 7], rcond=None)[0]))


def output_error(logs: Sequence[Segment]) -> Answer:
    """Windows of 0.2 s simulated from the filtered motion, Coulomb friction and a rotor,
    Gauss-Newton.
    """
    from pipelines import output_error as peer

    found = peer.fit(logs, least_squares(logs).values)
    names = ("f1", "f2", "j2")
    return Answer(found[:7], None, dict(zip(names, found[7:].tolist(), strict=True)))


_ARM_XML = """
<mujoco>
  <compiler angle="radian"/>
  <option integrator="RK4" timestep="{dt}" gravity="0 -9.81 0"><flag contact="disable"/></option>
  <worldbody>
    <body name="link1">
      <inertial pos="{lc1} 0 0" mass="{m1}" diaginertia="{I1} {I1} {I1}"/>
      <joint name="joint1" type="hinge" axis="0 0 1" damping="{b1}"/>
      <body name="link2" pos="{l1} 0 0">
        <inertial pos="{lc2} 0 0" mass="{m2}" diaginertia="{I2} {I2} {I2}"/>
        <joint name="joint2" type="hinge" axis="0 0 1" damping="{b2}"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="joint1"/><motor joint="joint2"/></actuator>
  <sensor><jointpos name="p1" joint="joint1"/><jointpos name="p2" joint="joint2"/></sensor>
</mujoco>"""


def mujoco_sysid(logs: Sequence[Segment], l1: float) -> Answer:
    """MuJoCo's sysid: simulated against measured angles in stretches of 0.5 s, with its own
    covariance.

    The masses and the length of link 1 are taken as known, so that its six parameters are
    determined; it starts from filtered least squares. A sensor of MuJoCo shows the state before
    its step: the measured angles are handed over one sample on. Torques act as the mean of the
    samples around each step.
    """
    import mujoco as package
    from mujoco import sysid as identification

    mujoco: Any = package  # neither is annotated in full
    sysid: Any = identification
    start = _physical(np.maximum(least_squares(logs).values, 1e-4), l1)
    spec = mujoco.MjSpec.from_string(_ARM_XML.format(dt=logs[0].dt, l1=l1, **start))
    parameters = sysid.ParameterDict()
    for name, change in _CHANGES.items():
        value = start[name]
        low, high = sorted((0.1 * value, 10 * value))
        parameters.add(
            sysid.Parameter(name, [value], min_value=[low], max_value=[high], modifier=change)
        )
    states, controls, sensors = _stretches(logs, spec.compile())
    names = [f"stretch{place}" for place in range(len(states))]
    sequences = sysid.ModelSequences("arm", spec, names, states, controls, sensors)
    residual = sysid.build_residual_fn(models_sequences=[sequences])
    best, outcome = sysid.optimize(
        initial_params=parameters,
        residual_fn=residual,
        optimizer="mujoco",
        verbose=False,
        output=io.StringIO(),
    )
    x = np.array([float(best[name].value[0]) for name in _CHANGES])
    misfit, _, _ = residual(outcome.x, best)
    covariance, _ = sysid.calculate_intervals(misfit, outcome.jac)
    values = _constants(x, start, l1)
    slope = np.stack([_constants(x + step, start, l1) - values for step in 1e-6 * np.diag(x)]) / (
        1e-6 * x[:, None]
    )
    half = 1.96 * np.sqrt(np.diag(slope.T @ covariance @ slope))
    return Answer(values, np.stack([values - half, values + half], axis=1))


def _set_centre(body: str) -> Callable[[Any, Any], None]:
    def change(spec: Any, parameter: Any) -> None:
        spec.body(body).ipos = [float(parameter.value[0]), 0.0, 0.0]

    return change


def _set_inertia(body: str) -> Callable[[Any, Any], None]:
    def change(spec: Any, parameter: Any) -> None:
        spec.body(body).inertia = [float(parameter.value[0])] * 3

    return change


def _set_damping(joint: str) -> Callable[[Any, Any], None]:
    def change(spec: Any, parameter: Any) -> None:
        spec.joint(joint).damping = [float(parameter.value[0]), 0.0, 0.0]

    return change


_CHANGES: dict[str, Callable[[Any, Any], None]] = {
    "lc1": _set_centre("link1"),
    "I1": _set_inertia("link1"),
    "lc2": _set_centre("link2"),
    "I2": _set_inertia("link2"),
    "b1": _set_damping("joint1"),
    "b2": _set_damping("joint2"),
}
_G = 9.81


def _stretches(logs: Sequence[Segment], model: Any) -> tuple[list[Any], list[Any], list[Any]]:
    """Initial states, torques and angles of stretches of 0.5 s."""
    from mujoco import sysid

    states, controls, sensors = [], [], []
    for log in logs:
        theta, omega, _, _ = filtered(log)
        length, edge = round(0.5 / log.dt), round(_DROPPED / log.dt)
        times = log.dt * np.arange(length + 1)
        for begin in range(edge, len(log) - length - edge - 1, length):
            part = slice(begin, begin + length + 1)
            acting = 0.5 * (log.tau[:, part] + log.tau[:, begin + 1 : begin + length + 2])
            states.append(sysid.create_initial_state(model, theta[:, begin], omega[:, begin]))
            controls.append(sysid.TimeSeries(times, acting.T.copy()))
            measured = log.theta[:, begin : begin + length].T.copy()
            sensors.append(sysid.TimeSeries.from_names(times[1:], measured, model))
    return states, controls, sensors


def mujoco_log() -> tuple[FloatArray, Segment, float]:
    """Constants (7,), a log of 10 s at 500 Hz and the length of link 1 in m of an arm that MuJoCo
    simulates.
    """
    import mujoco as package

    mujoco: Any = package
    dt, l1 = 0.002, 0.3
    arm = {"m1": 2.0, "m2": 1.0, "lc1": 0.15, "lc2": 0.12, "I1": 0.02, "I2": 0.01}
    arm |= {"b1": 0.4, "b2": 0.2}
    model = mujoco.MjSpec.from_string(_ARM_XML.format(dt=dt, l1=l1, **arm)).compile()
    data = mujoco.MjData(model)
    data.qpos[:] = -np.pi / 2, 0.0
    t = dt * np.arange(5001)
    tau = np.stack([4 * np.sin(5 * t) + 2 * np.sin(11 * t), 1.2 * np.sin(7 * t + 1)])
    theta = np.empty((2, 5000))
    for n in range(5000):
        theta[:, n] = data.qpos
        data.ctrl[:] = 0.5 * (tau[:, n] + tau[:, n + 1])
        mujoco.mj_step(model, data)
    x = np.array([arm[name] for name in _CHANGES])
    return _constants(x, arm, l1), Segment(0.0, dt, theta, tau[:, :-1]), l1


def _physical(k: FloatArray, l1: float) -> dict[str, float]:
    """Masses, centres and inertias of an arm with the constants k (7,).

    a mass of each link is chosen.
    """
    _, k2, k3, k4, k5, b1, b2 = k
    # half of k3 about the centre, where link 1 allows it
    m2 = min(2 * (k2 / _G) ** 2 / k3, 0.9 * k5 / l1**2)
    first = k4 / _G - m2 * l1
    m1 = max(2 * first**2 / (k5 - m2 * l1**2), 1e-3)
    lc2, lc1 = k2 / _G / m2, first / m1
    least = 1e-4
    return {
        "m1": m1, "m2": m2, "lc1": lc1, "lc2": lc2, "b1": b1, "b2": b2,
        "I1": max(k5 - m2 * l1**2 - m1 * lc1**2, least), "I2": max(k3 - m2 * lc2**2, least),
    }  # fmt: skip


def _constants(x: FloatArray, start: dict[str, float], l1: float) -> FloatArray:
    """k1 … k7 (7,) of lc1, I1, lc2, I2, b1, b2."""
    lc1, inertia1, lc2, inertia2, b1, b2 = x
    m1, m2 = start["m1"], start["m2"]
    return np.array(
        [
            m2 * l1 * lc2,
            _G * m2 * lc2,
            inertia2 + m2 * lc2**2,
            _G * (m1 * lc1 + m2 * l1),
            inertia1 + m1 * lc1**2 + m2 * l1**2,
            b1,
            b2,
        ]
    )


def without_length(fit: Callable[[Sequence[Segment]], Answer]) -> Contender:
    """A contender that asks for no length."""
    return lambda logs, _l1: fit(logs)


Contender = Callable[[Sequence[Segment], float], Answer]
PEERS: dict[str, tuple[Contender, int]] = {
    "algid": (without_length(algid_by("default")), 0),
    "algid weak": (without_length(algid_by("weak")), 1),
    "filtered least squares": (without_length(least_squares), 5),
    "IDIM-IV": (without_length(idim_iv), 6),
    "output error": (without_length(output_error), 6),
    "MuJoCo sysid": (mujoco_sysid, 9),
    "PySINDy weak form": (without_length(pysindy), 5),
    "pinocchio regressors": (pinocchio, 6),
    "the paper's method": (without_length(algid_by("paper")), 2),
}
"""Each contender, and the number of its user's choices, such as cut-offs, orders or windows."""
