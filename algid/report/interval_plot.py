"""Estimates with their 95 % intervals as one figure of matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from algid.errors import SettingError
from algid.results import Result, Status
from algid.text import resolved, significant, unit_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MISSING = "plot: expected matplotlib, found none; install it with: pip install 'algid[plots]'"
WIDEST = 100.0
"""Percent of the estimate, at which an interval is cut off: beyond it the sign is open."""
WIDTH, ROW, FRAME = 7.1, 0.26, 0.9  # inches
COLOURS = {True: "#0b62c4", False: "#b3560a"}  # of sound estimates, and of the others
STYLE: Any = {"font.size": 8, "pdf.fonttype": 42}


def interval_plot(result: Result) -> Figure:
    """A row a parameter: half its 95 % interval to both sides, in percent of the estimate.

    Raises
    ------
    SettingError
        If matplotlib is not installed.
    """
    try:
        import matplotlib as mpl
        from matplotlib.figure import Figure
    except ImportError as error:
        raise SettingError(MISSING) from error
    rows = [(name, one) for name, one in result.estimates.items() if one.estimate is not None]
    with mpl.rc_context(STYLE):
        sheet = Figure(figsize=(WIDTH, FRAME + ROW * max(len(rows), 1)), layout="constrained")
        axes = sheet.subplots()
        widest = 0.0
        for place, (_, one) in enumerate(rows):
            low, high = one.ci95 or (None, None)
            colour = COLOURS[one.status is Status.OK]
            axes.plot(0.0, place, "o", color=colour, markersize=4)
            if one.estimate and low is not None and high is not None:
                half = 50.0 * (high - low) / abs(one.estimate)
                widest = max(widest, half)
                axes.plot([-half, half], [place, place], color=colour, linewidth=2)
        axes.axvline(0.0, color="#8a8f98", linewidth=0.8, zorder=0)
        axes.set_yticks(range(len(rows)), [_words(name, one) for name, one in rows])
        axes.invert_yaxis()
        if widest > WIDEST:
            axes.set_xlim(-WIDEST, WIDEST)
        axes.set_xlabel("95 % interval, % of the estimate")
        axes.set_title(result.verdict.sentence, fontsize=8, loc="left", wrap=True)
    return sheet


def _words(name: str, one: Any) -> str:
    low, high = one.ci95 or (None, None)
    half = "" if low is None or high is None else f" ± {significant((high - low) / 2, 2)}"
    return f"{name}  {resolved(one.estimate, one.std)}{half} {unit_text(one.unit)}".rstrip()
