"""Signals on a time grid: segments, filters, differences, observers."""
