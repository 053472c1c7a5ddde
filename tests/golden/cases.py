"""Identifications, exports and files read, each as the few numbers and codes that its users rely
on.

The suite guards a rebuilding: whatever moves a number or a code shows here, meant or not. It
proves nothing right; that is the work of the tests beside it, which compare with truth from
outside.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

import algid
from algid.log import Log
from algid.synth.sensors import Sensors
from tests.golden.files import sounds
from tests.golden.scenes import SCENES
from tests.processes import Outcome
from tests.report.test_brief import shown

SHARED = Path(__file__).parents[3] / "shared" / "data"
NOISY = Sensors(position_noise=1e-3, torque_noise=1e-2, seed=4)
Summary = dict[str, Any]


@dataclass(frozen=True)
class Case:
    """A name and what makes its summary in an empty folder; `real` ones need recorded logs."""

    name: str
    run: Callable[[Path], Summary]
    real: bool = False


@cache
def logs(name: str, duration: float = 4.0, exact: bool = False) -> tuple[Log, Log]:
    """The unloaded and the loaded log of a case, wide motion."""
    sensors = Sensors() if exact else NOISY
    return algid.synthesise(name, duration=duration, torque="wide", sensors=sensors)


def summary(result: algid.Result) -> Summary:
    """Estimates with their deviations, statuses, codes, terms and prediction of a result.

    What a terminal shows of it is held to lines of 80 columns on the way. Of a failed
    result, whose numbers are not to be used and may hang on rounding, the reasons are kept alone.
    """
    shown(result)
    content = result.model_dump(mode="json")
    estimates = {**content["parameters"], **content["payload"]}
    found: Summary = {
        "estimator": result.estimator,
        "codes": sorted({notice["code"] for notice in content["notices"]}),
        "grade": content["verdict"]["grade"],
    }
    if found["grade"] == "failed":
        return found
    found |= {
        "numbers": {name: [row["estimate"], row["std"]] for name, row in estimates.items()},
        "status": {name: row["status"] for name, row in estimates.items()},
    }
    if content["fit"] and content["fit"].get("model"):
        found["terms"] = content["fit"]["model"]["terms"]
    return found


def _identified(_folder: Path, **settings: Any) -> Summary:
    return summary(algid.identify(*logs("case1"), algid.Settings(**settings), report=False))


def _of_case(name: str, estimator: str, exact: bool, _folder: Path) -> Summary:
    settings = algid.Settings(estimator=estimator)
    return summary(algid.identify(*logs(name, exact=exact), settings, report=False))


def _changed(change: Callable[[Log], Log], _folder: Path) -> Summary:
    """The unloaded log of case 1 with something wrong with it."""
    try:
        return summary(algid.identify(change(logs("case1")[0]), report=False))
    except algid.AlgidError as error:
        return {"refused": type(error).__name__}


def _scaled(log: Log, **factors: float) -> Log:
    theta, tau = log.theta.copy(), log.tau.copy()
    for name, factor in factors.items():
        (theta if name.startswith("theta") else tau)[int(name[-1]) - 1] *= factor
    return replace(log, theta=theta, tau=tau)


def _shifted(joint: int, angle: float, log: Log) -> Log:
    theta = log.theta.copy()
    theta[joint] += angle
    return replace(log, theta=theta)


def _swapped(log: Log) -> Log:
    return replace(log, theta=log.theta[::-1].copy(), tau=log.tau[::-1].copy())


def _late(log: Log) -> Log:
    return replace(log, tau=np.roll(log.tau, 5, axis=1))


def _still(log: Log) -> Log:
    theta, tau = log.theta.copy(), log.tau.copy()
    theta[1] = theta[1, 0] + 1e-4 * np.random.default_rng(1).standard_normal(theta.shape[1])
    return replace(log, theta=theta, tau=tau)


def _read_back(suffix: str, folder: Path) -> Summary:
    paths = []
    for place, log in enumerate(logs("case1", 2.0)):
        paths.append(folder / f"log{place}{suffix}")
        algid.write_log(paths[-1], log)
    return summary(algid.identify(paths[0], paths[1], report=False))


def _several(count: int, _folder: Path, **settings: Any) -> Summary:
    unloaded = [
        algid.synthesise("case2", duration=2.0, torque="wide", sensors=replace(NOISY, seed=seed))[0]
        for seed in range(count)
    ]
    return summary(algid.identify(unloaded, settings=algid.Settings(**settings), report=False))


def _scene(name: str, _folder: Path) -> Summary:
    unloaded, loaded = SCENES[name]()
    return summary(algid.identify(unloaded, loaded or None, report=False))


def _known_arm(_folder: Path) -> Summary:
    unloaded, loaded = logs("case1")
    arm = algid.identify(unloaded, report=False)
    return summary(algid.identify(None, loaded, parameters=arm, report=False))


def _exported(form: str, folder: Path) -> Summary:
    unloaded, loaded = logs("case1")
    algid.identify(unloaded, loaded, out=folder, name="arm", report=False)
    done = Outcome("export", folder / "arm.algid", "--to", form, "-o", folder / "model")
    files = sorted(folder.glob("model*"))
    text = "".join(path.read_text(encoding="utf-8") for path in files)
    numbers = re.findall(r"(?<![\w.])-?\d+\.\d+(?:e[+-]?\d+)?", text)
    return {
        "code": done.code,
        "numbers": {str(n): [float(value), None] for n, value in enumerate(numbers)},
    }


def _real(folder: str, places: slice, _folder: Path, **settings: Any) -> Summary:
    from algid.profile import Profile

    paths = sorted((SHARED / folder).glob("*.csv"))[places]
    profile = Profile.model_validate({"zero": "hanging"})
    return summary(
        algid.identify(paths, settings=algid.Settings(**settings), profile=profile, report=False)
    )


def cases() -> Iterator[Case]:
    """Every case of the suite."""
    for name in ("case1", "case2"):
        for estimator in ("refined", "weak", "instruments", "paper"):
            for exact in (False, True):
                label = f"{name} {estimator}{' exact' if exact else ''}"
                yield Case(label, partial(_of_case, name, estimator, exact))
    for term in (
        "coulomb",
        "offset",
        "rotor",
        "load",
        "gain",
        "lag",
        "delay",
        "coulomb,stribeck",
        "coulomb,asymmetry",
    ):
        yield Case(f"model {term}", partial(_identified, model=term))
        yield Case(f"weak model {term}", partial(_identified, model=term, estimator="weak"))
    more: dict[str, dict[str, Any]] = {
        "plain": {"model": "plain"},
        "held torque": {"torque_hold": "zoh"},
        "known delay": {"delay": 0.001},
        "lengths": {"l1": 0.1626, "l2": 0.1232},
        "payload's mass": {"payload_mass": 0.3515},
        "constrained": {"constrain": True},
        "short windows": {"estimator": "weak", "window": 0.2},
    }
    for label, settings in more.items():
        yield Case(label, partial(_identified, **settings))
    wrong: dict[str, Callable[[Log], Log]] = {
        "flipped torque": partial(_scaled, tau1=-1.0),
        "mirrored": partial(_scaled, theta1=-1.0, theta2=-1.0, tau1=-1.0, tau2=-1.0),
        "gain": partial(_scaled, tau1=0.8),
        "hanging zero": partial(_shifted, 0, np.pi / 2),
        "zero of joint 2": partial(_shifted, 1, 0.1),
        "joints swapped": _swapped,
        "torque late": _late,
        "joint 2 still": _still,
    }
    for label, change in wrong.items():
        yield Case(label, partial(_changed, change))
    for name in SCENES:
        yield Case(f"scene {name}", partial(_scene, name))
    for suffix in (".csv", ".parquet", ".mcap"):
        yield Case(f"read {suffix}", partial(_read_back, suffix))
    for estimator in ("refined", "weak"):
        yield Case(f"five logs {estimator}", partial(_several, 5, estimator=estimator))
    yield Case("cross-validated", partial(_several, 3, cross_validate=True, estimator="weak"))
    yield Case("known arm", _known_arm)
    for form in ("urdf", "mjcf", "sdf", "python", "c", "payload"):
        yield Case(f"export {form}", partial(_exported, form))
    for sound in sounds():
        yield Case(f"file {sound.name}", sound.read)
    yield Case("C.1, one run", partial(_real, "dfki/C1_sysid", slice(2, 3)), real=True)
    yield Case("C.1, three runs", partial(_real, "dfki/C1_sysid", slice(0, 3)), real=True)
    yield Case("A.0, two runs", partial(_real, "dfki/A0_sysid", slice(0, 2)), real=True)
    yield Case("A.0, plain", partial(_real, "dfki/A0_sysid", slice(0, 2), model="plain"), real=True)
