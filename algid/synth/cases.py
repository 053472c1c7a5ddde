"""Arms to simulate: the cases of the paper (Tables 3 and 4) and TOML files of the same form.

A case holds the arm, the payload, the torque that drives it and, for the paper's own, the errors
of Table 4.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, model_validator

from algid.arm import Arm, FloatArray
from algid.base.errors import SettingError
from algid.base.files import read_toml
from algid.base.limits import PHYSICAL, within
from algid.synth.excitation import MultiSine

_CASES = Path(str(resources.files("algid"))) / "cases"


Mass = Annotated[float, within(PHYSICAL.mass)]
Length = Annotated[float, within(PHYSICAL.length)]
Inertia = Annotated[float, within(PHYSICAL.inertia)]
Friction = Annotated[float, within(PHYSICAL.friction)]
Gravity = Annotated[float, within(PHYSICAL.gravity)]
Payload = Annotated[float, within((0.0, PHYSICAL.mass[1]))]
Centre = Annotated[float, within((-PHYSICAL.length[1], PHYSICAL.length[1]))]
Turn = Annotated[float, within((-3.15, 3.15))]  # rad, of a centre of mass off its link's line
Percent = Annotated[float, Field(gt=0, allow_inf_nan=False)]
_SOME = Field(min_length=1, max_length=1000)
Amplitudes = Annotated[list[Annotated[float, within(PHYSICAL.torque)]], _SOME]
Frequencies = Annotated[list[Annotated[float, within((0.0, PHYSICAL.bandwidth[1]))]], _SOME]
Phases = Annotated[list[Annotated[float, within(PHYSICAL.angle)]], _SOME]


@dataclass(frozen=True)
class Case:
    """An arm, its payload in kg, its driving torque, and the paper's errors in % if known."""

    name: str
    arm: Arm
    payload: float
    torque: MultiSine | None
    paper_error_percent: dict[str, float]
    place: tuple[float | None, float] = (None, 0.0)
    """Of the payload's centre of mass: x and y in m in link 2's frame; without x at the tip."""
    inertia: float = 0.0
    """Of the payload about its centre of mass, kg m^2."""

    def carrying(self, payload: float) -> Case:
        """The case with `payload` kg, of the same shape."""
        inertia = self.inertia
        if self.payload:
            inertia *= payload / self.payload
        elif not payload:
            inertia = 0.0
        return replace(self, payload=payload, inertia=inertia)

    def constants(self, payload: float) -> FloatArray:
        """Constants (10,) with `payload` kg; another mass has the shape of the case's payload."""
        return self.arm.phasors(payload, *self.place, self.carrying(payload).inertia)


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid")


class _ArmTable(_Table):
    m1: Mass
    m2: Mass
    l1: Length
    l2: Length
    lc1: Centre | None = None
    lc2: Centre | None = None
    I1: Inertia | None = None
    I2: Inertia | None = None
    b1: Friction = 0.0
    b2: Friction = 0.0
    g: Gravity = 9.81
    delta1: Turn = 0.0
    delta2: Turn = 0.0

    def arm(self) -> Arm:
        """The arm; a link of which only length and mass are given is uniform: l / 2, m l² / 12."""
        uniform = {
            "lc1": self.l1 / 2,
            "lc2": self.l2 / 2,
            "I1": self.m1 * self.l1**2 / 12,
            "I2": self.m2 * self.l2**2 / 12,
        }
        return Arm(**(uniform | self.model_dump(exclude_none=True)))


class _PayloadTable(_Table):
    m_p: Payload
    x: Centre | None = None
    y: Centre = 0.0
    J: Inertia = 0.0


class _JointTorque(_Table):
    amplitude: Amplitudes
    frequency: Frequencies
    phase: Phases

    @model_validator(mode="after")
    def _same_lengths(self) -> _JointTorque:
        if not len(self.amplitude) == len(self.frequency) == len(self.phase):
            raise ValueError("amplitude, frequency and phase need the same number of harmonics")
        return self


class _TorqueTable(_Table):
    joint1: _JointTorque
    joint2: _JointTorque


class _CaseFile(_Table):
    arm: _ArmTable
    payload: _PayloadTable = _PayloadTable(m_p=0.0)
    torque: _TorqueTable | None = None
    paper_error_percent: dict[str, Percent] = {}


def case_names() -> list[str]:
    """Names of the cases that ship with algid."""
    return sorted(file.stem for file in _CASES.glob("*.toml"))


def load_case(name: str) -> Case:
    """The shipped case of that name, or the case that the TOML file `name` describes.

    Raises
    ------
    SettingError
        If there is neither such a case nor such a file, or the file does not describe an arm.
    """
    path = _CASES / f"{name}.toml" if name in case_names() else Path(name)
    if not path.name.endswith(".toml"):
        raise SettingError(
            f"{name}: no such case; expected {', '.join(case_names())} or a .toml file that "
            "describes an arm"
        )
    content = read_toml(path, _CaseFile)
    torque = None
    if content.torque is not None:
        one, two = content.torque.joint1.model_dump(), content.torque.joint2.model_dump()
        torque = MultiSine(**{name: (tuple(one[name]), tuple(two[name])) for name in one})
    return Case(
        name=path.stem,
        arm=content.arm.arm(),
        payload=content.payload.m_p,
        place=(content.payload.x, content.payload.y),
        inertia=content.payload.J,
        torque=torque,
        paper_error_percent=content.paper_error_percent,
    )
