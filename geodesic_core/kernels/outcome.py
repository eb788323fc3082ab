"""The ways in which kernels end; the module above them raises."""

from enum import IntEnum


class Outcome(IntEnum):
    """The end of a kernel."""

    FINISHED = 0
    """Nothing is left to do"""

    # A slice of a sweep, or the propagation of one list in it
    RUNNING = 1
    """The budget is used up"""
    POOL_FULL = 2
    """The pool has no room for the windows that may come next"""
    SCRATCH_FULL = 3
    """A list is longer than scratch"""
    RETAINED_FULL = 4
    """There is no room for the windows of a face that are to be retained"""
    MERGES_FULL = 5
    """There is no room to record what may be merged next"""
    RUNAWAY = 6
    """A list came up again and again: RUNS times in a merging sweep, MOST_RUNS in an exact one"""

    # The rows of a table
    NARROWED = 7
    """The sweep of a row need not go so far any more"""
    ROWS_DONE = 8
    """Some rows are done"""
    ROWS_FULL = 9
    """There may be no room for the entries of a row that is done"""

    # A traced path
    PATH_FULL = 10
    """The path has more points than the arrays hold"""
    LOST = 11
    """The line left the surface: a defect"""

    # The vertices and faces of a mesh
    NOT_FINITE = 12
    """A coordinate is NaN or infinite"""
    TOO_LARGE = 13
    """A coordinate is beyond LARGEST_COORDINATE"""
    OUT_OF_RANGE = 14
    """A face names a vertex that is not there"""
    REPEATED_VERTEX = 15
    """A face names a vertex twice"""
    TOO_SHORT = 16
    """An edge is longer than 0, and shorter than SHORTEST_EDGE"""
