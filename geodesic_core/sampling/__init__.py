"""Points spread over a surface, and points in the middle of others."""
