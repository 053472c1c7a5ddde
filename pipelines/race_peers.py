"""The contenders of the race, each with the options that its authors would choose.

All take the same logs and give k1 … k7, with intervals where they have any. What else a contender
knows of the torque (friction, offsets, a rotor, bent links) is in `terms`, so that its prediction
is judged with all that it identified. The regressions choose their terms (`race_regressions`), and
what they choose is the model of output error, MuJoCo, pinocchio and PySINDy too. "Every term"
stands for a contender that keeps them all.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import algid
from algid.arm import CONSTANT_NAMES, FloatArray
from algid.log import Log
from algid.signals.segments import Segment
from pipelines import output_error as simulation
from pipelines import race_regressions as regressions
from pipelines.race_regressions import NAMES, Choice, chosen, columns, rows, smoothed

L1_OF_EXAMPLE = 0.1626  # m: link 1 of the paper's first case
CUTOFF = 20.0  # Hz
STEP = 0.002  # s, of the logs that contenders other than algid take
_DROPPED = 0.3  # s at each end, where a filter rings


@dataclass(frozen=True, eq=False)
class Answer:
    """k1 … k7 (7,), their standard deviations and 95 % intervals (7, 2) where given, and other
    terms by name.
    """

    values: FloatArray
    std: FloatArray | None = None
    interval: FloatArray | None = None
    terms: dict[str, float] = field(default_factory=dict)
    width: float = regressions.WIDTH


def as_log(segment: Segment) -> Log:
    """A stretch as a log that was read."""
    return Log.from_arrays(segment.dt * np.arange(len(segment)), segment.theta, segment.tau)


def even(log: Log) -> Segment:
    """A log on an even time base, by cubic splines."""
    from scipy.interpolate import CubicSpline

    t = 1e-9 * (log.stamp_ns - log.stamp_ns[0])
    base = STEP * np.arange(int(t[-1] / STEP + 1e-6) + 1)
    theta, tau = (CubicSpline(t, signal, axis=1)(base) for signal in (log.theta, log.tau))
    return Segment(0.0, STEP, theta, tau)


def algid_by(**flags: str) -> Contender:
    """algid without any flag, or with some."""

    def answer(logs: Sequence[Log], _l1: float) -> Answer:
        result = algid.identify(list(logs), report=False, **flags)  # type: ignore[arg-type]
        found = {name: row for name, row in result.parameters.items() if row.estimate is not None}
        none = (np.nan,) * 4  # estimate, deviation and both ends of the interval
        rows = [
            (found[name].estimate, found[name].std, *(found[name].ci95 or none[:2]))
            if name in found
            else none
            for name in CONSTANT_NAMES
        ]
        numbers = np.array(rows, dtype=np.float64)
        model = result.fit.model if result.fit else None
        return Answer(
            numbers[:, 0],
            None if np.all(np.isnan(numbers[:, 1])) else numbers[:, 1],
            None if np.all(np.isnan(numbers[:, 2:])) else numbers[:, 2:],
            {
                name: row.estimate or 0.0
                for name, row in found.items()
                if name not in CONSTANT_NAMES
            },
            float((model and model.coulomb_speed) or regressions.WIDTH),
        )

    return answer


def _by_covariance(values: FloatArray, covariance: FloatArray, terms: dict[str, float]) -> Answer:
    """The answer of k1 … k7 with their covariance (7, 7)."""
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    interval = np.stack([values - 1.96 * std, values + 1.96 * std], axis=1)
    return Answer(values, std, interval, terms)


def _terms(p: FloatArray, choice: Choice) -> dict[str, float]:
    return {NAMES[place]: float(p[n]) for n, place in enumerate(choice.columns) if place >= 7}


Fitted = Callable[[list[Segment], Choice, float], Answer]


def prepared(fit: Fitted, every_term: bool = False) -> Contender:
    """A contender that takes even logs, behind the filters that predict best, and their terms."""

    def answer(logs: Sequence[Log], l1: float) -> Answer:
        segments = [even(log) for log in logs]
        return fit(segments, chosen(segments, every_term), l1)

    return answer


def least_squares(segments: list[Segment], choice: Choice, _l1: float) -> Answer:
    """Least squares on the filtered regressor."""
    return _of_regression(*regressions.least_squares(segments, choice), choice)


def instruments(segments: list[Segment], choice: Choice, _l1: float) -> Answer:
    """IDIM-IV."""
    return _of_regression(*regressions.instruments(segments, choice), choice)


def _of_regression(p: FloatArray, covariance: FloatArray, choice: Choice) -> Answer:
    return _by_covariance(p[:7], covariance[:7, :7], _terms(p, choice))


def output_error(segments: list[Segment], choice: Choice, _l1: float) -> Answer:
    """Simulated against measured angles, from least squares on."""
    first, _ = regressions.least_squares(segments, choice)
    p = simulation.fit(segments, first, choice)
    return Answer(p[:7], terms=_terms(p, choice))


def pinocchio(segments: list[Segment], choice: Choice, l1: float) -> Answer:
    """FIGAROH's way: pinocchio's torque regressor and columns of friction, filtered and thinned,
    least squares with each joint weighed by its misfit.
    """
    import pinocchio as pin

    model = pin.Model()
    model.gravity.linear = np.array([0.0, -9.81, 0.0])
    first = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "joint1")
    model.addJoint(
        first, pin.JointModelRZ(), pin.SE3(np.eye(3), np.array([l1, 0.0, 0.0])), "joint2"
    )
    data = model.createData()
    # of mass, first moments and inertias of both links those that move in the plane
    links = [0, 1, 9, 10, 11, 19, *([2, 12] if "bent" in choice.terms else [])]
    more = [place for place in choice.columns if 5 <= place < 12]
    A, b = [], []
    for log in segments:
        motion = smoothed(log, choice.motion)
        own = np.stack(
            [
                pin.computeJointTorqueRegressor(model, data, *state)[:, links]
                for state in np.moveaxis(np.stack(motion), -1, 0)
            ],
            axis=-1,
        )
        every = np.concatenate([own, columns(motion)[:, more]], axis=1)
        A.append(rows(every, log.dt, choice.equations).reshape(2, -1, every.shape[1]))
        b.append(rows(log.tau, log.dt, choice.equations).reshape(2, -1))
    Y, tau = np.concatenate(A, axis=1), np.concatenate(b, axis=1)
    found = np.linalg.lstsq(np.concatenate(Y), tau.ravel(), rcond=None)[0]
    weight = 1 / np.sqrt(np.mean((tau - Y @ found) ** 2, axis=1))
    found, covariance = regressions.solved(
        np.concatenate(Y * weight[:, None, None]), (tau * weight[:, None]).ravel()
    )
    g, place = 9.81, len(links)
    to_constants = np.zeros((7, found.size))
    to_constants[0, 4], to_constants[1, 4], to_constants[2, 5] = l1, g, 1
    to_constants[3, [1, 3]], to_constants[4, [2, 3]] = (g, g * l1), (1, l1**2)
    to_constants[[5, 6], [place, place + 1]] = 1
    terms = {NAMES[one]: float(found[place + n]) for n, one in enumerate(more) if one >= 7}
    if "bent" in choice.terms:
        terms |= {"k1s": l1 * found[7], "k2s": g * found[7], "k4s": g * found[6]}
    return _by_covariance(to_constants @ found, to_constants @ covariance @ to_constants.T, terms)


def pysindy(segments: list[Segment], choice: Choice, _l1: float) -> Answer:
    """PySINDy's weak form over windows of 0.4 s, then least squares."""
    from pysindy import WeakPDELibrary
    from pysindy.feature_library import PolynomialLibrary

    window = 0.4
    moments = []
    for log in segments:
        Y = columns(smoothed(log, CUTOFF))[:, choice.columns]
        np.random.seed(0)  # noqa: NPY002 (the library draws its windows from there)
        t = log.dt * np.arange(len(log))
        library = WeakPDELibrary(
            PolynomialLibrary(degree=1, include_bias=False),
            spatiotemporal_grid=t,
            K=max(20, round(4 * t[-1] / window)),
            H_xt=window / 2,
        )
        for joint in range(2):
            signals = np.concatenate([Y[joint], log.tau[joint][None]]).T
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # it warns of its own labels of axes
                library.fit([signals])
                moments.append(np.asarray(library.transform([signals])[0]))
    moment = np.concatenate(moments)
    p = np.linalg.lstsq(moment[:, :-1], moment[:, -1], rcond=None)[0]
    return Answer(p[:7], terms=_terms(p, choice))


_ARM_XML = """
<mujoco>
  <compiler angle="radian"/>
  <option integrator="RK4" timestep="{dt}" gravity="0 -9.81 0"><flag contact="disable"/></option>
  <worldbody>
    <body name="link1">
      <inertial pos="{lc1} {y1} 0" mass="{m1}" diaginertia="{I1} {I1} {I1}"/>
      <joint name="joint1" type="hinge" axis="0 0 1" damping="{b1}" frictionloss="{f1}"/>
      <body name="link2" pos="{l1} 0 0">
        <inertial pos="{lc2} {y2} 0" mass="{m2}" diaginertia="{I2} {I2} {I2}"/>
        <joint name="joint2" type="hinge" axis="0 0 1" damping="{b2}" frictionloss="{f2}"
          armature="{j2}"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="joint1"/><motor joint="joint2"/></actuator>
  <sensor><jointpos name="p1" joint="joint1"/><jointpos name="p2" joint="joint2"/></sensor>
</mujoco>"""
_RIGID = ("lc1", "I1", "lc2", "I2", "b1", "b2")
_MORE = {"coulomb": ("f1", "f2"), "rotor": ("j2",), "bent": ("y1", "y2")}
"""By term what it adds to the parameters; MuJoCo has no offset of a torque."""
_G = 9.81


def mujoco_sysid(segments: list[Segment], choice: Choice, l1: float) -> Answer:
    """MuJoCo's sysid: simulated against measured angles in stretches of 0.5 s, with its own
    covariance.

    The masses and the length of link 1 are taken as known, so that its parameters are determined;
    it starts from filtered least squares, and takes its terms. A sensor of MuJoCo shows the state
    before its step: the measured angles are handed over one sample on. Torques act as the mean of
    the samples around each step.
    """
    import mujoco as package
    from mujoco import sysid as identification

    mujoco: Any = package  # neither is annotated in full
    sysid: Any = identification
    first, _ = regressions.least_squares(segments, choice)
    start = _physical(dict(zip(CONSTANT_NAMES, first, strict=False)) | _terms(first, choice), l1)
    names = [*_RIGID, *(name for term in choice.terms for name in _MORE.get(term, ()))]
    spec = mujoco.MjSpec.from_string(_ARM_XML.format(dt=segments[0].dt, l1=l1, **start))
    parameters = sysid.ParameterDict()
    for name in names:
        low, high = sorted((0.1 * start[name], 10 * start[name]))
        parameters.add(
            sysid.Parameter(
                name, [start[name]], min_value=[low], max_value=[high], modifier=_changed(name)
            )
        )
    states, controls, sensors = _stretches(segments, choice.motion, spec.compile())
    places = [f"stretch{place}" for place in range(len(states))]
    sequences = sysid.ModelSequences("arm", spec, places, states, controls, sensors)
    residual = sysid.build_residual_fn(models_sequences=[sequences])
    best, outcome = sysid.optimize(
        initial_params=parameters,
        residual_fn=residual,
        optimizer="mujoco",
        verbose=False,
        output=io.StringIO(),
    )
    x = np.array([float(best[name].value[0]) for name in names])
    misfit, _, _ = residual(outcome.x, best)
    covariance, _ = sysid.calculate_intervals(misfit, outcome.jac)

    def constants(x: FloatArray) -> FloatArray:
        return _constants(start | dict(zip(names, x.tolist(), strict=True)), l1)

    values = constants(x)
    slope = np.stack([constants(x + step) - values for step in 1e-6 * np.diag(x)])
    slope /= 1e-6 * x[:, None]
    arm = start | dict(zip(names, x.tolist(), strict=True))
    terms = {name: arm[name] for name in ("f1", "f2", "j2")}
    bent = arm["m2"] * arm["y2"]
    terms |= {"k1s": l1 * bent, "k2s": _G * bent, "k4s": _G * arm["m1"] * arm["y1"]}
    return _by_covariance(values, slope.T @ covariance @ slope, terms)


def _changed(name: str) -> Callable[[Any, Any], None]:
    """What sets a parameter of the arm in MuJoCo's description of it."""
    kind, number = name.rstrip("12"), int(name[-1])

    def change(spec: Any, parameter: Any) -> None:
        value = float(parameter.value[0])
        body, joint = spec.body(f"link{number}"), spec.joint(f"joint{number}")
        if kind in ("lc", "y"):
            centre = np.array(body.ipos)
            centre[int(kind == "y")] = value
            body.ipos = centre
        elif kind == "I":
            body.inertia = [value] * 3
        elif kind == "b":
            joint.damping = [value, 0.0, 0.0]
        elif kind == "f":
            joint.frictionloss = value
        else:
            joint.armature = value

    return change


def _stretches(
    logs: Sequence[Segment], cutoff: float, model: Any
) -> tuple[list[Any], list[Any], list[Any]]:
    """Initial states, torques and angles of stretches of 0.5 s."""
    from mujoco import sysid

    states, controls, sensors = [], [], []
    for log in logs:
        theta, omega, _ = smoothed(log, cutoff)
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
    arm |= {"b1": 0.4, "b2": 0.2, "y1": 0.0, "y2": 0.0, "f1": 0.0, "f2": 0.0, "j2": 0.0}
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
    return _constants(arm, l1), Segment(0.0, dt, theta, tau[:, :-1]), l1


def _physical(k: dict[str, float], l1: float) -> dict[str, float]:
    """Masses, centres, inertias and friction of an arm with the constants k; the masses of the
    links are chosen.
    """
    least = 1e-4
    k2, k3, k4, k5, b1, b2 = (max(k[name], least) for name in CONSTANT_NAMES[1:])
    # half of k3 about the centre, where link 1 allows it
    m2 = min(2 * (k2 / _G) ** 2 / k3, 0.9 * k5 / l1**2)
    first = k4 / _G - m2 * l1
    m1 = max(2 * first**2 / (k5 - m2 * l1**2), 1e-3)
    lc2, lc1 = k2 / _G / m2, first / m1
    y1, y2 = k.get("k4s", 0.0) / _G / m1, k.get("k2s", 0.0) / _G / m2
    return {
        "m1": m1, "m2": m2, "lc1": lc1, "lc2": lc2, "y1": y1, "y2": y2, "b1": b1, "b2": b2,
        "I1": max(k5 - m2 * l1**2 - m1 * (lc1**2 + y1**2), least),
        "I2": max(k3 - m2 * (lc2**2 + y2**2), least),
        **{name: max(k[name], least) if name in k else 0.0 for name in ("f1", "f2", "j2")},
    }  # fmt: skip


def _constants(arm: dict[str, float], l1: float) -> FloatArray:
    """k1 … k7 (7,) of an arm's masses, centres, inertias and friction."""
    m1, m2, lc1, lc2 = (arm[name] for name in ("m1", "m2", "lc1", "lc2"))
    return np.array(
        [
            m2 * l1 * lc2,
            _G * m2 * lc2,
            arm["I2"] + m2 * (lc2**2 + arm["y2"] ** 2),
            _G * (m1 * lc1 + m2 * l1),
            arm["I1"] + m1 * (lc1**2 + arm["y1"] ** 2) + m2 * l1**2,
            arm["b1"],
            arm["b2"],
        ]
    )


Contender = Callable[[Sequence[Log], float], Answer]
"""Takes logs, and the length of link 1 in m where it asks for one."""
PEERS: dict[str, tuple[Contender, int]] = {
    "algid": (algid_by(), 0),
    "algid weak": (algid_by(estimator="weak"), 1),
    "least squares": (prepared(least_squares), 4),
    "least squares, every term": (prepared(least_squares, every_term=True), 5),
    "IDIM-IV": (prepared(instruments), 5),
    "IDIM-IV, every term": (prepared(instruments, every_term=True), 6),
    "output error": (prepared(output_error), 5),
    "output error, every term": (prepared(output_error, every_term=True), 6),
    "pinocchio regressors": (prepared(pinocchio), 4),
    "PySINDy weak form": (prepared(pysindy), 5),
    "MuJoCo sysid": (prepared(mujoco_sysid), 8),
    "the paper's method": (algid_by(estimator="paper"), 2),
}
"""Each contender, and the number of its user's choices, such as cut-offs, orders or windows."""
SIMULATED_ALONE = ("MuJoCo sysid", "the paper's method")
"""Contenders that real runs are not given: one takes minutes for a half, the other a single log."""
