"""The report of an identification: its content, and the files `report.html`, `report.md`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from algid.files import whole_file
from algid.methods import settles
from algid.progress import Progress
from algid.report.arm import arm_of
from algid.report.document import (
    Bullets,
    Content,
    Document,
    Drawn,
    Fold,
    ReadingAid,
    Section,
    Table,
)
from algid.report.drawings import bars, forest
from algid.report.frame import LIBRARY, library, page
from algid.report.gallery import Gallery, gallery
from algid.report.markdown import markdown
from algid.report.series import TorqueLog
from algid.report.tables import (
    estimate_tables,
    fit_tables,
    known_truth,
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
    first: list[Table] = []
    second: list[Table] = []
    paper: list[Content] = []
    for table in estimate_tables(result):
        if table.title in FIRST:
            first.append(table)
        elif table.title in SECOND:
            second.append(table)
        else:
            paper.append(table)
    terms: list[Content] = list(terms_tables(result))
    torque, figures = None, []
    if shown is not None:
        torque, figures = shown.torque, shown.figures
        paper = shown.paper + paper
        first, terms = _with_intervals(first, result), _with_gains(result)
    fold: Fold = "open" if known_truth(result) else "closed"  # folded where a real log is
    leads = settles(result.estimator)
    sections = [Section(tuple(first + second), beside=arm_of(result, torque))]
    if leads:
        sections.append(Section(tuple(paper)))
    sections += [
        Section(tuple(figures[:1])),
        Section(tuple(terms), "terms", "What the model lacks"),
        Section(tuple(figures[1:])),
        Section(fit_tables(result), "fit", "What the estimator knows of the logs"),
        Section((_notes(result),) + _data_tables(result, torque), "data", "Data quality"),
        Section(
            (used_settings(result), result_provenance(result)),
            "settings",
            "Settings and provenance",
        ),
    ]
    if not leads:
        title = "The paper's figure and tables"
        sections.append(Section(tuple(paper), "paper", title, fold=fold))
    name = file_name(result.log.path)
    others = f" and {len(result.more_logs)} more" if result.more_logs else ""
    seconds = sum(log.duration for log in result.logs)
    samples = sum(log.rows for log in result.logs)
    return Document(
        title=f"Identification of {name}",
        verdict=result.verdict,
        sections=tuple(sections),
        kicker="identification of a two-link arm",
        name=f"{name}{others}",
        facts=f"{result.estimator} estimator · {significant(seconds, 4)} s of log at "
        f"{significant(result.log.rate, 4)} Hz · {counted(samples, 'sample')}",
        made=f"Made by algid {result.version} from result.json.",
        tab=name,
    )


def _notes(result: Result) -> Bullets:
    """How the logs were read and the fit was done."""
    sentences = tuple(one.sentence for one in result.verdict.notes)
    return Bullets(
        sentences, "What the readers and the estimator warn of stands at the top of the page."
    )


def _data_tables(result: Result, torque: TorqueLog | None) -> tuple[Table, ...]:
    """What the logs are."""
    return quality_tables(torque, result) + log_tables(result.logs)


def _with_intervals(tables: Sequence[Table], result: Result) -> list[Table]:
    """The first tables of estimates with their forest plot, less what it tells.

    The last one says what is drawn.
    """
    logs, truth = _own(result), known_truth(result)
    drawn = forest(result.parameters | result.payload, truth, logs)
    shown = [table.without(TOLD_ELSEWHERE) for table in tables]
    if not shown or not drawn.rows:
        return shown
    scale = significant(drawn.limit, 1)
    marks = [f"Drawn: the 95 % interval on a scale of ± {scale} % of the estimate, arrows beyond"]
    if logs:
        marks.append(
            "grey dots: each unloaded log by itself, hollow at the edge where it lies beyond "
            "the scale"
        )
    if truth:
        marks.append("orange ring: the truth")
    shown[-1] = replace(shown[-1], note="; ".join(marks) + ".")
    column = Drawn(drawn.heading, drawn.rows, after="Unit")
    return [replace(table, drawn=(column,)) for table in shown]


def _own(result: Result) -> dict[str, list[float]]:
    """Each unloaded log's own estimates by name, of several logs.

    a loaded one's hold its payload's share.
    """
    # a log too short to be fitted has none, and which it is nobody tells
    if result.fit is None or len(result.fit.by_log) != len(result.logs):
        return {}
    own: dict[str, list[float]] = {}
    for log, estimates in zip(result.logs, result.fit.by_log, strict=True):
        if log.role != "unloaded":
            continue
        for name, one in estimates.items():
            if name in result.parameters and one.estimate is not None:
                own.setdefault(name, []).append(one.estimate)
    return {name: values for name, values in own.items() if len(values) > 1}


def _with_gains(result: Result) -> list[Content]:
    """The terms that were tried, each with what it gains drawn; nothing where none was."""
    tables = terms_tables(result)
    if result.fit is None:
        return []
    gains = {}
    for term in result.fit.terms:
        if term.gain_heldout is not None:
            gains[term.term] = -100 * term.gain_heldout
    if not gains:
        return list(tables)
    column = Drawn("error held out", bars(gains), after="Held-out error, %")
    shown: list[Content] = [replace(table, drawn=(column,)) for table in tables]
    shown.append(ReadingAid(TERMS_READING))
    return shown
