"""Sweeps driven by hand: one list or one vertex at a time, on a mesh of the zoo."""

import math
from collections.abc import Iterator

import numpy as np

import geodesic_core as gc
from geodesic_core.kernels.front.bounds import exact_bounds
from geodesic_core.kernels.front.state import (
    View,
    Wavefront,
    new_wavefront,
    sizes_of,
    with_larger_pool,
    with_larger_scratch,
)
from geodesic_core.kernels.front.window import NO_WINDOW, Window
from geodesic_core.kernels.mesh.half_edges import LENGTH, OPPOSITE, Topology
from geodesic_core.kernels.outcome import Outcome
from geodesic_core.kernels.sweep import continuous_dijkstra
from tests.support import zoo

WHOLE = 1 << 60
"""A budget that no sweep uses up."""


def topology_of(case: zoo.Case) -> Topology:
    return gc.TriangleMesh(case.vertices, case.faces).topology


def started(topology, sources, starts=None, limit=math.inf) -> Wavefront:
    """A wavefront at its sources, which are numbered as the caller numbers them."""
    wave = new_wavefront(topology)
    inner = topology.inner_vertex[np.atleast_1d(sources)]
    starts = np.zeros(len(inner)) if starts is None else np.asarray(starts, dtype=float)
    origins = np.arange(len(inner), dtype=np.int32)
    continuous_dijkstra.start_sweep(topology, wave, inner, origins, starts, exact_bounds(limit))
    return wave


def steps(topology, wave, limit=math.inf, budget=1) -> Iterator[tuple[Outcome, Wavefront]]:
    """Run to the end; after each slice the outcome and the wavefront, which growing replaces.

    With a budget of 1 a slice is one list or one vertex.
    """
    outcome = Outcome.RUNNING
    while outcome != Outcome.FINISHED:
        outcome = continuous_dijkstra.advance(topology, wave, exact_bounds(limit), budget)
        if outcome == Outcome.POOL_FULL:
            wave = with_larger_pool(wave)
        elif outcome == Outcome.SCRATCH_FULL:
            wave = with_larger_scratch(wave)
        yield outcome, wave


def finished(topology, wave, limit=math.inf, budget=WHOLE) -> Wavefront:
    for _, last in steps(topology, wave, limit, budget):
        wave = last
    return wave


def view_of_arrays(topology, wave, bounds=exact_bounds(math.inf)) -> View:  # noqa: B008
    """The View that kernels see, of flat arrays in place of pointers: so that tests can hold it."""
    sizes = getattr(sizes_of, "py_func", sizes_of)(topology, wave, bounds)
    return _flat(View(mesh=topology, **wave._asdict(), bounds=bounds, sizes=sizes))


def window(b0, b1, sx, sy, sigma, xi=0.0, root=0) -> Window:
    """A window whose rays are not parallel."""
    ends = NO_WINDOW._replace(b0=b0, b1=b1, root=root, reference=-1 - root)
    return ends._replace(sx=sx, sy=sy, sigma=sigma, xi=xi, turn=0.0)  # NaN equals nothing


def with_pool(wave: Wavefront, **arrays) -> Wavefront:
    """The wavefront with other arrays in its pool."""
    return wave._replace(pool=wave.pool._replace(**arrays))


def _flat(group):
    if isinstance(group, np.ndarray):
        return group.reshape(-1)
    return type(group)(*map(_flat, group)) if hasattr(group, "_fields") else group


def flat_view(scale):
    """A flat mesh: its view, its wavefront, and an inner half-edge of length ``scale``."""
    points, faces = zoo.grid(3, 3)
    topology = topology_of(zoo.Case("flat", points * scale, faces))
    wave = started(topology, 0)
    lengths = topology.geometry[:, LENGTH]
    inner = (topology.links[:, OPPOSITE] >= 0) & (abs(lengths / scale - 1) < 1e-9)
    return view_of_arrays(topology, wave), wave, int(np.flatnonzero(inner)[0])
