"""Simulated arms and the logs they leave."""
