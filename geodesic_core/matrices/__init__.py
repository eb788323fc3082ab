"""Matrices of distances: one plan, one driver, and sinks for arrays, files and parts."""
