"""Reports: the terminal's table, `report.md`, `report.html`, comparisons, and logs for other viewers."""

from algid.report.comparison import Comparison, compare
from algid.report.export import export_mcap
from algid.report.markdown import markdown, write_markdown
from algid.report.page import write_report
from algid.report.terminal import print_table

__all__ = ["Comparison", "compare", "export_mcap", "markdown", "print_table", "write_markdown", "write_report"]
