"""Fast sweeps: a few windows a half-edge, in buckets, each the length of a path that exists."""
