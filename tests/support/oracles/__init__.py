"""Answers that do not come from geodesic_core.

Each module computes exact geodesic distances in its own naive way, from numpy and the standard
library alone: closed forms where one exists, enumeration of unfoldings for any small mesh, and
visibility graphs for planar domains with holes. They check one another in
``core/properties/test_oracles.py``.
"""
