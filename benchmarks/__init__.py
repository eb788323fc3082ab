"""Measurements against peers and targets: ``python -m benchmarks [name …]``."""
