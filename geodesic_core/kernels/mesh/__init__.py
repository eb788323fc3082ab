"""The half-edge structure of a mesh, and its construction."""
