"""The window sweep: continuous Dijkstra with trimming and merging (sections 3 and 4)."""
