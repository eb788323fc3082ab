"""The half-edge structure of a mesh and its construction, and a search tree over its points."""
