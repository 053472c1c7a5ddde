"""Benchmarks and pipelines: what `make` runs beside the tests."""
