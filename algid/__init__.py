"""algid: parameters and payload of a two-link arm from its torque and angle logs.

    import algid

    unloaded, loaded = algid.synthesise("case1", duration=3.0, torque="wide")
    result = algid.identify(unloaded, loaded)
    print(result.parameters["k1"].estimate, result.payload["m_p"].ci95)

The names below load what they need when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from algid.api.batch import batch
    from algid.api.compare import compare
    from algid.api.convert import convert, read_log, write_log
    from algid.api.design import design
    from algid.api.export import export
    from algid.api.identify import identify
    from algid.api.inspect import inspect
    from algid.api.result import Result, read_result
    from algid.api.synth import synthesise
    from algid.api.track import track
    from algid.api.validate import validate
    from algid.arm import Arm
    from algid.base.errors import AlgidError
    from algid.log import Log
    from algid.profile import Profile
    from algid.settings import Settings
    from algid.synth.simulator import simulate

__version__ = "0.2.0"

__all__ = [
    "AlgidError",
    "Arm",
    "Log",
    "Profile",
    "Result",
    "Settings",
    "__version__",
    "batch",
    "compare",
    "convert",
    "design",
    "export",
    "identify",
    "inspect",
    "read_log",
    "read_result",
    "simulate",
    "synthesise",
    "track",
    "validate",
    "write_log",
]

_HOMES = {
    "AlgidError": "algid.base.errors",
    "Arm": "algid.arm",
    "Log": "algid.log",
    "Profile": "algid.profile",
    "Result": "algid.api.result",
    "Settings": "algid.settings",
    "batch": "algid.api.batch",
    "compare": "algid.api.compare",
    "convert": "algid.api.convert",
    "design": "algid.api.design",
    "export": "algid.api.export",
    "identify": "algid.api.identify",
    "inspect": "algid.api.inspect",
    "read_log": "algid.api.convert",
    "read_result": "algid.api.result",
    "simulate": "algid.synth.simulator",
    "synthesise": "algid.api.synth",
    "track": "algid.api.track",
    "validate": "algid.api.validate",
    "write_log": "algid.api.convert",
}


def __dir__() -> list[str]:
    return sorted(__all__)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'algid' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)
