"""The report of an identification: its content, and the files `report.html`, `report.md`."""

from __future__ import annotations

from pathlib import Path

from algid.base.progress import Progress
from algid.base.text import counted, file_name, joined, significant
from algid.methods import settles
from algid.report.document import Content, Document, Section
from algid.report.figures import arm_of, figures, intervals, over_time
from algid.report.render import markdown, page, write_library, write_texts
from algid.report.series import drawn
from algid.report.tables import (
    fit_tables,
    log_tables,
    paper_tables,
    parameter_tables,
    prediction_table,
    provenance_table,
    settings_of,
    settings_table,
    terms_table,
)
from algid.results import Result, read_result
from algid.results.verdict import replaced_estimator

FACTS = "{} of {} identified · {} estimator · {} s of log at {} Hz · {}"


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
        If `result.json` is missing or not a result of this version, or a series is damaged.
    OutputError
        If the pages cannot be written.
    """
    result = read_result(folder)
    if shared_library:
        write_library(folder.parent)
    document = result_document(result, folder, progress)
    texts = {"report.html": page(document, shared_library), "report.md": markdown(document)}
    return write_texts(folder, texts)


def result_document(
    result: Result, folder: Path | None = None, progress: Progress | None = None
) -> Document:
    """The report of an identification; with its `folder` also the figures and its samples."""
    fit, raw = result.fit, None
    names = [file_name(log.path) for log in result.logs]
    arm, other, zero = parameter_tables(result)
    first, plots, paper = list[Content](arm), list[Section](), list[Content]()
    if folder is not None:
        raw = drawn(folder / "torque.parquet", progress=progress)
        plots = [Section(one.key, one.title, [one]) for one in figures(folder, result, raw)]
        paper += [over_time(folder, result, name) for name in ("estimates", "loaded")]
        first.append(intervals(result) if fit is not None else None)
    if fit is not None:
        tried = {"logs used": fit.residual, "each log by the others": fit.cross_validation}
        first.append(prediction_table({name: one for name, one in tried.items() if one}))
    asked = replaced_estimator(result)
    notes = [one.sentence for one in result.verdict.notes]
    estimator = result.estimator if asked is None else f"{result.estimator}, in place of {asked}"
    origin = [("algid", result.version), ("estimator", estimator)]
    made_by = [settings_table(settings_of(result)), provenance_table(origin, result.logs)]
    title = "The paper's figure and tables"
    may_be = f"{counted(len(zero.rows), 'term')} of the torque may be zero"
    sections = [
        Section("numbers", "Numbers", first),
        *plots[:1],
        Section("terms", "Other terms of the torque", [other, terms_table(fit)]),
        Section("zero", may_be, [zero], folded=True),
        *plots[1:],
        Section("fit", "Noise, whiteness and bounds", fit_tables(fit), folded=True),
        Section("data", "Data quality", [notes, *log_tables(result.logs)], folded=True),
        Section("settings", "Settings and provenance", made_by, folded=True),
        Section("paper", title, [*paper, *paper_tables(result)], not settles(result.estimator)),
    ]
    constants = [row[4] for row in arm[0].rows]
    return Document(
        verdict=result.verdict,
        sections=sections,
        kicker="identification of a two-link arm",
        name=joined(names, 1),
        facts=FACTS.format(
            constants.count("OK"),
            counted(len(constants), "constant"),
            result.estimator,
            significant(sum(log.duration for log in result.logs), 4),
            significant(result.log.rate, 4),
            counted(sum(log.rows for log in result.logs), "sample"),
        ),
        arm=arm_of(result, raw),
    )
