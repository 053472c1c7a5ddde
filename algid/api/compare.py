"""Results side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from algid.api import Answer
from algid.api.options import opened, stem_of, verb
from algid.base.errors import SettingError
from algid.options import Option
from algid.results import Result

if TYPE_CHECKING:
    from algid.report.comparison import Comparison


@verb
def compare(
    *results: Annotated[
        Result | str | Path | Sequence[Result | str | Path], Option(kind=list[Path])
    ],
    labels: Sequence[str] | None = None,
    out: str | Path | None = None,
    force: bool = False,
) -> Comparison:
    """Lay results side by side: differences in σ from the first one, and which settings differ.

    Parameters
    ----------
    *results : Result or path of one, one after another, or in a list
        Two results or more.
    labels : str, one each
        What to call them; by default the names of their folders, or of their logs.
    out : Path
        Page NAME.html, or the folder to write compare.html into. None writes nothing.
    force : bool
        Replace what is there.

    Returns
    -------
    Comparison
        `sigma`, an array (R, P) of each result's distances from the first one by parameter
        (`names`), in combined standard deviations; `largest_sigma`, `settings` that differ, tables.

    Raises
    ------
    SettingError
        If there are fewer than two results, or not a label each.
    ResultError
        If a result cannot be read.
    OutputError
        If a page is there already and `force` is not set, or cannot be written.

    Examples
    --------
    $ algid compare monday.algid friday.algid -o friday

    >>> import algid
    >>> logs = algid.synthesise("case1", duration=3.0, torque="wide", torque_noise=1e-2)
    >>> ways = [algid.identify(*logs, estimator=name) for name in ("refined", "weak")]
    >>> algid.compare(*ways, labels=["refined", "weak"]).largest_sigma < 4
    True
    """
    from algid.report.comparison import compare as compared
    from algid.report.comparison import write_comparison

    given = list[Any]()
    for one in results:
        given += one if isinstance(one, list | tuple) else [one]
    if len(given) < 2:
        raise SettingError(
            f"compare: expected two results or more, found {len(given)}; name another one"
        )
    if labels is not None and len(labels) != len(given):
        raise SettingError(f"labels: expected {len(given)}, found {len(labels)}")
    labels = labels or list(map(stem_of, given))
    comparison = compared(list(map(opened, given)), labels)
    if out is not None:
        write_comparison(comparison, page_of(Path(out)), force)
    return comparison


def page_of(out: Path) -> Path:
    """Where the page of a comparison goes."""
    return out if out.suffix == ".html" else out / "compare.html"


def answer(found: Comparison, given: Mapping[str, Any]) -> Answer:
    """The tables."""
    remarks = [f"wrote {page_of(Path(given['out']))}"] if "out" in given else []
    return Answer(found.tables(), found.as_json, remarks)
