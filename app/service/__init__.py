"""Use cases: meshes, queries and maintenance, independent of HTTP."""
