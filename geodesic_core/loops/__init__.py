"""Curves pulled tight, loops that cannot be shrunk, and paths around obstacles."""
