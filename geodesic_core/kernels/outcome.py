"""Outcomes of kernels that can end in several ways; the module above them raises."""

from enum import IntEnum


class Outcome(IntEnum):
    """How a slice of a sweep ended, or the propagation of one list in it."""

    FINISHED = 0
    """Nothing is left to do"""
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
    """A list came up again and again"""
