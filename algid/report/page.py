"""The report of an identification: its content, and the files `report.html`, `report.md`."""

from __future__ import annotations

from pathlib import Path

from algid.arm import CONSTANT_NAMES
from algid.base.errors import ResultError
from algid.base.progress import Progress
from algid.base.text import file_name, significant
from algid.base.words import counted
from algid.methods import settles
from algid.report.arm import arm_of
from algid.report.document import Content, Document, Section
from algid.report.figures import figures, intervals, of_paper
from algid.report.plot import Plot
from algid.report.render import markdown, page, write_library, write_texts
from algid.report.series import Drawn, drawn
from algid.report.tables import (
    arm_tables,
    fit_tables,
    log_tables,
    nuisance_tables,
    paper_tables,
    prediction_table,
    result_provenance,
    samples_table,
    terms_table,
    used_settings,
)
from algid.results import Result, read_result


def write_pages(
    folder: Path, shared_library: bool = False, progress: Progress | None = None
) -> list[Path]:
    """Write `report.html` and `report.md` into the result folder `folder`, from what it holds.

    Parameters
    ----------
    folder : Path
        Holds `result.json` and, as far as they are known, the Parquet series.
    shared_library : bool
        Whether the plotting library stands once beside the folder, for a folder of many results,
        instead of inside the page.
    progress : callable
        Called as samples of the torque are read.

    Raises
    ------
    ResultError
        If `result.json` is missing or not a result of this version.
    OutputError
        If the pages cannot be written.
    """
    result = read_result(folder)
    if shared_library:
        write_library(folder.parent)
    text = page(result_document(result, folder, progress), shared_library)
    return write_texts(
        folder, {"report.html": text, "report.md": markdown(result_document(result))}
    )


def result_document(
    result: Result, folder: Path | None = None, progress: Progress | None = None
) -> Document:
    """The report of an identification; with its `folder` also the figures and its samples."""
    fit, leads = result.fit, settles(result.estimator)
    names = [file_name(log.path) for log in result.logs]
    raw: Drawn | None = None
    lost: list[Content] = []
    plots: list[Content] = []
    paper: list[Content] = []
    samples: list[Content] = []
    if folder is not None:
        if (folder / "torque.parquet").is_file():
            try:
                raw = drawn(folder / "torque.parquet", progress=progress)
                samples.append(samples_table(raw.logs, names))
            except ResultError as error:
                lost.append(f"Not shown: {error}.")
        plots, paper = [*lost, *figures(folder, result, raw)], list(of_paper(folder, result))
    first: list[Content] = [*arm_tables(result)]
    other, zero = nuisance_tables(result)
    if folder is not None and fit is not None:
        first.append(intervals(result))
    if fit is not None:
        first.append(prediction_table(fit))
    may_be = f"{counted(len(zero.rows), 'term')} of the torque may be zero"
    paper += paper_tables(result)
    of_paper_section = Section("paper", "The paper's figure and tables", tuple(paper), not leads)
    terms: list[Content] = [other]
    if fit is not None:
        terms.append(terms_table(fit))
    notes = tuple(one.sentence for one in result.verdict.notes)
    sections = [
        Section("numbers", "Numbers", tuple(first)),
        *([of_paper_section] if leads else []),
        *_parts(plots[:1]),
        Section("terms", "Other terms of the torque", tuple(terms)),
        Section("zero", may_be, (zero,), folded=True),
        *_parts(plots[1:]),
        Section(
            "fit",
            "Noise, whiteness and bounds",
            () if fit is None else fit_tables(fit),
            folded=True,
        ),
        Section("data", "Data quality", (notes, *samples, *log_tables(result.logs)), folded=True),
        Section(
            "settings", "Settings and provenance",
            (used_settings(result), result_provenance(result)), folded=True,
        ),
        *([] if leads else [of_paper_section]),
    ]  # fmt: skip
    constants = [one.usable for name, one in result.parameters.items() if name in CONSTANT_NAMES]
    seconds = significant(sum(log.duration for log in result.logs), 4)
    return Document(
        title=f"Identification of {names[0]}",
        verdict=result.verdict,
        sections=tuple(sections),
        kicker="identification of a two-link arm",
        name=names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more",
        facts=f"{sum(constants)} of {counted(len(constants), 'constant')} identified · "
        f"{result.estimator} estimator · {seconds} s of log at "
        f"{significant(result.log.rate, 4)} Hz · "
        f"{counted(sum(log.rows for log in result.logs), 'sample')}",
        made=f"Made by algid {result.version} from result.json.",
        arm=arm_of(result, raw),
    )


def _parts(plots: list[Content]) -> list[Section]:
    """A section a figure."""
    parts = []
    for place, one in enumerate(plots):
        key, title = (one.key, one.title) if isinstance(one, Plot) else (f"lost-{place}", "Figure")
        parts.append(Section(key, title, (one,)))
    return parts
