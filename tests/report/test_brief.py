"""What a terminal shows of a result: 25 lines of 80 columns, whatever the log."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

import algid
from algid.notices import Notice, Remedy
from algid.profile import Profile
from algid.report.brief import HEIGHT, WIDTH, brief
from algid.results import Result
from algid.results.model import TorqueModel
from algid.settings import Settings
from algid.synth.sensors import Sensors


def held(result: Result) -> str:
    """The lines as one text, once they are within their bounds."""
    lines = brief(result)
    assert len(lines) <= HEIGHT, lines
    for line in lines:  # a path that is longer than a line stands alone in its own
        assert len(line) <= WIDTH or " " not in line.removesuffix(" \\").strip(), lines
    return "\n".join(lines)


def test_verdict_reasons_estimates_terms_and_fit_stand_in_25_lines(result: Result) -> None:
    text = held(result)
    assert text.startswith("Good: ")
    for words in ("gravity moment of link 2", "k7", "m_p", "R²"):
        assert words in text
    noted = [
        Notice(code, "said " * 40, logs=(f"{code}.csv",))
        for code in ("ONE", "TWO", "THREE", "FOUR")
    ]
    doubtful = held(result.model_copy(update={"notices": noted}))
    assert "[ONE]" in doubtful
    assert "with -v: " in doubtful


@pytest.mark.parametrize("estimator", ["weak", "paper"])
def test_a_simulated_log_shows_its_errors(estimator: str) -> None:
    logs = algid.synthesise("case1", duration=3.0, excitation="wide", sensors=Sensors(1e-3, 1e-2))
    text = held(algid.identify(*logs, settings=Settings(estimator=estimator)))
    assert " % " in text
    assert "gravity moment of link 1" in text  # the longest meaning breaks, and is not left out
    _, numbers = text.split("\n\n")
    errors = [line[34:42] for line in numbers.splitlines() if line.startswith(("k", "m_p", "l"))]
    assert len(errors) >= 9
    assert all(error.endswith(" %") for error in errors)


def test_a_call_that_is_too_long_is_told_what_to_add(result: Result) -> None:
    made = shlex.join(["algid", "identify", *(f"runs/of/the/arm/{n:03}.csv" for n in range(60))])
    wrong = Notice(
        "GRAVITY_COMPENSATED",
        numbers={"case": "arm"},
        remedies=(Remedy({"zero": "hanging"}, "hanging"),),
    )
    failing = result.model_copy(
        update={"notices": [wrong], "settings": {**result.settings, "command": made}}
    )
    text = held(failing)
    assert "Run first: the same command with --zero hanging --force" in text


def test_a_failed_log_says_what_to_run_first() -> None:
    log, _ = algid.synthesise("case1", duration=3.0, excitation="wide", sensors=Sensors(1e-3, 1e-2))
    log.theta[1] *= -1
    log = algid.Log.from_arrays(log.t, log.theta, log.tau, name="runs/of may/arm 1.csv")
    text = held(algid.identify(log, settings=Settings(estimator="weak"), zero="hanging", start=0.1))
    assert text.startswith("Failed: ")
    command = text.partition("Run first: ")[2].partition("\n\n")[0].partition("\nk1")[0]
    words = shlex.split(command.replace("\\\n", " "))
    assert words[:3] == ["algid", "identify", "runs/of may/arm 1.csv"]
    for flags in (["--estimator", "weak"], ["--zero", "hanging"], ["--start", "0.1"]):
        place = words.index(flags[0])
        assert words[place : place + 2] == flags


@pytest.mark.slow
def test_a_real_arm_fits_too(shared_data: Path) -> None:
    logs = sorted((shared_data / "dfki" / "A0_sysid").glob("*.csv"))
    found = algid.identify(
        logs[0], settings=Settings(estimator="weak"), profile=Profile(zero="hanging")
    )
    assert "gravity moment of link 2" in held(found)


def test_the_terms_are_named(result: Result) -> None:
    assert result.fit is not None
    model = TorqueModel(terms=[], coulomb_speed=0.1, stribeck_speed=0.1, chosen_by="logs")
    bare = result.model_copy(update={"fit": result.fit.model_copy(update={"model": model})})
    assert "Optional torque terms: none" in held(bare)
    terms = ["coulomb", "offset", "stribeck", "load"]
    fit = result.fit.model_copy(update={"model": model.model_copy(update={"terms": terms})})
    late = {**result.parameters, "delay": result.parameters["k1"]}
    text = held(result.model_copy(update={"fit": fit, "parameters": late}))
    assert "Optional torque terms: coulomb, offset, stribeck, load, delay (delay " in " ".join(
        text.split()
    )
    several = {f"{name}{joint}": result.parameters["k1"] for name in "fose" for joint in (1, 2)}
    text = held(result.model_copy(update={"fit": fit, "parameters": result.parameters | several}))
    shown = text.partition("Optional torque terms: ")[2].partition(")")[0].replace("\n", " ")
    numbers = re.findall(r"[fose]\d \S+ ± [\d.e-]+(?=,)", shown)  # no number is cut
    assert shown.endswith(f", {8 - len(numbers)} more with -v")
    assert numbers
