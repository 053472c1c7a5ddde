"""Reports: the terminal's table, `report.md`, `report.html`, comparisons, and logs for other viewers."""
