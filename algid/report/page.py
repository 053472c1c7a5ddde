"""The report of an identification: its content, and the files `report.html`, `report.md`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from algid.files import whole_file
from algid.methods import settles
from algid.progress import Progress
from algid.report.arm import arm_of
from algid.report.document import Bullets, Document, Drawn, Fold, ReadingAid, Section, Table
from algid.report.drawings import bars, forest
from algid.report.frame import LIBRARY, library, page
from algid.report.gallery import Gallery, gallery
from algid.report.markdown import markdown
from algid.report.tables import (
    estimate_tables,
    fit_tables,
    log_tables,
    quality_tables,
    result_provenance,
    terms_tables,
    used_settings,
)
from algid.results import Result, read_result
from algid.text import file_name, significant
from algid.words import counted

FIRST = ("Parameters", "Payload")
SECOND = ("Torque prediction",)
# on a page: by the interval, by the forest plot, and by Table 4
TOLD_ELSEWHERE = ("± std", "± std, %", "Paper %")
TERMS_READING = (
    "Read: a bar to the left lowers the error of torque that was held out; a term is kept where "
    "it does so and its "
    "odds are good. What is left out would gain no more than stands here."
)


def write_report(
    folder: Path, shared_library: bool = False, progress: Progress | None = None
) -> Path:
    """Write `report.html` into the result folder `folder`, from what it holds.

    Parameters
    ----------
    folder : Path
        Holds `result.json` and, as far as they are known, `estimates.parquet`, `loaded.parquet`,
        `torque.parquet` and `information.parquet`; the page says what is absent.
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
        If the page cannot be written.
    """
    result = read_result(folder)
    script = folder.parent / LIBRARY
    if shared_library and not (
        script.is_file() and script.stat().st_size == len(library().script.encode())
    ):
        _write(script, library().script)
    return _write(folder / "report.html", page_html(folder, result, shared_library, progress))


def write_markdown(folder: Path) -> Path:
    """Write `report.md` into the result folder `folder`. Raises `ResultError`, `OutputError`."""
    return _write(folder / "report.md", markdown(result_document(read_result(folder))))


def _write(path: Path, text: str) -> Path:
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def page_html(
    folder: Path, result: Result, shared_library: bool = False, progress: Progress | None = None
) -> str:
    """The text of the page of `result`.

    With `shared_library` it asks for the library beside the folder.
    """
    return page(result_document(result, gallery(folder, result, progress)), shared_library)


def result_document(result: Result, shown: Gallery | None = None) -> Document:
    """The report of an identification; `shown` holds its figures, which only a page has."""
    tables = estimate_tables(result)
    first = [table for table in tables if table.title in FIRST]
    paper = [table for table in tables if table.title not in (*FIRST, *SECOND)]
    terms = list(terms_tables(result))
    torque = None if shown is None else shown.torque
    figures, convergence = ([], []) if shown is None else (shown.figures, shown.paper)
    data = (*quality_tables(torque, result), *log_tables(result.logs))
    noted = tuple(one.sentence for one in result.verdict.notes)
    notes = Bullets(
        noted, "What the readers and the estimator warn of stands at the top of the page."
    )
    fold: Fold = "open" if _truth(result) else "closed"  # folded where a real log is
    of_paper = (*convergence, *paper)
    leads = settles(result.estimator)
    folded = Section(of_paper, "paper", "The paper's figure and tables", fold=fold)
    sections = (
        Section(
            (
                *(first if shown is None else _with_intervals(first, result)),
                *(table for table in tables if table.title in SECOND),
            ),
            beside=arm_of(result, torque),
        ),
        Section(of_paper if leads else ()),
        Section(tuple(figures[:1])),
        Section(
            tuple(terms if shown is None else _with_gains(terms, result)),
            "terms",
            "What the model lacks",
        ),
        Section(tuple(figures[1:])),
        Section(fit_tables(result), "fit", "What the estimator knows of the logs"),
        Section((notes, *data), "data", "Data quality"),
        Section(
            (used_settings(result), result_provenance(result)),
            "settings",
            "Settings and provenance",
        ),
        Section() if leads else folded,
    )
    name = file_name(result.log.path)
    seconds, samples = (
        sum(log.duration for log in result.logs),
        sum(log.rows for log in result.logs),
    )
    return Document(
        title=f"Identification of {name}",
        verdict=result.verdict,
        sections=sections,
        kicker="identification of a two-link arm",
        name=f"{name} and {len(result.more_logs)} more" if result.more_logs else name,
        facts=f"{result.estimator} estimator · {significant(seconds, 4)} s of log at "
        f"{significant(result.log.rate, 4)} Hz · {counted(samples, 'sample')}",
        made=f"Made by algid {result.version} from result.json.",
        tab=name,
    )


def _with_intervals(tables: Sequence[Table], result: Result) -> list[Table]:
    """The first tables of estimates with their forest plot, less what it tells.

    The last one says what is drawn.
    """
    logs, truth = _own(result), _truth(result)
    drawn = forest({**result.parameters, **result.payload}, truth, logs)
    shown = [table.without(TOLD_ELSEWHERE) for table in tables]
    if not shown or not drawn.rows:
        return shown
    scale = significant(drawn.limit, 1)
    marks = [f"Drawn: the 95 % interval on a scale of ± {scale} % of the estimate, arrows beyond"]
    marks += (
        [
            (
                "grey dots: each unloaded log by itself, hollow at the edge where it lies beyond "
                "the scale"
            )
        ]
        if logs
        else []
    )
    marks += ["orange ring: the truth"] if truth else []
    shown[-1] = replace(shown[-1], note="; ".join(marks) + ".")
    return [
        replace(table, drawn=(Drawn(drawn.heading, drawn.rows, after="Unit"),)) for table in shown
    ]


def _own(result: Result) -> dict[str, list[float]]:
    """Each unloaded log's own estimates by name, of several logs.

    a loaded one's hold its payload's share.
    """
    estimates = [] if result.fit is None else result.fit.by_log
    # a log too short to be fitted has none, and which it is nobody tells
    if len(estimates) != len(result.logs):
        return {}
    own = [one for one, log in zip(estimates, result.logs, strict=True) if log.role == "unloaded"]
    values = {
        name: [value for one in own if name in one and (value := one[name].estimate) is not None]
        for name in result.parameters
    }
    return {name: kept for name, kept in values.items() if len(kept) > 1}


def _truth(result: Result) -> dict[str, float]:
    """What a synthetic log was made with, by parameter."""
    return {
        row.parameter: row.truth for row in result.table4 if row.truth is not None
    } | result.truth


def _with_gains(terms: Sequence[Table], result: Result) -> list[Table | ReadingAid]:
    """The terms that were tried, each with what it gains drawn; nothing where none was."""
    tried = [] if result.fit is None else result.fit.terms
    gains = {term.term: -100 * term.gain_heldout for term in tried if term.gain_heldout is not None}
    if not gains:
        return list(terms)
    column = Drawn("error held out", bars(gains), after="Held-out error, %")
    return [*(replace(table, drawn=(column,)) for table in terms), ReadingAid(TERMS_READING)]
