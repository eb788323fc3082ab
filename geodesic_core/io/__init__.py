"""From the bytes of a mesh file to polygons: one module for each format."""
