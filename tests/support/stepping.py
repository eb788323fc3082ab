"""Sweeps driven by hand: one list or one vertex at a time, on a mesh of the zoo."""

import math
from collections.abc import Iterator

import numpy as np

import geodesic_core as gc
from geodesic_core.kernels.mesh.half_edges import Topology
from geodesic_core.kernels.sweep import continuous_dijkstra
from geodesic_core.kernels.sweep.propagation import POOL_FULL, SCRATCH_FULL
from geodesic_core.kernels.sweep.state import (
    View,
    Wavefront,
    exact_bounds,
    new_wavefront,
    with_larger_pool,
    with_larger_scratch,
)
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


def steps(topology, wave, limit=math.inf, budget=1) -> Iterator[tuple[int, Wavefront]]:
    """Run to the end; after each slice the outcome and the wavefront, which growing replaces.

    With a budget of 1 a slice is one list or one vertex.
    """
    outcome = continuous_dijkstra.RUNNING
    while outcome != continuous_dijkstra.FINISHED:
        outcome = continuous_dijkstra.advance(topology, wave, exact_bounds(limit), budget)
        if outcome == POOL_FULL:
            wave = with_larger_pool(wave)
        elif outcome == SCRATCH_FULL:
            wave = with_larger_scratch(wave)
        yield outcome, wave


def finished(topology, wave, limit=math.inf, budget=WHOLE) -> Wavefront:
    for _, last in steps(topology, wave, limit, budget):
        wave = last
    return wave


def view_of_arrays(topology, wave, bounds=exact_bounds(math.inf)) -> View:  # noqa: B008
    """The View that kernels see, of flat arrays in place of pointers: so that tests can hold it."""
    flat = {
        name: getattr(state, name).reshape(-1)
        for state in (topology, wave)
        for name in state._fields
        if name in View._fields
    }
    goal, scalars = bounds.goal, bounds._asdict()
    del scalars["goal"]
    return View(
        **flat,
        known=goal.known,
        landmarks=goal.landmarks.reshape(-1),
        window_ints=wave.windows.view(np.int32).reshape(-1),
        scratch_ints=wave.scratch.view(np.int32).reshape(-1),
        kept_ints=wave.kept.view(np.int32).reshape(-1),
        ring_capacity=len(wave.ring),
        pool=len(wave.windows),
        scratch_size=len(wave.scratch),
        keep_capacity=len(wave.kept),
        merge_capacity=len(wave.merges),
        **scalars,
        pruned=len(wave.heuristic) > 0,
        irregular=len(wave.passed) > 0,
        start=goal.position,
        least=goal.least,
        most=goal.most,
        vertex_count=len(topology.total_angle),
        site_count=len(wave.site_ints),
        limit=goal.limit,
        landmark_count=goal.landmark_count,
        knows=len(goal.known) > 0,
        ceiling=goal.ceiling,
    )
