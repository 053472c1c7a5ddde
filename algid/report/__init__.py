"""Reports: the terminal's table, `report.md`, `report.html`, comparisons, logs for viewers."""
