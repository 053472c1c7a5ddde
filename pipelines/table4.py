"""Print Table 4 of both cases: the paper's errors, those of its method here, and the refined
estimator's.

python -m pipelines.table4 build/demo
"""

from __future__ import annotations

import sys
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from algid.results import Table4Row, read_result

CASES = ("case1", "case2")


def rows(folder: Path, estimator: str, case: str) -> list[Table4Row]:
    """Table 4 of one case by one estimator."""
    return read_result(folder / estimator / f"{case}-unloaded.algid").table4


def table4(folder: Path) -> Table:
    """Errors in percent: by case the paper's print, its method here, the refined estimator."""
    table = Table(
        title="Table 4, estimation error (%): the paper's print, its method here, and algid's "
        "refined estimator",
        title_justify="left",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
    )
    table.add_column("Parameter", no_wrap=True)
    columns = [
        [
            row.paper_error_percent if estimator is None else row.error_percent
            for row in rows(folder, estimator or "paper", case)
        ]
        for case in CASES
        for estimator in (None, "paper", "refined")
    ]
    for number, _ in enumerate(CASES, 1):
        for heading in ("paper", "here", "refined"):
            table.add_column(f"Case {number}\n{heading}", justify="right", no_wrap=True)
    for place, row in enumerate(rows(folder, "paper", CASES[0])):
        found = [column[place] for column in columns]
        table.add_row(row.parameter, *("–" if value is None else f"{value:.3g}" for value in found))
    return table


if __name__ == "__main__":
    Console().print(table4(Path(sys.argv[1])))
    print(
        "The paper does not state the torque; this one was fitted to its table: see `algid guide "
        "estimators`."
    )
