"""The judge of `make fuzz` over calls, and what it draws."""

from __future__ import annotations

import pytest

from pipelines.fuzz_calls import judged


@pytest.mark.parametrize(
    ("code", "out", "err", "kind"),
    [
        (0, "fine\n", "wrote x\n", "done"),
        (2, "", "algid: x: no such file; check the name\n", "refused"),
        (142, "", "", "hang"),
        (70, "", "algid: internal error: KeyError: 'x'\n", "internal"),
        (1, "", "Traceback (most recent call last):\nValueError: x\n", "traceback"),
        (0, "", "x.py:3: RuntimeWarning: overflow\n", "warning"),
        (5, "", "", "code"),
        (0, "a\x1b[31m", "", "escape"),
        (0, "", "\u202e", "escape"),
        (2, "", "out of words\n", "lines"),
        (2, "", "algid: while reading x: not enough memory (MemoryError: x)\n", "memory"),
        (
            2,
            "",
            "algid: while reading x: a library cannot take it (PanicError: x); look at the file\n",
            "library",
        ),
    ],
)
def test_the_judge_sees_every_bad_end(code: int, out: str, err: str, kind: str) -> None:
    assert judged(("report", "x"), code, out, err)[0] == kind


@pytest.mark.parametrize("text", ["{", '{"a": NaN}'])
def test_the_judge_reads_what_is_printed_as_json(text: str) -> None:
    assert judged(("compare", "--format", "json"), 0, text, "")[0] == "json"
