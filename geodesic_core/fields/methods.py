"""Methods by name: the sweep of each, and what its distances promise."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, Literal, NamedTuple, get_args

from geodesic_core.errors import InvalidArgument
from geodesic_core.fields.fast_sweep import FastSweep, estimated
from geodesic_core.fields.path import EXACT, ErrorBound
from geodesic_core.fields.question import Question
from geodesic_core.fields.sweeps import ExactSweep, MergingSweep, Sweep, guaranteed
from geodesic_core.mesh.triangle_mesh import TriangleMesh
from geodesic_core.validation import check_choice, is_index, is_number

Method = Literal["exact", "approximate", "fast"]

Effort = Literal[1, 2, 4, 8]
"""Places of a half-edge at which a fast sweep compares windows"""

FAST_FROM = {4: 20_000, 8: 100_000}
"""Faces from which on sweeps of the larger efforts take less time than exact ones"""

SweepOf = Callable[[Question], Sweep]
"""Function that returns the sweep of a question"""


def sweep_of(
    mesh: TriangleMesh,
    method: Method,
    relative_error: float | None = None,
    absolute_error: float | None = None,
    effort: Effort = 2,
) -> SweepOf:
    """Return the sweep of a method on a mesh: `ExactSweep` itself where no other is quicker.

    Raises
    ------
    InvalidArgument
        An argument that the method takes is out of its domain.
    """
    check_choice("method", method, get_args(Method))
    if method == "fast":
        places = as_effort(effort)
        if not _is_quicker_exactly(mesh, places):
            return partial(FastSweep, effort=places)
    if method == "approximate":
        relative, absolute = _as_errors(relative_error, absolute_error)
        if not mesh.is_rough:  # where merging saves no time
            return partial(MergingSweep, relative_error=relative, absolute_error=absolute)
    return ExactSweep


def _is_quicker_exactly(mesh: TriangleMesh, effort: int) -> bool:
    """Whether an exact sweep takes about the time of a fast one, or less; see docs/accuracy.md."""
    return effort in FAST_FROM and (len(mesh.faces) < FAST_FROM[effort] or mesh.is_rough)


def promise_of(
    mesh: TriangleMesh,
    method: Method,
    relative_error: float | None,
    absolute_error: float | None,
    effort: Effort,
) -> ErrorBound:
    """Return the error of the distances that a method finds on a mesh.

    Raises
    ------
    InvalidArgument
        As in `sweep_of`.
    """
    check_choice("method", method, get_args(Method))
    if method == "fast":
        places = as_effort(effort)
        return EXACT if _is_quicker_exactly(mesh, places) else estimated(places)
    if method == "exact":
        return EXACT
    errors = _as_errors(relative_error, absolute_error)
    return EXACT if mesh.is_rough else guaranteed(*errors)


class Accuracy(NamedTuple):
    """A method, and its allowed error or its effort."""

    method: Method = "exact"
    relative_error: float | None = 1e-3
    absolute_error: float | None = None
    effort: Effort = 2

    def sweep_on(self, mesh: TriangleMesh) -> SweepOf:
        """Return its sweep on a mesh; see `sweep_of`."""
        return sweep_of(mesh, *self)

    def promise_on(self, mesh: TriangleMesh) -> ErrorBound:
        """Return the error of its distances on a mesh; see `promise_of`."""
        return promise_of(mesh, *self)

    @property
    def chosen(self) -> dict[str, Any]:
        """The method, and the arguments that it takes, by name."""
        taken = {"approximate": ("relative_error", "absolute_error"), "fast": ("effort",)}
        return {name: getattr(self, name) for name in ("method", *taken.get(self.method, ()))}


def _as_errors(relative: float | None, absolute: float | None) -> tuple[float, float]:
    if relative is None and absolute is None:
        raise InvalidArgument("relative_error and absolute_error are both None; give at least one")
    if relative is not None and not (is_number(relative) and 0.0 < relative < 1.0):
        raise InvalidArgument(
            f"relative_error is {relative!r}; it must be a number above 0 and below 1"
        )
    if absolute is not None and not (
        is_number(absolute) and absolute > 0.0 and math.isfinite(absolute)
    ):
        raise InvalidArgument(f"absolute_error is {absolute!r}; it must be a finite number above 0")
    return (
        math.inf if relative is None else float(relative),
        math.inf if absolute is None else float(absolute),
    )


def as_effort(effort: Effort) -> int:
    """Return an effort, or raise InvalidArgument."""
    if not is_index(effort) or effort not in get_args(Effort):
        raise InvalidArgument(f"effort is {effort!r}; it must be 1, 2, 4 or 8")
    return int(effort)
