"""Backtracing of shortest paths (section 3.5), and paths along edges."""
