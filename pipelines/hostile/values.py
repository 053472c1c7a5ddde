"""Values that no flag, no TOML file and no result should have, and changes of a document that put
them there.
"""

from __future__ import annotations

import copy
import json
import random
from typing import Any

HUGE = (1e308, -1e308, 1e300, 1e154, 1e30, 1e12, 1e9, -1e9)
TINY = (0.0, -0.0, 5e-324, 1e-308, 1e-154, 1e-12, -1e-12)
NUMBERS: tuple[float, ...] = (
    *HUGE,
    *TINY,
    float("inf"),
    float("-inf"),
    float("nan"),
    1.0,
    -1.0,
    0.5,
    2.0,
    1000.0,
)
WHOLE = (0, 1, -1, 2, 7, 255, 10**4, 2**31, -(2**31), 2**63, -(2**63) - 1, 10**25, 10**400)
TEXTS = (
    *(
        "",
        " ",
        "a",
        "k1",
        "m_p",
        "nan",
        "OK",
        "SINGULAR",
        "true",
        "0",
        "-1",
        "1e999",
        ",",
        ",,",
        "=",
        "a=b",
        "1,2",
    ),
    *(
        "../../evil",
        "/etc/passwd",
        "..",
        ".",
        "~",
        "a/b",
        "a\\b",
        "-",
        "--",
        "x" * 300,
        "x" * 5000,
        "a.b" * 200,
    ),
    *(
        "\x1b[31mred\x1b]0;t\x07",
        "line\nfeed",
        "tab\tnul\0",
        "\u202eltr",
        "θ–名",
        "\ud800",
        "\U000e0041",
        "é" * 130,
    ),
    *(
        "<script>alert(1)</script>",
        "[bold]x[/bold]",
        "[/]",
        "%s%n",
        "{0.__class__}",
        "'; drop",
        "$(touch evil)",
    ),
    *(
        "2026-01-01",
        "0001-01-01",
        "9999-12-31T23:59:59",
        "2026-02-30",
        "12:00",
        "1e3",
        "0x10",
        "1_000",
        "٣",
    ),
    *(
        "coulomb",
        "stribeck",
        "delay,lag",
        "auto",
        "plain",
        "gain",
        "estimate",
        "deg",
        "A",
        "shoulder,elbow",
        "FOO",
    ),
)


def number(draw: random.Random) -> float:
    """A number, now and then a sane one."""
    return draw.choice(NUMBERS) if draw.random() < 0.8 else draw.uniform(-10, 10)


def text(draw: random.Random) -> str:
    return draw.choice(TEXTS)


def anything(draw: random.Random) -> Any:
    """A value of any of JSON's types."""
    deep: Any = 1
    for _ in range(draw.choice((3, 60, 200))):
        deep = [deep] if draw.random() < 0.5 else {"a": deep}
    makers = (
        *(
            lambda: number(draw),
            lambda: number(draw),
            lambda: draw.choice(WHOLE),
            lambda: text(draw),
        ),
        *(lambda: None, lambda: draw.random() < 0.5, list, dict, lambda: deep),
        *(
            lambda: [number(draw)] * draw.choice((1, 2, 7, 3000)),
            lambda: [text(draw)] * draw.choice((1, 2, 500)),
        ),
        lambda: {text(draw): number(draw) for _ in range(draw.choice((1, 3, 300)))},
    )
    return draw.choice(makers)()


def places(content: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Where the values of a document stand."""
    inner = (
        content.items()
        if isinstance(content, dict)
        else enumerate(content)
        if isinstance(content, list)
        else ()
    )
    found = [path] if path else []
    for key, value in list(inner)[:60]:
        found += places(value, (*path, key))
    return found


def changed(content: Any, draw: random.Random) -> Any:
    """A copy of a document of dicts and lists with one to three values changed, removed, added or
    doubled.
    """
    content = copy.deepcopy(content)
    for _ in range(draw.choice((1, 1, 2, 3))):
        every = places(content)
        if not every:
            return content
        *above, last = draw.choice(every)
        holder = content
        for key in above:
            holder = holder[key]
        _change(holder, last, draw)
    return content


def _change(holder: Any, key: Any, draw: random.Random) -> None:
    old, kind = holder[key], draw.randrange(10)
    if kind == 0:
        del holder[key]
    elif kind == 1 and isinstance(holder, dict):
        holder[text(draw)] = anything(draw)
    elif kind == 1:
        holder.extend([old] * draw.choice((1, 2, 500)))
    elif kind == 2:
        holder[key] = [old]
    elif kind == 3 and isinstance(old, (list, tuple)):
        holder[key] = draw.sample(list(old), draw.randrange(len(old) + 1))
    elif kind == 4 and isinstance(old, str):
        holder[key] = draw.choice((old.upper(), old + text(draw), old[:1], old * 200))
    elif isinstance(old, (int, float)) and not isinstance(old, bool) and kind < 9:
        holder[key] = draw.choice(
            (number(draw), -old, _scaled(old, 10.0 ** draw.choice((-30, -3, 3, 30))), str(old))
        )
    else:
        holder[key] = anything(draw)


def _scaled(old: int | float, by: float) -> int | float:
    """Whole numbers may lie beyond all floats."""
    try:
        return old * by
    except OverflowError:
        return old * 10**30


def as_toml(content: dict[str, Any]) -> str:
    """A document in TOML; what TOML cannot say is said as it would be in JSON."""
    lines = [
        f"{_key(key)} = {_inline(value)}"
        for key, value in content.items()
        if not isinstance(value, dict)
    ]
    for key, value in content.items():
        if isinstance(value, dict):
            lines += [
                f"[{_key(key)}]",
                *(f"{_key(inner)} = {_inline(one)}" for inner, one in value.items()),
            ]
    return "\n".join(lines) + "\n"


def _key(key: str) -> str:
    return json.dumps(key, ensure_ascii=False)


def _inline(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(key)} = {_inline(one)}" for key, one in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_inline, value)) + "]"
    if isinstance(value, float):
        return repr(value)  # nan and inf are TOML's own words
    return "" if value is None else json.dumps(value, ensure_ascii=False)
