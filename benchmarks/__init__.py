"""Measurements against peers and targets: ``python -m benchmarks [exact|topology|service …]``."""
