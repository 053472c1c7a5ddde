"""What a report says, whatever shows it: a verdict, tables, and what stands folded away below them.

Identification, track and fleet each make one; the terminal, Markdown and the pages merely set it.
"""

from __future__ import annotations

from dataclasses import dataclass

from algid.report.table import Table
from algid.report.tables import chosen_terms, estimate_tables, fit_tables, log_tables, provenance_table, terms_tables
from algid.report.text import file_name
from algid.report.verdict import Verdict, verdict
from algid.results import Result


@dataclass(frozen=True)
class Document:
    """One report.

    Parameters
    ----------
    title : str
    verdict : Verdict
    tables : what was found, which every format shows
    more : what lies behind it, which a terminal has no room for
    summary : title of `details`
    details : what was read, and how
    """

    title: str
    verdict: Verdict
    tables: tuple[Table, ...]
    more: tuple[Table, ...] = ()
    summary: str = ""
    details: tuple[Table, ...] = ()


def result_document(result: Result) -> Document:
    """The report of an identification."""
    chosen = chosen_terms(result)
    return Document(
        f"Identification of {file_name(result.log.path)}",
        verdict(result),
        (*estimate_tables(result), *chosen),
        (*fit_tables(result), *(table for table in terms_tables(result) if table not in chosen)),
        "Logs and provenance",
        (log_tables(result)[0], provenance_table(result)),
    )
