"""Farthest points, relaxed points, means, as multiples of one exact sweep; curves pulled tight.

All is of one thread, and counts the processor's seconds, which others on the machine disturb less
than those on the clock.
"""

import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
import potpourri3d
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

import geodesic_core as gc
from benchmarks import timing
from benchmarks.inputs import Inputs
from benchmarks.tables import Section, rated

SURFACES = ("horse97k.ply", "dragon100k.ply", "icosphere 6")
FARTHEST, RELAXED, ITERATIONS = 1000, 100, 20
FARTHEST_SWEEPS, RELAXED_SWEEPS = 8.0, 30.0
"""Time of farthest points, and of relaxing, as multiples of a sweep's, at most"""
MEAN_OF = 10
CURVES = 20
NO_LONGER = 1.0 + 1e-9

by_turns = partial(timing.by_turns, clock=time.process_time)


def run(inputs: Inputs, runs: int) -> Iterator[Section]:
    """Measure points that are spread, relaxed and averaged."""
    gc.warm_up()
    rows = []
    for name, vertices, faces in inputs.arrays(SURFACES):
        mesh = gc.TriangleMesh(vertices, faces)
        few = gc.farthest_points(mesh, RELAXED)
        calls: list[Callable[[], Any]] = [
            partial(gc.exact_distance, mesh, 0),
            partial(gc.farthest_points, mesh, FARTHEST),
            partial(gc.relax_points, mesh, few.points, ITERATIONS),
            partial(gc.mean_point, mesh, few.points[:MEAN_OF]),
        ]
        (sweep_s, _), (spread_s, _), (relaxed_s, relaxed), (mean_s, mean) = by_turns(calls, runs)
        rows.append(
            [
                name,
                f"{1e3 * sweep_s:.0f}",
                rated(spread_s / sweep_s, FARTHEST_SWEEPS, at_least=False, digits=1),
                rated(relaxed_s / sweep_s, RELAXED_SWEEPS, at_least=False, digits=1),
                f"{relaxed.costs[-1] / relaxed.costs[0]:.3f}",
                f"{mean_s / sweep_s:.1f}",
                f"{mean.moves}",
            ]
        )
    yield Section(
        "Samples",
        f"Processor time in exact sweeps from vertex 0 of the same prepared mesh, medians of {runs}"
        f" runs by turns: {FARTHEST:,} farthest points; {ITERATIONS} iterations of Lloyd's method "
        f"with {RELAXED}, and what they leave of the cost; the mean of {MEAN_OF}, and how often it "
        f"moved.",
        ["mesh", "sweep, ms", "farthest", "relaxed", "cost left", "mean", "moves"],
        rows,
    )
    yield _curves(inputs, runs)


def _curves(inputs: Inputs, runs: int) -> Section:
    """Compare paths along edges, pulled tight, with those that edge flips make of them."""
    rows = []
    for name, vertices, faces in inputs.arrays(SURFACES):
        mesh, flips = (
            gc.TriangleMesh(vertices, faces),
            potpourri3d.EdgeFlipGeodesicSolver(vertices, faces),
        )
        ours, theirs, crossed, ratios = [], [], [], []
        for stops in _paths_along_edges(mesh):
            rough = mesh.curve(stops)
            (ours_s, tight), (flips_s, points) = by_turns(
                [partial(gc.straighten, rough), partial(flips.find_geodesic_path_poly, stops)], runs
            )
            ours.append(ours_s)
            theirs.append(flips_s)
            crossed.append(len(tight.faces))
            ratios.append(tight.length / np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        rows.append(
            [
                name,
                f"{np.median(crossed):.0f}",
                f"{1e3 * np.median(ours):.1f}",
                f"{1e3 * np.median(theirs):.1f}",
                f"{sum(ratio <= NO_LONGER for ratio in ratios)} of {len(ratios)}",
                f"{sum(ratio * NO_LONGER < 1.0 for ratio in ratios)}",
                f"{100.0 * (1.0 - min(ratios)):.3f}",
            ]
        )
    return Section(
        "Curves pulled tight",
        f"Shortest paths along edges between {CURVES} random pairs of vertices, pulled tight: "
        f"by `straighten` and by `EdgeFlipGeodesicSolver` of potpourri3d, medians of CPU time.",
        [
            "mesh",
            "faces crossed",
            "ours, ms",
            "flips, ms",
            "ours no longer",
            "ours shorter",
            "at most by, %",
        ],
        rows,
    )


def _paths_along_edges(mesh: gc.TriangleMesh) -> Iterator[list[int]]:
    """Yield the vertices of shortest paths along edges between random vertices."""
    ends = np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)]).reshape(2, -1)
    lengths = np.linalg.norm(np.subtract(*mesh.vertices[ends]), axis=1)
    graph = coo_array((lengths, ends), shape=(len(mesh.vertices),) * 2).tocsr()
    graph = graph.maximum(graph.T)
    pairs = np.random.default_rng(1).choice(len(mesh.vertices), (CURVES, 2))
    for start, end in pairs.tolist():
        _, before = dijkstra(graph, indices=start, return_predecessors=True)
        stops = [end]
        while stops[-1] != start:
            stops.append(int(before[stops[-1]]))
        yield stops
