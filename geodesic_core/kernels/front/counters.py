"""Counters of a sweep: one array for all kinds of sweep, whose entries are numbered here."""

import numpy as np

from geodesic_core.arrays import Longs

# The pool
FREE_FIRST = 0  # slot of the first window that was given back, -1 if there is none
FREE_SIZE = 1
FRESH = 2  # rows from here on were never used
PEAK = 3  # windows alive at once, at most
RETAINED_ROWS = 4
MERGES = 5  # recorded for backtracing

# Work
WORK = 6  # done in this slice: units of about 10 ns; windows in a fast sweep
CREATED = 7  # windows, in all
PROPAGATED = 8  # windows that crossed a face

# Vertices
TOUCHED = 9
SETTLED_VERTICES = 10

# The heap and the ring
HEAP_SIZE = 11
RING_HEAD = 12
RING_SIZE = 13

# The buckets of a fast sweep
CURRENT = 14  # bucket that is being emptied, counted from distance 0
IN_BUCKETS = 15  # windows that wait in the ring of buckets
FAR_FIRST = 16  # slot of the first window beyond the ring, -1 if there is none
FAR_BUCKET = 17  # the nearest bucket of those

# Whether sources were added later, so that lists may wait for an end that is not settled anew
ADDED = 18

COUNTERS = 19


def new_counters() -> Longs:
    """Return the counters of a sweep before it starts."""
    counters = np.zeros(COUNTERS, np.int64)
    counters[[FREE_FIRST, FAR_FIRST]] = -1
    return counters
