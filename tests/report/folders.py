"""Result folders to report on: an identification of two simulated logs, by the front door."""

from __future__ import annotations

import shutil
from pathlib import Path

import algid
from algid.base.significance import NORMAL
from algid.notices import Notice
from algid.results import Estimate, LogSummary, Result, Status, read_result, write_result
from algid.synth.sensors import Sensors

START_NS = 1_700_000_000_123_456_789


def build(folder: Path, duration: float = 4.0) -> Result:
    """Write a complete result folder: of case 1, whose payload is taken for a point at the tip."""
    logs = folder.parent / "logs"
    algid.synthesise(
        "case1",
        duration=duration,
        torque="wide",
        sensors=Sensors(1e-4, 1e-2, start_ns=START_NS),
        out=logs,
        force=True,
    )
    unloaded, loaded = (logs / f"case1-{role}.mcap" for role in ("unloaded", "loaded"))
    algid.identify(unloaded, loaded=loaded, out=logs, force=True)
    shutil.copytree(logs / "case1-unloaded.algid", folder, dirs_exist_ok=True)
    made = read_result(folder)
    payload = {name: made.payload[name] for name in ("m_p", "l1")}
    result = made.model_copy(update={"payload": payload, "loaded": {}})
    write_result(result, folder / "result.json")
    return result


def estimate(value: float, std: float, unit: str, status: Status = Status.OK) -> Estimate:
    """An estimate with its normal interval."""
    return Estimate(
        estimate=value,
        std=std,
        ci95=(value - NORMAL * std, value + NORMAL * std),
        unit=unit,
        status=status,
    )


HOSTILE = '<script>document.title="owned"</script>"><img src=x onerror=document.title="owned">.csv'


def hostile(result: Result) -> Result:
    """`result` with markup, quotes and control characters wherever a log or a user may put text."""
    log = replace_log(result.log, f"logs/{HOSTILE}")
    return result.model_copy(
        update={
            "log": log,
            "more_logs": [
                replace_log(log, "x/</script><svg onload=alert(1)>\x1b[31m\u202egnp.csv")
            ],
            "settings": {HOSTILE: HOSTILE, "a|b": "`c` | [red]d[/red] [x](javascript:alert(1))"},
            "notices": [
                Notice("H", text) for text in (HOSTILE, "]]><!-- \x1b]0;owned\x07", "@everyone ```")
            ],
            "estimator": "<b>bold</b>",
        }
    )


def replace_log(log: LogSummary, path: str) -> LogSummary:
    """`log` under another name, its channels named as badly."""
    return log.model_copy(
        update={"path": path, "mapping": {"theta1": f"/joint {HOSTILE}", HOSTILE: "x"}}
    )
