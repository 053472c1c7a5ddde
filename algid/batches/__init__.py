"""Batches: many logs, one job each, that survive bad logs, dying workers and a killed run."""
