"""What a terminal shows of a result: few lines of 80 columns, and a command to be copied."""

from __future__ import annotations

from algid.notices import Notice, Remedy, Verdict
from algid.report.terminal import WIDTH, brief, verdict_lines
from algid.results import Result

MOST = 28
"""Lines: a verdict of three, three reasons of two each, a row an estimate, terms and notes."""


def shown(result: Result) -> str:
    """The lines as one text, once they are within their bounds."""
    lines = brief(result)
    assert len(lines) <= MOST, lines
    for line in lines:  # a path that is longer than a line stands alone in its own
        fits = len(line) <= WIDTH or line.startswith("Run first: ")
        assert fits or " " not in line.strip(), lines
    return "\n".join(lines)


def test_verdict_reasons_estimates_and_fit_are_shown(result: Result) -> None:
    text = shown(result)
    assert text.startswith("Good: ")
    for words in ("gravity moment of link 2", "k7", "m_p"):
        assert words in text
    found = result.fit.residual.model_copy(update={"r2": (0.5, 0.99991), "bandwidth": 60.0})
    fit = result.fit.model_copy(update={"residual": found, "cross_validation": None})
    line = "R² of the torque below 60 Hz: joint 1 50.00 %, joint 2 over 99.99 %"
    assert line in brief(result.model_copy(update={"fit": fit}))
    codes = ("ONE", "TWO", "THREE", "FOUR")
    noted = [Notice(code, "said " * 90, logs=(f"{code}.csv",)) for code in codes]
    noted.append(Notice("FIVE", "five", note=True))
    doubtful = shown(result.model_copy(update={"notices": noted}))
    assert "Data notes (1): FIVE" in doubtful
    assert doubtful.startswith("With reservations: ")
    assert all(f"[{code}]" in doubtful for code in codes[:3])
    assert "1 more reason, with -v: FOUR" in doubtful


def test_a_simulated_log_shows_its_errors_and_a_long_meaning_breaks(result: Result) -> None:
    text = shown(result)
    assert "gravity moment of link 1" in text
    _, numbers = text.split("\n\n")
    errors = [line[34:42] for line in numbers.splitlines() if line.startswith(("k", "m_p", "l"))]
    assert len(errors) == 9
    assert all(error.endswith(" %") for error in errors)


def test_the_command_to_run_first_is_one_line_to_be_copied() -> None:
    command: str | None = "algid identify 'runs/of may/arm 1.csv' --zero hanging " + 9 * "--force "
    lines = verdict_lines(Verdict("failed", "it failed", command=command))
    assert lines == ["Failed: it failed.", f"Run first: {command}"]
    # without one, as in Python, a reason says what mends it
    reason = Notice("WRONG", "wrong by physics: zero", remedies=(Remedy({"zero": "hanging"}),))
    for command, said in ((None, ": --zero hanging"), ("algid identify", "")):
        judged = Verdict("failed", "it failed", (reason,), command=command)
        assert verdict_lines(judged, most=1)[1] == f" • wrong by physics: zero{said} [WRONG]"
