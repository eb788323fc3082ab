"""Mesh files: their bytes become polygons, by one module for each format."""
