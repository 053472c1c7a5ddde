"""Estimators of the arm's constants and payload from segments of motion: mathematics alone."""
