"""Distances and paths between chosen points: two, the k nearest, or many."""
